"""A trial's events at the rate modes of a phone, as the replay of it would deliver them."""

from typing import Literal, get_args

import numpy as np

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError, RecordingError
from posed.evaluation.trial import INPUTS, Trial
from posed.events import EventBatch, FlatEvent, RateMode
from posed.fusion.event_arrays import EventArrays
from posed.hal.profile import DeviceProfile, load_profile
from posed.hal.recording import Recording
from posed.hal.replay import ReplaySource

ModeName = Literal["native", "FASTEST", "GAME", "UI", "NORMAL"]
MODES: tuple[ModeName, ...] = get_args(ModeName)
"""Every event as it was recorded, and Android's rate modes."""

PROFILE = "patonis2018"
"""The device whose rates stand for the modes, and whose parts' noise filters are told."""


def mode_events(trial: Trial, mode: ModeName, profile: DeviceProfile | None = None) -> list[FlatEvent]:
    """Return a trial's events at a mode, in one order: by time, ties by sensor type (gyroscope last).

    The modes are thinned from the recording at the profile's rates (default: PROFILE): the gyroscope by interval mean,
    accelerometer and magnetometer by the sample nearest to the grid, at its own time; a mode as fast as the recording
    leaves a stream's rate as it is. Values are rounded to an eighth of the profile's resolution, as the sensor service
    does. Raises InvalidArgumentError for an unknown mode.
    """
    return mode_batch(trial, mode, profile).flat({int(kind): kind for kind in INPUTS})


def mode_batch(trial: Trial, mode: ModeName, profile: DeviceProfile | None = None) -> EventBatch:
    """Return a trial's events at a mode as columns by sensor type; see `mode_events`.

    Raises RecordingError if a sensor has none left.
    """
    if mode not in MODES:
        raise InvalidArgumentError(f"mode {mode!r} is unknown; allowed: {', '.join(MODES)}")
    columns = {kind: trial.recording.columns[kind] for kind in INPUTS}
    if mode == "native":
        return EventBatch({int(kind): column for kind, column in columns.items()})
    recording = Recording(trial.name, columns, {})
    source = ReplaySource(recording, profile or load_profile(PROFILE), VirtualClock())
    for kind in INPUTS:
        source.batch(int(kind), RateMode[mode].sampling_period_us * 1000, 0)
        source.activate(int(kind), True)
    batch = source.drain(recording.end_ns)
    for kind in INPUTS:
        if int(kind) not in batch.columns:
            raise RecordingError(
                f"trial {trial.name!r} has no {kind.name.lower()} sample left at mode {mode}; check its values:"
                " those that are not finite do not count"
            )
    return batch


def event_arrays(batch: EventBatch) -> EventArrays:
    """Return a `mode_batch` in the order of `mode_events`, in the form that filters take fastest."""
    columns = [batch.columns[kind] for kind in sorted(INPUTS)]
    types = np.repeat(np.array(sorted(INPUTS), np.int64), [len(column) for column in columns])
    times = np.concatenate([column.timestamp_ns for column in columns])
    values = np.concatenate([column.values[:, :3] for column in columns])
    order = np.argsort(times, kind="stable")
    return EventArrays(types[order], times[order], values[order])


def pose_instants(
    events: list[FlatEvent], period_ns: int = 100_000_000
) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
    """Return the grid instants (int64[n], ns) on which the poses of these events stand: from the first event on."""
    return np.arange(events[0][1], events[-1][1] + 1, period_ns, dtype=np.int64)
