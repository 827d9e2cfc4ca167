"""A recording: what a phone's sensors said and, where it was measured, how the phone was really held."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from posed.errors import RecordingError
from posed.events import EventColumn, Float64Array, Int64Array, SensorType, Truth

_STATUS_ACCURACY_HIGH = 3
_LONGEST_NS = 30 * 86_400_000_000_000
"""Of a recording. One stamp that is far off would else have grids and poses made for all the years between."""


@dataclass(frozen=True, eq=False)
class TruthTrack:
    """Measured attitude and position, frame by frame, on the recording's clock.

    timestamp_ns: int64[n], strictly increasing. quaternion: float64[n, 4], (x, y, z, w) device to world ENU, true
    north, w >= 0. position_enu: float64[n, 3], m from the first known position. Frames that were lost hold NaN.
    """

    timestamp_ns: Int64Array
    quaternion: Float64Array
    position_enu: Float64Array

    def at(self, timestamp_ns: int, declination: float) -> Truth | None:
        """Return the truth at `timestamp_ns`, None where it is further than 1.5 frames from a known frame.

        Attitude is interpolated on the sphere, position linearly, between known frames not more than three frames
        apart; across a longer loss nothing is made up. `declination` (rad) is handed on.
        """
        known, times = self._known
        if not len(known):
            return None
        after = int(np.searchsorted(times, timestamp_ns))
        if after == len(known):
            return None
        if times[after] == timestamp_ns:
            row = known[after]
            return self._truth(
                timestamp_ns, self.quaternion[row].tolist(), self.position_enu[row].tolist(), declination
            )
        if after == 0:
            return None
        step_ns = int(times[after] - times[after - 1])
        if step_ns > 3.0 * self._frame_ns:
            return None
        fraction = (timestamp_ns - int(times[after - 1])) / step_ns
        left, right = known[after - 1], known[after]
        quaternion = _slerp(self.quaternion[left].tolist(), self.quaternion[right].tolist(), fraction)
        position = (1.0 - fraction) * self.position_enu[left] + fraction * self.position_enu[right]
        return self._truth(timestamp_ns, quaternion, position.tolist(), declination)

    @cached_property
    def _known(self) -> tuple[npt.NDArray[np.intp], Int64Array]:
        known = np.flatnonzero(np.isfinite(self.quaternion).all(axis=1))
        return known, self.timestamp_ns[known]

    @cached_property
    def _frame_ns(self) -> float:
        return float(np.median(np.diff(self.timestamp_ns))) if len(self.timestamp_ns) > 1 else 0.0

    @staticmethod
    def _truth(timestamp_ns: int, quaternion: list[float], position: list[float], declination: float) -> Truth:
        x, y, z, w = quaternion
        east, north, up = position
        known = math.isfinite(east + north + up)
        return Truth(timestamp_ns, (x, y, z, w), declination, (east, north, up) if known else None)


@dataclass(frozen=True, eq=False)
class Recording:
    """The samples of one recording, all on its own clock.

    columns: by sensor type, timestamps strictly increasing. Rows with NaN or infinite values are kept: a replay shows
    the phone's own defects, and the filters reject and count them. dropped_rows: how many rows of each sensor stood at
    or before the time of an earlier row and were left out. declination: rad, east positive.
    """

    name: str
    columns: Mapping[SensorType, EventColumn]
    dropped_rows: Mapping[SensorType, int]
    declination: float = 0.0
    load_truth: Callable[[], TruthTrack] | None = field(default=None, repr=False)
    load_rotation_vector: Callable[[], EventColumn] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if not any(len(column) for column in self.columns.values()):
            raise RecordingError(f"recording {self.name!r} holds no sample; expected at least one sensor's rows")
        if self.end_ns - self.start_ns > _LONGEST_NS:
            raise RecordingError(
                f"recording {self.name!r} goes from {self.start_ns} ns to {self.end_ns} ns; expected at most 30 days:"
                " check the time column and its unit"
            )

    @cached_property
    def truth(self) -> TruthTrack | None:
        """The measured attitude, None if there is none; read on first use.

        Raises RecordingError if it is malformed, MissingExtraError if its reader is not installed.
        """
        return self.load_truth() if self.load_truth else None

    @cached_property
    def rotation_vector(self) -> EventColumn | None:
        """What the phone's own fusion said, None if not recorded; read on first use.

        values: float64[n, 5], (x, y, z, w) device to world ENU, magnetic north, and heading accuracy (rad).
        """
        return self.load_rotation_vector() if self.load_rotation_vector else None

    @cached_property
    def start_ns(self) -> int:
        """The time of the first sample of all sensors."""
        return min(int(column.timestamp_ns[0]) for column in self.columns.values() if len(column))

    @cached_property
    def end_ns(self) -> int:
        """The time of the last sample of all sensors."""
        return max(int(column.timestamp_ns[-1]) for column in self.columns.values() if len(column))


def in_time_order(timestamp_ns: Int64Array, values: Float64Array) -> tuple[EventColumn, int]:
    """Return rows as a read-only column and how many were dropped because time did not advance.

    timestamp_ns: int64[n]; values: float64[n, w]. Accuracy, which recordings lack, is Android's ACCURACY_HIGH.
    """
    if len(timestamp_ns) > 1:
        keep = np.concatenate(([True], timestamp_ns[1:] > np.maximum.accumulate(timestamp_ns)[:-1]))
    else:
        keep = np.ones(len(timestamp_ns), np.bool_)
    dropped = int(np.count_nonzero(~keep))
    times = np.ascontiguousarray(timestamp_ns[keep], np.int64)
    rows = np.ascontiguousarray(values[keep], np.float64)
    return read_only(EventColumn(times, rows, np.full(len(times), _STATUS_ACCURACY_HIGH, np.int8))), dropped


def read_only(column: EventColumn) -> EventColumn:
    """Return the column with its arrays locked: slices of it are handed out without a copy."""
    for array in (column.timestamp_ns, column.values, column.accuracy):
        array.flags.writeable = False
    return column


def read_text(path: Path) -> str:
    """Return a text file's content, unpacked if its name ends in .gz.

    Raises RecordingError if the file is missing, unreadable, not text, empty, or its compression is broken.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path} cannot be read ({error.strerror}); name an existing, readable file") from error
    if path.suffix == ".gz":
        raw = _unpacked(path, raw)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path} is not UTF-8 text ({error.reason} at byte {error.start})") from error
    if not text.strip():
        raise RecordingError(f"{path} is empty; expected one sample a line")
    return text


def _unpacked(path: Path, raw: bytes) -> bytes:
    import gzip  # memory that a daemon over a recording in plain text does not need
    import zlib

    try:
        return gzip.decompress(raw)
    except (OSError, EOFError, zlib.error) as error:
        raise RecordingError(f"{path} is not a whole gzip file ({error}); unpack or copy it again") from error


def _slerp(a: list[float], b: list[float], fraction: float) -> list[float]:
    cosine = sum(p * q for p, q in zip(a, b, strict=True))
    if cosine < 0.0:
        b, cosine = [-q for q in b], -cosine
    angle = math.acos(min(1.0, cosine))
    if angle < 1e-6:
        from_a, from_b = 1.0 - fraction, fraction
    else:
        from_a = math.sin((1.0 - fraction) * angle) / math.sin(angle)
        from_b = math.sin(fraction * angle) / math.sin(angle)
    mixed = [from_a * p + from_b * q for p, q in zip(a, b, strict=True)]
    norm = math.copysign(math.sqrt(sum(p * p for p in mixed)), mixed[3])
    return [p / norm for p in mixed]
