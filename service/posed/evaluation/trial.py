"""A trial: a recording with truth, and which of its instants count."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from posed.errors import RecordingError
from posed.evaluation.measures import BoolArray, slerp_truth, to_magnetic_north
from posed.events import EventColumn, Float64Array, Int64Array, SensorType
from posed.hal.recording import Recording, TruthTrack

INPUTS = (SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD, SensorType.GYROSCOPE)
"""What filters are fed: calibrated streams, m/s2, uT and rad/s, in the order in which events of one instant come."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording as it is scored.

    dataset: where its kind of trial comes from. groups: the kinds it belongs to, for means over each. recording: its
    calibrated streams are those that filters are fed. truth: the measured attitude, true north. counted: bool[n], for
    each frame of the truth, whether it counts.
    """

    dataset: str
    groups: tuple[str, ...]
    recording: Recording
    truth: TruthTrack
    counted: BoolArray

    def __post_init__(self) -> None:
        for kind in INPUTS:
            if not len(self.recording.columns.get(kind, ())):
                raise RecordingError(
                    f"trial {self.name!r} holds no {kind.name.lower()} sample; a trial needs accelerometer, gyroscope"
                    " and magnetic field"
                )
        known = np.isfinite(self.truth.quaternion).all(axis=1)
        if not np.any(known & self.counted):
            raise RecordingError(f"trial {self.name!r} has no truth at any instant that counts; nothing can be scored")

    @property
    def name(self) -> str:
        """The recording's name."""
        return self.recording.name

    @property
    def rotation_vector(self) -> EventColumn | None:
        """What the phone's own fusion said (see Recording), None if it was not recorded."""
        return self.recording.rotation_vector

    def truth_at(self, timestamp_ns: Int64Array) -> Float64Array:
        """Return device to world at `timestamp_ns` (int64[n]) against **magnetic** north, float64[n, 4] (x, y, z, w).

        NaN where it is not known (see `slerp_truth`) or does not count: the nearest frame decides.
        """
        quaternion = slerp_truth(timestamp_ns, self.truth.timestamp_ns, self._magnetic_truth)
        frames = self.truth.timestamp_ns
        after = np.clip(np.searchsorted(frames, timestamp_ns), 1, len(frames) - 1)
        nearest = np.where(timestamp_ns - frames[after - 1] < frames[after] - timestamp_ns, after - 1, after)
        quaternion[~self.counted[nearest]] = np.nan
        return quaternion

    @cached_property
    def _magnetic_truth(self) -> Float64Array:
        return to_magnetic_north(self.truth.quaternion, self.recording.declination)
