"""Trials of the smartphone attitude data set of Michel, Genevès, Fourati and Layaïda 2017, with optical truth.

A trial is a folder of Android streams, plain or gzipped, one sample a line, blanks between, time in seconds first
(`accelerometer.txt`, `gyroscope.txt`, ...; see `_STREAMS`), and Qualisys truth: `qualisys.mat`, with
`timeAlignment.txt`, the seconds that added to Android time give Qualisys time.
"""

import io
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from posed.errors import MissingExtraError, RecordingError
from posed.events import EventColumn, Float64Array, SensorType
from posed.hal.recording import Recording, TruthTrack, in_time_order, read_text

DECLINATION = math.radians(1.75)
"""East of true north in the room where the data set was recorded (rad)."""

_STREAMS: Mapping[SensorType, tuple[str, int]] = {
    SensorType.ACCELEROMETER: ("accelerometer.txt", 3),
    SensorType.MAGNETIC_FIELD: ("magnetometer-calibrated.txt", 3),
    SensorType.GYROSCOPE: ("gyroscope-calibrated.txt", 3),
    SensorType.MAGNETIC_FIELD_UNCALIBRATED: ("magnetometer.txt", 6),
    SensorType.GYROSCOPE_UNCALIBRATED: ("gyroscope.txt", 6),
}
_LATEST_TIME_S = 9.0e9
"""Just below where seconds no longer fit int64 nanoseconds."""


def load_trial(folder: Path) -> Recording:
    """Read the Android streams of a trial folder; truth and the phone's rotation vector are read when asked for.

    A stream that is not in the folder is a sensor the recording does not have. The accelerometer also stands for its
    uncalibrated form, with a bias of zero: Android 6 had no other.
    Raises RecordingError if the folder or every stream is missing, or a file is malformed.
    """
    if not folder.is_dir():
        raise RecordingError(f"{folder} is not a folder; name a trial folder that holds accelerometer.txt and the like")
    columns: dict[SensorType, EventColumn] = {}
    dropped: dict[SensorType, int] = {}
    for sensor_type, (name, width) in _STREAMS.items():
        path = find_stream(folder, name)
        if path:
            columns[sensor_type], dropped[sensor_type] = read_stream(path, width)
    if not columns:
        expected = ", ".join(name for name, _ in _STREAMS.values())
        raise RecordingError(f"{folder} holds no sensor stream; expected one or more of {expected}, plain or .gz")
    accelerometer = columns.get(SensorType.ACCELEROMETER)
    if accelerometer:
        raw = np.hstack([accelerometer.values, np.zeros_like(accelerometer.values)])
        columns[SensorType.ACCELEROMETER_UNCALIBRATED], _ = in_time_order(accelerometer.timestamp_ns, raw)
        dropped[SensorType.ACCELEROMETER_UNCALIBRATED] = dropped[SensorType.ACCELEROMETER]
    rotation_vector = find_stream(folder, "rotation-vector.txt")
    return Recording(
        name=folder.name,
        columns=columns,
        dropped_rows=dropped,
        declination=DECLINATION,
        load_truth=(lambda: _read_truth(folder)) if (folder / "qualisys.mat").exists() else None,
        load_rotation_vector=(lambda: read_stream(rotation_vector, 5)[0]) if rotation_vector else None,
    )


def find_stream(folder: Path, name: str) -> Path | None:
    """Return the path of a folder's file, plain or gzipped, None if it has neither."""
    for path in (folder / name, folder / f"{name}.gz"):
        if path.exists():
            return path
    return None


def read_stream(path: Path, width: int) -> tuple[EventColumn, int]:
    """Return a stream of `width` values behind each time, and how many rows were out of time order.

    Raises RecordingError if the file is unreadable or malformed.
    """
    text = read_text(path)
    try:
        rows = np.loadtxt(io.StringIO(text), dtype=np.float64, comments=None, ndmin=2)
    except ValueError as error:
        raise _malformed(path, text, width) from error
    if rows.shape[1] != width + 1 or not np.all(np.abs(rows[:, 0]) < _LATEST_TIME_S):
        raise _malformed(path, text, width)
    return in_time_order(np.rint(rows[:, 0] * 1e9).astype(np.int64), rows[:, 1:])


