"""The instants on which the poses of one period stand."""

from dataclasses import dataclass, field

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

    next_ns: int = field(init=False)
    """The next instant, that of next_index."""

    def __post_init__(self) -> None:
        self.move_to(self.next_index)

    def move_to(self, index: int) -> None:
        """Have the instant of this index be the next."""
        self.next_index = index
        self.next_ns = self.anchor_ns + index * self.period_us * 1000

    def skip(self, now_ns: int) -> None:
        """Pass over the instants up to `now_ns`."""
        self.move_to(max(self.next_index, (now_ns - self.anchor_ns) // (self.period_us * 1000) + 1))
