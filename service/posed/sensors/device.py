"""What stands between the service and its source, as AOSP's SensorDevice stands before the HAL (SensorDevice.cpp)."""

import logging
from collections.abc import Callable, Sequence
from typing import TypeVar

from posed.clock import Clock, TimeMap
from posed.errors import SourceLostError
from posed.events import EventBatch, SensorType
from posed.hal.source import SensorSource
from posed.sensors.arbitration import BatchParams

_log = logging.getLogger(__name__)
_T = TypeVar("_T")

RECONNECT_INTERVAL_NS = 500_000_000
"""How long a lost source is left alone between two tries."""


class SensorDevice:
    """A source whose loss nobody above it sees but as a gap."""

    def __init__(self, source: SensorSource, clock: Clock) -> None:
        self._source = source
        self._clock = clock
        self.sensors = source.sensors
        self._active: dict[int, BatchParams] = {}
        self._flushing: list[int] = []
        self.retry_ns: int | None = None
        """CLOCK_BOOTTIME of the next try to get a lost source back; None while it is there."""
        self.losses = 0
        self.cpu_ns = 0
        """CPU time spent in the source."""
        self._lost = False
        self._dynamic: set[int] = set()
        self.reconfigured: dict[int, int] = {}
        """Periods (ns) by handle that a source chose when it returned, for the owner to take over and clear."""

    @property
    def time_map(self) -> TimeMap:
        """The mapping from sample time to CLOCK_BOOTTIME."""
        return self._source.time_map

    @property
    def end_ns(self) -> int | None:
        """Sample time of the last sample there will ever be, None for a source without end."""
        return self._source.end_ns

    def configure(self, handle: int, params: BatchParams | None) -> int:
        """Set period and latency of a sensor, which also activates it; None deactivates it.

        Returns the period that the source chose (ns), the one asked for while the source is lost.
        """
        if params is None:
            self._flushing = [asked for asked in self._flushing if asked != handle]
            if self._active.pop(handle, None) is not None:
                self._call(lambda: self._source.activate(handle, False))
            return 0
        was_active = handle in self._active
        period_ns = self._call(lambda: self._start(handle, params, was_active))
        self._active[handle] = params
        return params.sampling_period_ns if period_ns is None else period_ns

    def flush(self, handle: int) -> None:
        """Ask for one flush-complete behind the samples up to the next drain; of a lost source it comes at once.

        Raises InvalidArgumentError if the sensor is not active.
        """
        self._call(lambda: self._source.flush(handle))
        self._flushing.append(handle)

    def drain(self, until_ns: int) -> EventBatch:
        """Return what is new up to `until_ns` (sample time); nothing but flush-completes while it is lost."""
        if self.retry_ns is not None and self._clock.now_ns() >= self.retry_ns:
            self._reconnect()
        if self.retry_ns is not None:
            return self._drain_of_lost()
        started = self._clock.cpu_ns()
        try:
            batch = self._source.drain(until_ns)
        except SourceLostError as error:
            self._note_loss(error)
            return self._drain_of_lost()
        finally:
            self.cpu_ns += self._clock.cpu_ns() - started
        self._dynamic.update(info.handle for info in batch.connected)
        for handle in batch.disconnected:
            self._drop_dynamic(handle)
        if batch.flush_completes:
            asked = self._asked(batch.flush_completes)
            batch = EventBatch(batch.columns, asked, batch.connected, batch.disconnected)
        return batch

    def set_environment(self, kind: SensorType, value: float) -> None:
        """Set what an ambient sensor reads from now on; raises as the source does."""
        self._source.set_environment(kind, value)

    def next_sample_ns(self, handle: int) -> int | None:
        """Return when the next sample of an active sensor is due, None if none is expected."""
        if self.retry_ns is not None:
            return None
        try:
            return self._source.next_sample_ns(handle)
        except SourceLostError as error:
            self._note_loss(error)
            return None

    def resume(self) -> None:
        """Go on after a time in which nobody could drain."""
        self._call(self._source.resume)

    def _asked(self, flush_completes: Sequence[int]) -> list[int]:
        """Return the flush-completes that somebody asked for: any other is nobody's."""
        asked = []
        for handle in flush_completes:
            if handle in self._flushing:
                self._flushing.remove(handle)
                asked.append(handle)
        return asked

    def _drain_of_lost(self) -> EventBatch:
        flushes, self._flushing = self._flushing, []
        gone = sorted(self._dynamic)
        for handle in gone:
            self._drop_dynamic(handle)
        return EventBatch({}, flushes, (), gone)

    def _drop_dynamic(self, handle: int) -> None:
        self._dynamic.discard(handle)
        self._active.pop(handle, None)
        self._flushing = [asked for asked in self._flushing if asked != handle]

    def _start(self, handle: int, params: BatchParams, was_active: bool = False) -> int:
        period_ns = self._source.batch(handle, params.sampling_period_ns, params.max_report_latency_ns or 0)
        if not was_active:
            self._source.activate(handle, True)
        return period_ns

    def _reconnect(self) -> None:
        self.retry_ns = None
        for handle, params in self._active.items():
            period_ns = self._call(lambda handle=handle, params=params: self._start(handle, params))  # type: ignore[misc]
            if period_ns is not None:
                self.reconfigured[handle] = period_ns
        if self.retry_ns is None:
            self._lost = False
            _log.warning("the source is back; %d sensors run again", len(self._active))

    def _call(self, action: Callable[[], _T]) -> _T | None:
        """Return what the source answers, None while it is lost."""
        if self.retry_ns is not None:
            return None
        try:
            return action()
        except SourceLostError as error:
            self._note_loss(error)
            return None

    def _note_loss(self, error: SourceLostError) -> None:
        self.retry_ns = self._clock.now_ns() + RECONNECT_INTERVAL_NS
        if not self._lost:
            _log.warning("the source is lost; its clients see a gap until it is back: %s", error)
        self._lost = True
