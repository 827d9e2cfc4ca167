"""One sensor of the service: who asked for it, what that comes to, and the events on their way to them."""

from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass, field

from posed.events import EventColumn, ReportingMode, SensorInfo
from posed.sensors.arbitration import BatchParams
from posed.sensors.connection import SensorEventConnection
from posed.sensors.recent_events import RecentEventLogger


@dataclass(slots=True, eq=False)
class ActiveSensor:
    """A sensor's registrations and what they come to."""

    info: SensorInfo
    lead: "ActiveSensor | None" = None
    """Of a virtual sensor, the physical one whose events its own follow."""
    requests: dict[Hashable, BatchParams] = field(default_factory=dict)
    params: BatchParams | None = None
    latency_ns: int | None = None
    """Report latency in force: 0 streams, None if nobody listens."""
    configured_period_ns: int = 0
    listeners: list[SensorEventConnection] = field(default_factory=list)
    flushing: deque[SensorEventConnection] = field(default_factory=deque)
    """Who waits for a flush-complete, in the order asked."""
    events: int = 0
    pending: list[EventColumn] = field(default_factory=list)
    pending_events: int = 0
    release_ns: int = 0
    """Sample time at which pending events must go out."""
    recent: RecentEventLogger = field(init=False)
    is_virtual: bool = field(init=False)
    """True if it is computed from other sensors' events."""
    is_one_shot: bool = field(init=False)
    """True if it reports once and is off then."""

    def __post_init__(self) -> None:
        self.recent = RecentEventLogger(self.info.type)
        self.is_virtual = self.lead is not None
        self.is_one_shot = self.info.reporting_mode is ReportingMode.ONE_SHOT

    def follow(self, params: BatchParams | None, configured_period_ns: int) -> None:
        """Take over what the requests come to, and the period that the source made of it (0 of a virtual sensor)."""
        self.params = params
        self.configured_period_ns = configured_period_ns
        self.latency_ns = None
        if params is not None and params.max_report_latency_ns is not None:
            latency_ns = params.max_report_latency_ns
            fifo = self.info.fifo_max_event_count
            if not fifo:
                latency_ns = 0
            elif self.info.reporting_mode is ReportingMode.CONTINUOUS:
                # The source may be faster than asked: then its FIFO is full so much earlier.
                latency_ns = min(latency_ns, fifo * (configured_period_ns or params.sampling_period_ns))
            self.latency_ns = latency_ns if latency_ns > params.sampling_period_ns else 0

    def take_in(self, column: EventColumn, boot_ns: int) -> None:
        """Note events that have come, and hold them for the listeners."""
        if self.is_one_shot:
            # Off by itself with its first event: what was computed beyond it never happened.
            column = column[: 0 if self.pending else 1]
        count = len(column.timestamp_ns)
        if not count:
            return
        self.events += count
        if self.requests:
            self.recent.add(column, boot_ns)
        if self.listeners:
            self.pending.append(column)
            self.pending_events += count

    def release(self) -> bool:
        """Queue what is held for every listener; False if nothing was."""
        if not self.pending:
            return False
        column = EventColumn.concatenate(self.pending)
        period_ns = (self.lead or self).configured_period_ns
        for connection in self.listeners:
            connection.offer(self.info.handle, column, period_ns)
        self.discard()
        return True

    def discard(self) -> None:
        """Forget what is held."""
        self.pending.clear()
        self.pending_events = 0
