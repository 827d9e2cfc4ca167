"""A source whose every sample is known, and a filter that counts."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import pytest

from posed.clock import TimeMap, VirtualClock
from posed.errors import InvalidArgumentError
from posed.events import (
    EventBatch,
    EventColumn,
    FilterStatus,
    FlatEvent,
    Orientation,
    SensorInfo,
    SensorType,
    Truth,
)
from posed.sensors import SensorService


class RegularSource:
    """Samples at multiples of each sensor's period; notes every call that a HAL would get."""

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
            for kind in types
        )
        self.time_map = TimeMap(offset_ns=1_000_000_000)
        self.clock = VirtualClock(self.time_map.offset_ns)
        self.end_ns: int | None = None
        self.calls: list[tuple[Any, ...]] = []
        self._period_ns = {sensor.handle: 200_000_000 for sensor in self.sensors}
        self._done_ns: dict[int, int] = {}
        self._flushes: list[int] = []
        self._now_ns = 0

    def activate(self, handle: int, enabled: bool) -> None:
        self.calls.append(("activate", handle, enabled))
        if enabled:
            self._done_ns[handle] = self._now_ns
        else:
            del self._done_ns[handle]

    def batch(self, handle: int, sampling_period_ns: int, max_report_latency_ns: int) -> int:
        self.calls.append(("batch", handle, sampling_period_ns, max_report_latency_ns))
        self._period_ns[handle] = sampling_period_ns
        return sampling_period_ns

    def flush(self, handle: int) -> None:
        if handle not in self._done_ns:
            raise InvalidArgumentError(f"sensor {handle} is not active")
        self._flushes.append(handle)

    def drain(self, until_ns: int) -> EventBatch:
        self._now_ns = until_ns
        columns = {}
        for handle, done_ns in self._done_ns.items():
            period = self._period_ns[handle]
            until_ns = until_ns if self.end_ns is None else min(until_ns, self.end_ns)
            times = np.arange(done_ns // period + 1, until_ns // period + 1, dtype=np.int64) * period
            columns[handle] = EventColumn(times, np.full((len(times), 3), 1.0), np.full(len(times), 3, np.int8))
            self._done_ns[handle] = until_ns
        flushes, self._flushes = self._flushes, []
        return EventBatch(columns, flushes)

    def resume(self) -> None:
        self.calls.append(("resume",))
        self._now_ns = self.time_map.to_sample(self.clock.now_ns())
        self._done_ns = dict.fromkeys(self._done_ns, self._now_ns)

    def next_sample_ns(self, handle: int) -> int | None:
        if handle not in self._done_ns:
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
