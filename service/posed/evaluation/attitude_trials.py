"""The smartphone attitude data set (Michel, Genevès, Fourati, Layaïda 2017) as trials: streams, truth, what counts.

Beside the trials' folders, or one above, `trials.csv` lists them (`trial,motion,magnetic_disturbance,excluded_s,
calibration`): groups, spans of motion-capture time that do not count (`FROM-TO FROM-TO`, s), and the day whose
calibration applies. `calibration/DAY/mag/magnetometer.txt` is a turning about all axes, `.../gyr/gyroscope.txt` a
stillness, both plain or gzipped.
"""

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from functools import lru_cache
from pathlib import Path

import numpy as np

from posed.errors import RecordingError
from posed.evaluation.calibration_fit import fit_ellipsoid, fit_still_rate
from posed.evaluation.measures import BoolArray
from posed.evaluation.trial import INPUTS, Trial
from posed.events import EventColumn, SensorType
from posed.hal.attitude_trial import find_stream, load_trial, read_stream
from posed.hal.calibration import Calibration
from posed.hal.profile import UNCALIBRATED_TYPE
from posed.hal.recording import TruthTrack, read_text

DATASET = "smartphone-attitude"


class CalibrationChoice(Enum):
    """Which calibration a phone's magnetometer and gyroscope get."""

    OWN = "own"
    """Fitted here, of the calibration recordings."""
    ANDROID = "android"
    """Android's, as its calibrated streams have it."""


def is_attitude_trial(folder: Path) -> bool:
    """Return whether a folder holds a trial's accelerometer stream or truth."""
    return find_stream(folder, "accelerometer.txt") is not None or (folder / "qualisys.mat").exists()


def load_attitude_trial(folder: Path, calibration: CalibrationChoice) -> Trial:
    """Read a trial; without trials.csv nothing is excluded, and the only calibration day there is applies.

    Raises RecordingError if a file is missing or malformed, MissingExtraError without scipy.
    """
    recording = load_trial(folder)
    truth = recording.truth
    if truth is None:
        raise RecordingError(f"{folder} holds no qualisys.mat; without truth there is nothing to compare with")
    root = next((above for above in folder.absolute().parents[:2] if (above / "trials.csv").exists()), None)
    listed = _listed(root, folder.name) if root else {}
    if calibration is CalibrationChoice.OWN:
        fitted = _calibration(folder, root, listed.get("calibration", ""))
        columns = dict(recording.columns)
        for kind, each in fitted.items():
            raw = columns.get(UNCALIBRATED_TYPE[kind])
            if raw is None:
                raise RecordingError(
                    f"{folder} holds no {UNCALIBRATED_TYPE[kind].name.lower()} stream to calibrate; use Android's"
                    " calibration, or copy the trial again"
                )
            columns[kind] = EventColumn(raw.timestamp_ns, each.apply(raw.values[:, :3]), raw.accuracy)
        recording = replace(recording, columns=columns)
    recording = replace(
        recording, columns={kind: recording.columns[kind] for kind in INPUTS if kind in recording.columns}
    )
    counted = _outside(folder, truth, listed.get("excluded_s", ""))
    return Trial(DATASET, _groups(folder.name, listed), recording, truth, counted)


def _listed(root: Path, name: str) -> Mapping[str, str]:
    path = root / "trials.csv"
    try:
        for row in csv.DictReader(io.StringIO(read_text(path), newline="")):
            if row.get("trial") == name:
                return {key: value for key, value in row.items() if key and value}
    except csv.Error as error:
        raise RecordingError(f"{path} is not comma-separated text ({error}); copy it again") from error
    return {}


def _groups(name: str, listed: Mapping[str, str]) -> tuple[str, ...]:
    disturbed = listed.get("magnetic_disturbance", "true" if "_Dist_" in name else "false") == "true"
    motion = listed.get("motion", name.rpartition("_")[2].lower())
    return ("all_trials", "disturbed" if disturbed else "undisturbed", motion)


def _outside(folder: Path, truth: TruthTrack, excluded: str) -> BoolArray:
    seconds = (truth.timestamp_ns - truth.timestamp_ns[0]) / 1e9
    counted = np.ones(len(seconds), np.bool_)
    for span in excluded.split():
        try:
            first, last = (float(edge) for edge in span.split("-"))
        except ValueError:
            first = last = math.nan
        if not -math.inf < first < last < math.inf:
            raise RecordingError(
                f"trials.csv excludes {span!r} from {folder.name}; expected spans FROM-TO in seconds, FROM before TO,"
                " blanks between"
            )
        counted &= (seconds < first) | (seconds > last)
    return counted


def _calibration(folder: Path, root: Path | None, day: str) -> Mapping[SensorType, Calibration]:
    places = [root] if root else folder.absolute().parents[:2]
    for place in places:
        days = sorted(path for path in (place / "calibration").glob("*") if path.is_dir())
        chosen = [path for path in days if path.name == day] if day else days
        if len(chosen) == 1:
            return _fitted(chosen[0])
    where = " or ".join(str(place / "calibration") for place in places)
    raise RecordingError(
        f"no calibration {day or 'day'} for {folder.name} in {where}; copy it there, or use Android's calibration"
    )


@lru_cache(maxsize=8)
def _fitted(day: Path) -> Mapping[SensorType, Calibration]:
    fitted = {}
    for kind, name, fit in (
        (SensorType.MAGNETIC_FIELD, "mag/magnetometer.txt", fit_ellipsoid),
        (SensorType.GYROSCOPE, "gyr/gyroscope.txt", fit_still_rate),
    ):
        path = find_stream(day, name)
        if path is None:
            raise RecordingError(f"{day / name} is missing, plain and .gz; copy it, or use Android's calibration")
        column, _ = read_stream(path, 6)
        try:
            fitted[kind] = fit(column.values[:, :3])
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from error
    return fitted
