"""A recorded walk as a source of samples: at its own pace, faster or slower, once or over and over."""

from bisect import bisect_right
from dataclasses import replace
from pathlib import Path

import numpy as np

from posed.clock import Clock, TimeMap
from posed.errors import InvalidArgumentError, RecordingError
from posed.events import EventBatch, EventColumn, Float64Array, SensorInfo, SensorType, Truth
from posed.hal.attitude_trial import load_trial
from posed.hal.csv_recording import load_csv
from posed.hal.profile import UNCALIBRATED_TYPE, DeviceProfile, SensorProfile
from posed.hal.quantisation import Quantiser
from posed.hal.recording import Recording, read_only
from posed.hal.thinning import LONGEST_HOLD_NS, mean_between, thin_by_mean, thin_by_nearest

SLOWEST_SPEED = 0.1
FASTEST_SPEED = 50.0
LOOP_GAP_NS = LONGEST_HOLD_NS + 100_000_000
"""Sample time between the end of a pass and the start of the next: long enough for filters to start afresh."""


def load_recording(path: str | Path) -> Recording:
    """Read a trial folder of the smartphone attitude data set, or FILE.csv.

    Raises RecordingError if it is missing, malformed, or neither.
    """
    path = Path(path)
    if path.is_dir():
        return load_trial(path)
    if path.suffix == ".csv":
        return load_csv(path)
    found = "a file that does not end in .csv" if path.exists() else "missing"
    raise RecordingError(f"recording {path} is {found}; name a FILE.csv or the folder of a smartphone attitude trial")


def open_replay(
    path: str | Path, profile: DeviceProfile, clock: Clock, *, speed: float = 1.0, loop: bool = False
) -> "ReplaySource":
    """Return a source that replays the recording at `path`.

    Raises RecordingError for the recording, InvalidArgumentError for the speed.
    """
    return ReplaySource(load_recording(path), profile, clock, speed, loop)


