"""The instants on which the poses of one period stand."""

from dataclasses import dataclass

from posed.events import FilterStatus


@dataclass(slots=True, eq=False)
class PoseGrid:
    """Instants `anchor_ns + k * period`, k = 0, 1, ...; all sample time, ns. The index k is the pose's sequence."""

    period_us: int
    anchor_ns: int
    next_index: int
    events_before: int
    """Count of fused events at the last instant passed, to tell how many came since."""
    occurred: FilterStatus = FilterStatus.OK
    """What happened in the filter since the last instant."""

    @property
    def next_ns(self) -> int:
        """The next instant."""
        return self.anchor_ns + self.next_index * self.period_us * 1000

    def skip(self, now_ns: int) -> None:
        """Pass over the instants up to `now_ns`."""
        self.next_index = max(self.next_index, (now_ns - self.anchor_ns) // (self.period_us * 1000) + 1)