def _malformed(path: Path, text: str, width: int) -> RecordingError:
    """Find the first line that is not `width` numbers behind a time: only a file known to be bad is walked slowly."""
    expected = f"expected a time in seconds and {width} numbers, separated by blanks"
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if words and len(words) != width + 1:
            return RecordingError(f"{path}:{number}: {len(words)} columns; {expected}")
        for column, word in enumerate(words, 1):
            try:
                value = float(word)
            except ValueError:
                return RecordingError(f"{path}:{number}, column {column}: {word[:40]!r} is not a number; {expected}")
            if column == 1 and not abs(value) < _LATEST_TIME_S:
                return RecordingError(f"{path}:{number}, column 1: {word[:40]!r} is not a time in seconds; {expected}")
    return RecordingError(f"{path} is not a table of numbers; {expected} on each line")


def _read_truth(folder: Path) -> TruthTrack:
    path = folder / "qualisys.mat"
    alignment_ns = round(_read_alignment(folder / "timeAlignment.txt") * 1e9)
    capture = _read_capture(path)
    try:
        frame_rate_hz = float(capture.FrameRate)
        rotations = np.asarray(capture.RigidBodies.Rotations, np.float64)
        positions_mm = np.asarray(capture.RigidBodies.Positions, np.float64)
    except (AttributeError, TypeError, ValueError) as error:
        raise RecordingError(f"{path}: {error}; expected FrameRate, RigidBodies.Rotations and .Positions") from error
    frames = rotations.shape[-1] if rotations.ndim else 0
    shaped = rotations.shape == (9, frames) and positions_mm.shape == (3, frames) and frames > 1
    if not shaped or not 0.0 < frame_rate_hz < 1e5:
        raise RecordingError(
            f"{path}: rotations {rotations.shape}, positions {positions_mm.shape}, {frame_rate_hz} Hz; "
            "expected one body: 9 x n and 3 x n, n > 1, at a rate above 0"
        )
    timestamp_ns = np.rint(np.arange(frames) * (1e9 / frame_rate_hz)).astype(np.int64) - alignment_ns
    position_enu = positions_mm.T / 1e3
    located = np.flatnonzero(np.isfinite(position_enu).all(axis=1))
    if len(located):
        position_enu = position_enu - position_enu[located[0]]
    # Stored column-major, device to world. Read so, the phone's own rotation vector leans off it by 1 to 4 degrees
    # (median of a trial); read row by row, by 6 to 91.
    matrices = rotations.T.reshape(frames, 3, 3).transpose(0, 2, 1)
    known = np.asarray(np.isfinite(matrices).all(axis=(1, 2)), np.bool_)
    if not _are_rotations(matrices[known]):
        raise RecordingError(f"{path}: RigidBodies.Rotations are not all rotation matrices; copy it again")
    return TruthTrack(timestamp_ns, _quaternions(matrices, known), position_enu)


def _read_alignment(path: Path) -> float:
    text = read_text(path).strip()
    try:
        alignment_s = float(text)
    except ValueError as error:
        raise RecordingError(
            f"{path}: {text[:40]!r} is not a number; expected seconds to add to Android time"
        ) from error
    if not abs(alignment_s) < _LATEST_TIME_S:
        raise RecordingError(f"{path}: {text[:40]!r} is not a time; expected seconds to add to Android time")
    return alignment_s


def _read_capture(path: Path) -> Any:
    try:
        from scipy.io import loadmat
    except ImportError as error:
        raise MissingExtraError(
            f"reading the truth in {path} needs scipy; install it with: pip install 'posed[evaluate]'"
        ) from error
    try:
        content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except Exception as error:  # scipy's reader answers damage with anything, UnboundLocalError included
        raise RecordingError(f"{path} is not a readable MATLAB file ({error}); copy it again") from error
    captures = [value for name, value in content.items() if not name.startswith("__")]
    if len(captures) != 1:
        raise RecordingError(f"{path} holds {len(captures)} variables; expected the one struct of a Qualisys export")
    return captures[0]


def _are_rotations(matrices: Float64Array) -> bool:
    if np.any(np.abs(matrices) > 1.001):
        return False
    products = matrices @ matrices.transpose(0, 2, 1)
    return bool(np.all(np.abs(products - np.eye(3)) < 1e-3) and np.all(np.linalg.det(matrices) > 0.0))


def _quaternions(matrices: Float64Array, known: npt.NDArray[np.bool_]) -> Float64Array:
    """Return float64[n, 4] (x, y, z, w), w >= 0, of float64[n, 3, 3] rotation matrices; NaN where not known."""
    from scipy.spatial.transform import Rotation

    quaternions = np.full((len(matrices), 4), np.nan)
    if known.any():
        found = Rotation.from_matrix(matrices[known]).as_quat()
        quaternions[known] = np.where(found[:, 3:] < 0.0, -found, found)
    return quaternions
