"""Trials of BROAD, the Berlin Robust Orientation Estimation Assessment Dataset (Laidig, Caruso, Cereatti, Seel 2021).

A trial is one MATLAB file: `imu_gyr` (rad/s), `imu_acc` (m/s2), `imu_mag` (uT), float64[n, 3], in axes of the IMU;
`opt_quat`, float64[n, 4] as (w, x, y, z), IMU to ENU, NaN where the tracking was lost; `opt_pos` (m); `movement`, which
of the n samples count; `sampling_rate` (Hz), one for all. Truth and magnetometer have the same north.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from posed.errors import MissingExtraError, RecordingError
from posed.evaluation.trial import Trial
from posed.events import Float64Array, SensorType
from posed.hal.recording import Recording, TruthTrack, in_time_order, read_text

DATASET = "broad"

_ARRAYS = {"imu_gyr": 3, "imu_acc": 3, "imu_mag": 3, "opt_quat": 4, "opt_pos": 3}
_SENSORS = {
    SensorType.ACCELEROMETER: "imu_acc",
    SensorType.MAGNETIC_FIELD: "imu_mag",
    SensorType.GYROSCOPE: "imu_gyr",
}
_GROUPS = (
    "undisturbed",
    "rotation",
    "translation",
    "combined",
    "slow",
    "fast",
    "with_breaks",
    "disturbed",
    "tapping",
    "vibration",
    "stationary_magnet",
    "attached_magnet",
    "office",
    "mixed",
)


def load_broad(path: Path) -> Trial:
    """Read a trial and its groups, from `trials.json` beside it or, without that, from the words of its name.

    Raises RecordingError if a file is missing, damaged or not as described, MissingExtraError without scipy.
    """
    content = read_mat(path)
    arrays = {name: _array(path, content, name, width) for name, width in _ARRAYS.items()}
    count = len(arrays["imu_gyr"])
    movement = np.asarray(content.get("movement")).ravel()
    rate_hz = _rate(path, content)
    lengths = {name: len(array) for name, array in arrays.items()} | {"movement": len(movement)}
    if count < 2 or set(lengths.values()) != {count}:
        found = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise RecordingError(f"{path}: lengths {found}; expected one length, 2 or more, for all")
    timestamp_ns = np.rint(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)
    columns = {kind: in_time_order(timestamp_ns, arrays[name])[0] for kind, name in _SENSORS.items()}
    truth = TruthTrack(timestamp_ns, arrays["opt_quat"][:, [1, 2, 3, 0]], arrays["opt_pos"])
    recording = Recording(path.stem, columns, {}, load_truth=lambda: truth)
    return Trial(DATASET, _groups(path), recording, truth, movement.astype(np.bool_))


def read_mat(path: Path) -> Mapping[str, Any]:
    """Return the variables of a MATLAB file.

    Raises RecordingError if it is missing or damaged, MissingExtraError without scipy.
    """
    try:
        from scipy.io import loadmat
    except ImportError as error:
        raise MissingExtraError(
            f"reading {path} needs scipy; install it with: pip install 'posed[evaluate]'"
        ) from error
    try:
        content: Mapping[str, Any] = loadmat(path, squeeze_me=True)
    except FileNotFoundError as error:
        raise RecordingError(f"{path} is missing; name an existing trial") from error
    except Exception as error:  # scipy's reader answers damage with anything, UnboundLocalError included
        raise RecordingError(f"{path} is not a readable MATLAB file ({error}); copy it again") from error
    return content


def _array(path: Path, content: Mapping[str, Any], name: str, width: int) -> Float64Array:
    try:
        array = np.asarray(content[name], np.float64)
    except KeyError:
        raise RecordingError(f"{path} lacks {name}; expected a trial of BROAD, with {', '.join(_ARRAYS)}") from None
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{path}: {name} holds no numbers ({error}); copy it again") from error
    if array.ndim != 2 or array.shape[1] != width:
        raise RecordingError(f"{path}: {name} has shape {array.shape}; expected n x {width}")
    return array


def _rate(path: Path, content: Mapping[str, Any]) -> float:
    try:
        rate_hz = float(content["sampling_rate"])
    except (KeyError, TypeError, ValueError):
        rate_hz = float("nan")
    if not 0.0 < rate_hz < 1e5:
        raise RecordingError(
            f"{path}: sampling_rate is {content.get('sampling_rate')!r}; expected a number of Hz above 0"
        )
    return rate_hz


def _groups(path: Path) -> tuple[str, ...]:
    listed = path.with_name("trials.json")
    if listed.exists():
        try:
            trials = json.loads(read_text(listed))["trials"]
            if path.stem in trials:
                return tuple(str(group) for group in trials[path.stem]["groups"])
        except (ValueError, KeyError, TypeError) as error:
            raise RecordingError(
                f"{listed} is not as expected ({error!r}); expected trials, each with a list of groups"
            ) from error
    words = f"_{path.stem}_"
    found = [group for group in _GROUPS if f"_{group}_" in words]
    if "undisturbed" in found and "with_breaks" not in found:
        found.append("no_breaks")
    return ("all_trials", *found)
