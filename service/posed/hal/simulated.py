"""A simulated phone: a motion script seen through the parts of a device profile."""

from bisect import bisect_right
from collections.abc import Callable

import numpy as np

from posed.clock import Clock, TimeMap
from posed.errors import InvalidArgumentError
from posed.events import EventBatch, EventColumn, Float64Array, SensorInfo, SensorType, Truth
from posed.hal.motion import MotionScript
from posed.hal.profile import UNCALIBRATED_TYPE, DeviceProfile, exact_period_ns
from posed.hal.quantisation import Quantiser
from posed.hal.sensor_model import BLOCK_SAMPLES, THESSALONIKI, SensorModel, Site
from posed.hal.surroundings import Surroundings


class SimulatedPhone:
    """A SensorSource whose sample time is the clock's CLOCK_BOOTTIME; the script begins at the first activation.

    Every sensor ticks on its own grid, anchored where the script begins, and time goes on while all are off. The same
    profile, script, seed (0 or more) and calls give the same samples.
    """

    def __init__(
        self, profile: DeviceProfile, clock: Clock, script: MotionScript, seed: int, site: Site = THESSALONIKI
    ) -> None:
        self._profile = profile
        self._clock = clock
        self._script = script
        self._site = site
        self._models = {
            kind: SensorModel(part, profile.calibration[kind], script, site, seed)
            for kind, part in profile.sensors.items()
        }
        self._quantisers = {info.handle: Quantiser(info) for info in profile.sensor_infos()}
        self._rates = {info.handle: profile.sensor(info.handle).rates_hz[-1] for info in profile.sensor_infos()}
        self._surroundings = Surroundings(profile.ambient, seed)
        self._streams: dict[int, _Stream] = {}
        self._flushes: list[int] = []
        self._zero_ns: int | None = None
        self._drained_ns = clock.now_ns()

    @property
    def sensors(self) -> tuple[SensorInfo, ...]:
        infos = (*self._profile.sensor_infos(), *self._surroundings.infos)
        return tuple(sorted(infos, key=lambda info: info.handle))

    @property
    def time_map(self) -> TimeMap:
        return TimeMap()

    @property
    def end_ns(self) -> None:
        return None

    def activate(self, handle: int, enabled: bool) -> None:
        """Switch a sensor on, from now on, or off; a sensor never given a period runs at its fastest rate.

        Raises InvalidArgumentError for an unknown handle.
        """
        if handle in self._surroundings:
            self._surroundings.activate(handle, enabled, max(self._clock.now_ns(), self._drained_ns))
        else:
            self._profile.sensor(handle)
        if not enabled:
            self._streams.pop(handle, None)
            self._flushes = [asked for asked in self._flushes if asked != handle]
        elif handle not in self._streams and handle not in self._surroundings:
            self._start(handle, max(self._clock.now_ns(), self._drained_ns))

    def batch(self, handle: int, sampling_period_ns: int, max_report_latency_ns: int) -> int:
        """Set a sensor's period, 0 or more, and return the one configured (ns); from the last drained instant on.

        Samples are made when they are drained, so the report latency is the caller's affair. Raises
        InvalidArgumentError for an unknown handle or a negative period or latency.
        """
        if max_report_latency_ns < 0:
            raise InvalidArgumentError(f"max_report_latency_ns = {max_report_latency_ns}; allowed: 0 or more")
        if handle in self._surroundings:
            return self._surroundings.batch(handle, sampling_period_ns, self._drained_ns)
        part = self._profile.sensor(handle)
        rate_hz = part.configured_rate_hz(sampling_period_ns)
        if rate_hz != self._rates[handle]:
            self._rates[handle] = rate_hz
            running = self._streams.get(handle)
            if running is not None:
                self._start(handle, max(running.after_ns, self._drained_ns), running.last_ns)
        return part.configured_period_ns(sampling_period_ns)

    def flush(self, handle: int) -> None:
        self._active(handle)
        self._flushes.append(handle)

    def drain(self, until_ns: int) -> EventBatch:
        # next_ns is compared first: a client of latency 0 drains once an event, with nothing due on most sensors.
        columns = {
            handle: stream.take(until_ns) for handle, stream in self._streams.items() if stream.next_ns <= until_ns
        }
        columns.update(self._surroundings.drain(until_ns))
        self._drained_ns = max(self._drained_ns, until_ns)
        if not self._flushes:
            return EventBatch(columns)
        flushes, self._flushes = tuple(self._flushes), []
        return EventBatch(columns, flushes)

    def resume(self) -> None:
        """Leave out what was sampled up to the clock's now and not drained."""
        self._drained_ns = max(self._clock.now_ns(), self._drained_ns)
        for handle in self._streams:
            self._start(handle, self._drained_ns)
        self._surroundings.resume(self._drained_ns)

    def prepare(self) -> None:
        """Make the blocks of samples needed soon: each takes milliseconds, by which a pose would else be late."""
        for stream in self._streams.values():
            stream.prepare()

    def next_sample_ns(self, handle: int) -> int | None:
        """Return the timestamp of the next sample of a sensor, None if it is not active."""
        stream = self._streams.get(handle)
        return self._surroundings.next_sample_ns(handle) if stream is None else stream.next_ns

    def set_environment(self, kind: SensorType, value: float) -> None:
        self._surroundings.set(kind, value, max(self._clock.now_ns(), self._drained_ns + 1))

    def truth(self, timestamp_ns: int) -> Truth | None:
        """Return the script's attitude and position at `timestamp_ns`, None before the script began."""
        if self._zero_ns is None or timestamp_ns < self._zero_ns:
            return None
        t = np.array([1e-9 * (timestamp_ns - self._zero_ns)])
        x, y, z, w = self._script.attitude(t)[0].tolist()
        east, north, up = self._script.position(t)[0].tolist()
        quaternion = (x, y, z, w) if w >= 0.0 else (-x, -y, -z, -w)
        return Truth(timestamp_ns, quaternion, self._site.declination, (east, north, up))

    def _active(self, handle: int) -> None:
        if self._surroundings.is_active(handle):
            return
        if handle not in self._surroundings:
            self._profile.sensor(handle)
        if handle not in self._streams:
            name = SensorType(handle).name.lower()
            raise InvalidArgumentError(f"sensor handle {handle} ({name}) is not active; activate it before a flush")

    def _start(self, handle: int, after_ns: int, since_ns: int | None = None) -> None:
        if self._zero_ns is None:
            self._zero_ns = after_ns
        kind = self._profile.sensor(handle).type
        calibration = self._profile.calibration[kind]
        bias = calibration.bias if handle == UNCALIBRATED_TYPE[kind] else None

        def seen(raw: Float64Array) -> Float64Array:
            """Return what an app sees of what the part measures."""
            if bias is None:
                return self._quantisers[handle](calibration.apply(raw))
            return self._quantisers[handle](np.concatenate([raw, np.broadcast_to(bias, raw.shape)], axis=1))

        self._streams[handle] = _Stream(
            self._models[kind], seen, self._rates[handle], self._zero_ns, after_ns, since_ns
        )


