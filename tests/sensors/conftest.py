"""A source whose every sample is known, and a filter that counts."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pytest

from posed.clock import TimeMap, VirtualClock
from posed.errors import InvalidArgumentError, SourceLostError
from posed.events import (
    EventBatch,
    EventColumn,
    FilterStatus,
    FlatEvent,
    Orientation,
    ReportingMode,
    SensorInfo,
    SensorType,
    Truth,
)
from posed.sensors import SensorService


def _irregular(kind: SensorType, mode: ReportingMode, fifo: int) -> SensorInfo:
    return SensorInfo(
        handle=int(kind),
        type=kind,
        name=kind.name,
        vendor="test",
        version=1,
        max_range=1000.0,
        resolution=1.0,
        power_ma=0.5,
        min_delay_us=-1 if mode is ReportingMode.ONE_SHOT else 0,
        max_delay_us=0,
        fifo_max_event_count=0 if mode is ReportingMode.ONE_SHOT else fifo,
        reporting_mode=mode,
    )


IRREGULAR = {
    SensorType.LIGHT: ReportingMode.ON_CHANGE,
    SensorType.MOTION_DETECT: ReportingMode.ONE_SHOT,
    SensorType.STEP_DETECTOR: ReportingMode.SPECIAL_TRIGGER,
}


class RegularSource:
    """Samples at multiples of each sensor's period; notes every call that a HAL would get.

    Sensors of other reporting modes report what `happen` says; it can lose and find its phone.
    """

    def __init__(self, types: tuple[SensorType, ...], fifo: int = 10_000) -> None:
        self.sensors = tuple(
            SensorInfo(
                handle=int(kind),
                type=kind,
                name=kind.name,
                vendor="test",
                version=1,
                max_range=100.0,
                resolution=0.01,
                power_ma=0.5,
                min_delay_us=5_000,
                max_delay_us=200_000,
                fifo_max_event_count=fifo,
            )
            if kind not in IRREGULAR
            else _irregular(kind, IRREGULAR[kind], fifo)
            for kind in types
        )
        self._modes = {sensor.handle: sensor.reporting_mode for sensor in self.sensors}
        self._happened: dict[int, list[tuple[int, float]]] = {}
        self._present: dict[int, float] = {}
        self.value = 1.0
        self.is_lost = False
        self.flush_is_slow = False
        self.flushes_asked = 0
        self.connected: tuple[SensorInfo, ...] = ()
        self.disconnected: tuple[int, ...] = ()
        self.time_map = TimeMap(offset_ns=1_000_000_000)
        self.clock = VirtualClock(self.time_map.offset_ns)
        self.end_ns: int | None = None
        self.calls: list[tuple[Any, ...]] = []
        self._period_ns = {sensor.handle: 200_000_000 for sensor in self.sensors}
        self._done_ns: dict[int, int] = {}
        self._flushes: list[int] = []
        self._now_ns = 0

    def happen(self, kind: SensorType, at_ms: float, value: float) -> None:
        """Have a sensor that is not continuous see something."""
        self._happened.setdefault(int(kind), []).append((int(at_ms * 1e6), value))

    def lose(self) -> None:
        """Forget everything and be gone."""
        self.is_lost = True
        self._done_ns.clear()
        self._flushes.clear()

    def _require_phone(self) -> None:
        if self.is_lost:
            raise SourceLostError("the phone is gone")

    def activate(self, handle: int, enabled: bool) -> None:
        self._require_phone()
        self.calls.append(("activate", handle, enabled))
        if enabled:
            self._done_ns[handle] = max(self._now_ns, self.time_map.to_sample(self.clock.now_ns()))
            if self._modes.get(handle) is ReportingMode.ON_CHANGE:
                self._happened.setdefault(handle, []).append((self._now_ns + 1, self._present.get(handle, 0.0)))
        else:
            self._done_ns.pop(handle, None)

    def batch(self, handle: int, sampling_period_ns: int, max_report_latency_ns: int) -> int:
        self._require_phone()
        self.calls.append(("batch", handle, sampling_period_ns, max_report_latency_ns))
        self._period_ns[handle] = sampling_period_ns
        return sampling_period_ns

    def flush(self, handle: int) -> None:
        self._require_phone()
        if handle not in self._done_ns:
            raise InvalidArgumentError(f"sensor {handle} is not active")
        self._flushes.append(handle)
        self.flushes_asked += 1

    def drain(self, until_ns: int) -> EventBatch:
        self._require_phone()
        self._now_ns = until_ns
        columns = {}
        for handle, done_ns in list(self._done_ns.items()):
            if self._modes.get(handle, ReportingMode.CONTINUOUS) is not ReportingMode.CONTINUOUS:
                if seen := [each for each in self._happened.get(handle, []) if done_ns < each[0] <= until_ns]:
                    columns[handle] = self._irregular_column(handle, sorted(seen))
                continue
            period = self._period_ns[handle]
            until_ns = until_ns if self.end_ns is None else min(until_ns, self.end_ns)
            times = np.arange(done_ns // period + 1, until_ns // period + 1, dtype=np.int64) * period
            columns[handle] = EventColumn(times, np.full((len(times), 3), self.value), np.full(len(times), 3, np.int8))
            self._done_ns[handle] = until_ns
        flushes, self._flushes = ([], self._flushes) if self.flush_is_slow else (self._flushes, [])
        connected, self.connected = self.connected, ()
        disconnected, self.disconnected = self.disconnected, ()
        return EventBatch(columns, flushes, connected, disconnected)

    def _irregular_column(self, handle: int, seen: list[tuple[int, float]]) -> EventColumn:
        times, values = zip(*seen, strict=True)
        self._happened[handle] = [each for each in self._happened[handle] if each not in seen]
        self._present[handle] = values[-1]
        if self._modes[handle] is ReportingMode.ONE_SHOT:
            times, values = times[:1], values[:1]
            del self._done_ns[handle]
        return EventColumn(np.array(times, np.int64), np.array([values]).T, np.full(len(times), 3, np.int8))

    def resume(self) -> None:
        self.calls.append(("resume",))
        self._now_ns = self.time_map.to_sample(self.clock.now_ns())
        self._done_ns = dict.fromkeys(self._done_ns, self._now_ns)

    def prepare(self) -> None:
        pass

    def set_environment(self, kind: SensorType, value: float) -> None:
        raise InvalidArgumentError("nothing to set")

    def next_sample_ns(self, handle: int) -> int | None:
        self._require_phone()
        if handle not in self._done_ns or self._modes[handle] is not ReportingMode.CONTINUOUS:
            return None
        period = self._period_ns[handle]
        return (self._done_ns[handle] // period + 1) * period

    def truth(self, timestamp_ns: int) -> Truth | None:
        return None


class CountingFilter:
    """Says level and north as soon as it has seen anything, and how it was fed."""

    name = "counting"

    def __init__(self) -> None:
        self.fed: list[int] = []
        self.status = FilterStatus.OK

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        self.fed.append(timestamp_ns)

    def update_batch(self, events: Iterable[FlatEvent]) -> None:
        self.fed += [event[1] for event in events]

    def orientation(self) -> Orientation | None:
        if not self.fed:
            return None
        return Orientation(self.fed[-1], (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.1, self.status)

    def clear_events(self) -> None:
        self.status &= ~(FilterStatus.GAP | FilterStatus.BAD_SAMPLE)

    def save(self) -> dict[str, Any]:
        return {}

    def restore(self, saved: Mapping[str, Any]) -> None:
        del saved


class Bench:
    """A service over a regular source, with the clock in hand."""

    def __init__(self, types: tuple[SensorType, ...], fifo: int = 10_000) -> None:
        self.source = RegularSource(types, fifo)
        self.clock = self.source.clock
        self.filter = CountingFilter()
        self.service = SensorService(self.source, self.filter, self.clock)

    def advance_ms(self, sample_ms: float) -> None:
        """Move the clock to a sample time and let the service catch up."""
        self.clock.advance_to(self.source.time_map.to_boot(int(sample_ms * 1e6)))
        self.service.advance()

    @property
    def deadline_ms(self) -> float | None:
        """The service's next deadline as a sample time."""
        deadline = self.service.next_deadline_ns()
        return None if deadline is None else self.source.time_map.to_sample(deadline) / 1e6


NINE_AXES = (SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD, SensorType.GYROSCOPE)


@pytest.fixture
def make_bench() -> Callable[..., Bench]:
    def make(types: tuple[SensorType, ...] = NINE_AXES, fifo: int = 10_000) -> Bench:
        return Bench(types, fifo)

    return make