class ReplaySource:
    """A SensorSource over a recording; sample time is the recording's own clock.

    The first activation starts it: the recording's first sample then stands at the clock's now. With no sensor active
    it pauses, and goes on from the same sample time. Each pass of a loop continues sample time behind a gap.

    A rate below the recorded one is made of it by interval mean (gyroscope) or nearest sample (the others), on a grid
    from the recording's start; any other rate gives what was recorded. Sensors are the profile's, as far as recorded.
    A calibration in the profile was measured on raw readings, so the calibrated stream is made anew from the recorded
    uncalibrated one, which is not touched; only where that is missing is the recorded calibrated stream corrected.
    """

    def __init__(
        self, recording: Recording, profile: DeviceProfile, clock: Clock, speed: float = 1.0, loop: bool = False
    ) -> None:
        """Raise InvalidArgumentError unless 0.1 <= speed <= 50, RecordingError if no sensor is the profile's."""
        if not SLOWEST_SPEED <= speed <= FASTEST_SPEED:
            raise InvalidArgumentError(f"replay speed {speed}; allowed: {SLOWEST_SPEED} to {FASTEST_SPEED}")
        self._recording = recording
        self._clock = clock
        self._loop = loop
        self._streams: dict[int, _Stream] = {}
        infos = []
        for info in profile.sensor_infos():
            column = _calibrated(recording, profile, info.type)
            if column is not None and len(column):
                infos.append(info)
                self._streams[info.handle] = _Stream(info, column, profile.sensor(info.handle), recording.start_ns)
        if not infos:
            held = ", ".join(kind.name.lower() for kind in recording.columns)
            raise RecordingError(
                f"recording {recording.name!r} holds {held}; expected a sensor of profile {profile.name}"
            )
        self._infos = tuple(infos)
        self._pass_ns = recording.end_ns - recording.start_ns + LOOP_GAP_NS
        self._scale = 1.0 / speed
        self._active: dict[int, _Stream] = {}
        self._flushes: list[int] = []
        self._untouched: set[int] = set()
        """Sensors that have not been switched since the replay began to run, while nothing has been drained since."""
        self._drained_ns = recording.start_ns - 1
        self._time_map = self.time_map

    @property
    def sensors(self) -> tuple[SensorInfo, ...]:
        """The profile's sensors that the recording has, in handle order."""
        return self._infos

    @property
    def time_map(self) -> TimeMap:
        """The mapping from sample time to CLOCK_BOOTTIME; while paused, sample time stands still at the clock's now."""
        return self._time_map if self._active else self._standing_at(self._drained_ns + 1)

    @property
    def end_ns(self) -> int | None:
        """Sample time of the recording's last sample, of whatever sensor; None if it loops."""
        return None if self._loop else self._recording.end_ns

    def activate(self, handle: int, enabled: bool) -> None:
        """Switch a sensor on or off; the first on starts or resumes the replay, the last off pauses it.

        Raises InvalidArgumentError for an unknown handle.
        """
        stream = self._stream(handle)
        if enabled == (handle in self._active):
            return
        if enabled:
            if not stream.is_configured:
                stream.configure(0)
            if not self._active:
                self._time_map = self.time_map
                self._untouched = set(self._streams)
            # Sensors switched on one after another, before anything was drained, all begin where the run began:
            # what a replay yields then does not depend on how fast its user was.
            stream.begin(self._drained_ns if handle in self._untouched else self._present_ns())
            self._active[handle] = stream
            return
        self._untouched.discard(handle)
        del self._active[handle]
        self._flushes = [asked for asked in self._flushes if asked != handle]
        if not self._active:
            self._drained_ns = self._present_ns()

    def batch(self, handle: int, sampling_period_ns: int, max_report_latency_ns: int) -> int:
        """Set a sensor's period from the last drained instant on and return the profile's period for it (ns).

        Raises InvalidArgumentError for an unknown handle or a negative period.
        """
        return self._stream(handle).configure(sampling_period_ns)

    def flush(self, handle: int) -> None:
        """Ask for one flush-complete; raises InvalidArgumentError if the sensor is unknown or not active."""
        self._stream(handle)
        if handle not in self._active:
            raise InvalidArgumentError(f"sensor handle {handle} is not active; activate it before flush")
        self._flushes.append(handle)

    def drain(self, until_ns: int) -> EventBatch:
        """Return every sample of the active sensors later than the last drain and not later than `until_ns`."""
        flushed, self._flushes = self._flushes, []
        columns: dict[int, EventColumn] = {}
        if self._active and until_ns > self._drained_ns:
            first_ns, last_ns = self._shift_ns(self._drained_ns), self._shift_ns(until_ns)
            for handle, stream in self._active.items():
                after_ns = max(self._drained_ns, stream.since_ns)
                if first_ns == last_ns:
                    column = stream.rows(after_ns, until_ns, last_ns)
                else:
                    column = self._over_passes(stream, after_ns, until_ns)
                if len(column.timestamp_ns):
                    columns[handle] = column
            self._drained_ns = until_ns
            self._untouched.clear()
        return EventBatch(columns, flushed)

    def resume(self) -> None:
        """Go on with the sample behind the last drain, which stands at the clock's now."""
        if self._active:
            self._time_map = self._standing_at(self._drained_ns + 1)

    def prepare(self) -> None:
        """All is there: does nothing."""

    def set_environment(self, kind: SensorType, value: float) -> None:
        """Raise InvalidArgumentError: what surrounded a recorded phone is as it was."""
        raise InvalidArgumentError(f"{kind.name.lower()} cannot be set: this is a recording; start with --source sim")

    def next_sample_ns(self, handle: int) -> int | None:
        """Return when the next sample of an active sensor is due, None if the sensor is off or the replay at its end.

        Raises InvalidArgumentError for an unknown handle.
        """
        stream = self._stream(handle)
        if handle not in self._active or not len(stream.times):
            return None
        after_ns = max(self._drained_ns, stream.since_ns)
        shift_ns = self._shift_ns(after_ns)
        row = stream.row_after(after_ns - shift_ns)
        if row < len(stream.times):
            return stream.times[row] + shift_ns
        return stream.times[0] + shift_ns + self._pass_ns if self._loop else None

    def truth(self, timestamp_ns: int) -> Truth | None:
        """Return the measured orientation at `timestamp_ns`, None where none is known.

        The first call reads it: raises RecordingError if it is malformed, MissingExtraError if scipy is not installed.
        """
        track = self._recording.truth
        if track is None:
            return None
        shift_ns = self._shift_ns(timestamp_ns)
        truth = track.at(timestamp_ns - shift_ns, self._recording.declination)
        return replace(truth, timestamp_ns=timestamp_ns) if truth else None

    def _stream(self, handle: int) -> "_Stream":
        stream = self._streams.get(handle)
        if stream is None:
            known = ", ".join(f"{info.handle} ({info.type.name.lower()})" for info in self._infos)
            raise InvalidArgumentError(f"sensor handle {handle} is not in this replay; allowed: {known}")
        return stream

    def _standing_at(self, sample_ns: int) -> TimeMap:
        """Return the mapping by which `sample_ns` stands at the clock's now."""
        now_ns = self._clock.now_ns()
        return TimeMap(now_ns - TimeMap(0, self._scale).to_boot(sample_ns), self._scale)

    def _present_ns(self) -> int:
        """Return the sample time the replay has come to: by the clock, or further if it was drained ahead of it."""
        return max(self._drained_ns, self._time_map.to_sample(self._clock.now_ns()))

    def _shift_ns(self, sample_ns: int) -> int:
        """Return what the pass of the loop that `sample_ns` falls into adds to the recording's own time."""
        if not self._loop:
            return 0
        return max(0, (sample_ns - self._recording.start_ns) // self._pass_ns) * self._pass_ns

    def _over_passes(self, stream: "_Stream", after_ns: int, until_ns: int) -> EventColumn:
        passes = [
            stream.rows(max(after_ns, shift_ns + self._recording.start_ns - 1), until_ns, shift_ns)
            for shift_ns in range(self._shift_ns(after_ns), self._shift_ns(until_ns) + 1, self._pass_ns)
        ]
        # A sensor that begins beyond `until_ns`, in the next pass, has none.
        return EventColumn.concatenate(passes) if passes else stream.rows(after_ns, until_ns, self._shift_ns(after_ns))


class _Stream:
    """One sensor's column at its present rate, cut by time."""

    def __init__(self, info: SensorInfo, recorded: EventColumn, part: SensorProfile, anchor_ns: int) -> None:
        self._is_gyroscope = info.type in (SensorType.GYROSCOPE, SensorType.GYROSCOPE_UNCALIBRATED)
        self._quantiser = Quantiser(info)
        self._recorded = recorded
        # Of a single sample there is nothing to thin.
        gaps_ns = np.diff(recorded.timestamp_ns)
        self._recorded_hz = 1e9 / float(np.median(gaps_ns)) if len(gaps_ns) else 0.0
        self._part = part
        self._anchor_ns = anchor_ns
        self._rate_hz = 0.0
        self.since_ns = anchor_ns - 1
        """Samples up to here are not due: the sensor was off."""
        self._taken_ns: int | None = None
        """Timestamp of the last row taken."""
        self._joins_ns: int | None = None
        """That of the last row at the rate before, until the first at this one is taken."""
        self._reached_ns: int | None = None
        """How far rows were taken, in the recording's own time."""
        self._next_row = 0
        """The first row behind that."""
        self._rounded_from = 0
        self._rounded_values: Float64Array = recorded.values[:0]
        """Of the rows from _rounded_from on."""
        self._use(recorded)

    @property
    def is_configured(self) -> bool:
        return self._rate_hz > 0.0

    def begin(self, since_ns: int) -> None:
        """Yield what is later than `since_ns`."""
        self.since_ns = since_ns
        self._taken_ns = self._joins_ns = None

    def configure(self, sampling_period_ns: int) -> int:
        rate_hz = self._part.configured_rate_hz(sampling_period_ns)
        if rate_hz != self._rate_hz:
            if self._is_gyroscope:
                self._joins_ns = self._taken_ns if self._joins_ns is None else self._joins_ns
            self._rate_hz = rate_hz
            self._use(self._thinned(rate_hz))
        return self._part.configured_period_ns(sampling_period_ns)

    def rows(self, after_ns: int, until_ns: int, shift_ns: int) -> EventColumn:
        times = self.times
        first = self.row_after(after_ns - shift_ns)
        self._reached_ns = max(after_ns, until_ns) - shift_ns
        near = first + _NEAR_ROWS
        # To bisect all of a long recording costs the daemon a cache miss a step.
        end = near if near < len(times) and times[near] > self._reached_ns else len(times)
        last = self._next_row = bisect_right(times, self._reached_ns, first, end)
        if first == last:
            return self._column[first:last]
        stamps = self._column.timestamp_ns[first:last]
        values = self._rounded(first, last)
        if self._joins_ns is not None:
            values = self._joined(values, self._joins_ns - shift_ns, times[first])
            self._joins_ns = None
        self._taken_ns = times[last - 1] + shift_ns
        return EventColumn(stamps + shift_ns if shift_ns else stamps, values, self._column.accuracy[first:last])

    def row_after(self, instant_ns: int) -> int:
        """Return the first row later than an instant of the recording's own time."""
        return self._next_row if instant_ns == self._reached_ns else bisect_right(self.times, instant_ns)

    def _rounded(self, first: int, last: int) -> Float64Array:
        """Return values of rows as an app sees them, rounded a block ahead."""
        start = first - self._rounded_from
        if start < 0 or start + last - first > len(self._rounded_values):
            ahead = self._column.values[first : max(last, first + _ROUNDED_ROWS)]
            self._rounded_values = self._quantiser(ahead)
            self._rounded_values.flags.writeable = False
            self._rounded_from = first
            start = 0
        return self._rounded_values[start : start + last - first]

    def _joined(self, values: Float64Array, since_ns: int, first_ns: int) -> Float64Array:
        """Have the first row tell of all since the last one at the rate before, not of its own interval."""
        mean = mean_between(self._recorded, since_ns, first_ns)
        if mean is None:
            return values
        return np.concatenate([self._quantiser(mean[np.newaxis]), values[1:]])

    def _use(self, column: EventColumn) -> None:
        self._column = read_only(column)
        self._reached_ns = None
        self._rounded_values = column.values[:0]
        # Bisection over a memoryview takes a third of the time of a numpy search for one instant, and no memory.
        self.times = column.timestamp_ns.data

    def _thinned(self, rate_hz: float) -> EventColumn:
        # A stamp rounded to nanoseconds makes 15 Hz a little more than 15 Hz; that must not thin it.
        if rate_hz > 0.99 * self._recorded_hz:
            return self._recorded
        thin = thin_by_mean if self._is_gyroscope else thin_by_nearest
        return thin(self._recorded, rate_hz, self._anchor_ns)


_NEAR_ROWS = 64
"""More than a sensor samples in a tenth of a second."""
_ROUNDED_ROWS = 256


def _calibrated(recording: Recording, profile: DeviceProfile, kind: SensorType) -> EventColumn | None:
    recorded = recording.columns.get(kind)
    if kind not in UNCALIBRATED_TYPE or profile.calibration[kind].is_identity:
        return recorded
    raw = recording.columns.get(UNCALIBRATED_TYPE[kind], recorded)
    if raw is None:
        return None
    return EventColumn(raw.timestamp_ns, profile.calibration[kind].apply(raw.values[:, :3]), raw.accuracy)