class _Stream:
    """An active sensor at one rate: its samples later than `after_ns`, made a block at a time, taken in slices.

    since_ns: where the last sample at the rate before stands on its grid; the first one here tells of all since then.
    """

    def __init__(
        self,
        model: SensorModel,
        seen: Callable[[Float64Array], Float64Array],
        rate_hz: float,
        zero_ns: int,
        after_ns: int,
        since_ns: int | None,
    ) -> None:
        self._model = model
        self._seen = seen
        self._rate_hz = rate_hz
        self._zero_ns = zero_ns
        self.after_ns = after_ns
        self._ahead: tuple[EventColumn, list[int]] | None = None
        # Jitter keeps a sample within a third of a period of its instant: none before the last instant passed is later
        # than after_ns.
        passed = exact_period_ns(rate_hz).samples_in(after_ns - zero_ns)
        self._load(max(passed - 1, 0) // BLOCK_SAMPLES)
        self._seek(bisect_right(self._stamps, after_ns))
        # The next block begins with one that jitter put before after_ns too.
        if self.next_ns <= after_ns:
            self._seek(bisect_right(self._stamps, after_ns))
        if since_ns is not None:
            # Jitter may have put the last sample before the change, and this one, of the same instant, behind it.
            if self._instant_ns(self._offset + 1) <= since_ns:
                self._seek(self._offset + 1)
            self._load(self._index, (self._offset, since_ns - zero_ns))
        self._since_ns = since_ns
        self._begun = (self._index, self._offset)

    @property
    def last_ns(self) -> int | None:
        """The instant of the last sample taken, here or at the rate before, free of jitter; None before the first."""
        if (self._index, self._offset) == self._begun:
            return self._since_ns
        return self._instant_ns(self._offset)

    def take(self, until_ns: int) -> EventColumn:
        """Return the samples not taken yet that are not later than `until_ns`; at least one has to be due."""
        parts = []
        while self.next_ns <= until_ns:
            end = bisect_right(self._stamps, until_ns, self._offset)
            parts.append(self._block[self._offset : end])
            self._seek(end)
        return EventColumn.concatenate(parts)

    def prepare(self) -> None:
        """Make the block behind this one, once most of this one is taken."""
        if self._ahead is None and self._offset >= _PREPARED_FROM:
            self._ahead = self._made(self._index + 1)

    def _instant_ns(self, samples: int) -> int:
        """Return where the last of the first `samples` samples of the block stands on the grid, free of jitter."""
        return self._zero_ns + exact_period_ns(self._rate_hz).until(self._index * BLOCK_SAMPLES + samples)

    def _seek(self, offset: int) -> None:
        if offset == BLOCK_SAMPLES:
            self._use(self._index + 1, self._ahead or self._made(self._index + 1))
            offset = 0
        self._offset = offset
        self.next_ns = self._stamps[offset]

    def _load(self, index: int, joins: tuple[int, int] | None = None) -> None:
        self._use(index, self._made(index, joins))

    def _use(self, index: int, made: tuple[EventColumn, list[int]]) -> None:
        self._index = index
        self._block, self._stamps = made
        self._ahead = None

    def _made(self, index: int, joins: tuple[int, int] | None = None) -> tuple[EventColumn, list[int]]:
        """Return a block and its timestamps, ns."""
        timestamp_ns, raw = self._model.block(self._rate_hz, index, joins)
        timestamp_ns += self._zero_ns
        return EventColumn(timestamp_ns, self._seen(raw), _HIGH_ACCURACY), timestamp_ns.tolist()


# Of a block at 200 Hz, the last third of a second: later than this is soon enough, and a rate may yet change.
_PREPARED_FROM = 3 * BLOCK_SAMPLES // 4

_HIGH_ACCURACY = np.full(BLOCK_SAMPLES, 3, np.int8)
"""Android's SENSOR_STATUS_ACCURACY_HIGH, of every sample: a simulated part is never in doubt."""
_HIGH_ACCURACY.flags.writeable = False
