"""What time it is: the injected clock, and the mapping from a source's sample time to it."""

import time
from dataclasses import dataclass
from typing import Protocol


class Clock(Protocol):
    """Time as the rooms see it; nothing below the daemon asks the operating system for it."""

    def now_ns(self) -> int:
        """Return the time since boot, suspended time included (CLOCK_BOOTTIME), in nanoseconds."""

    def cpu_ns(self) -> int:
        """Return the CPU time this thread has used, in nanoseconds (0 where it is not accounted)."""


class BootClock:
    """The machine's CLOCK_BOOTTIME: the time base of Android's SensorEvent.timestamp."""

    def now_ns(self) -> int:
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def cpu_ns(self) -> int:
        return time.thread_time_ns()


class VirtualClock:
    """A clock that stands still until it is moved: fusion without waiting, and tests."""

    def __init__(self, now_ns: int = 0) -> None:
        self._now_ns = now_ns

    def now_ns(self) -> int:
        return self._now_ns

    def cpu_ns(self) -> int:
        return 0

    def advance_to(self, now_ns: int) -> None:
        """Move to `now_ns`; a moment already passed leaves the clock where it is."""
        self._now_ns = max(self._now_ns, now_ns)


@dataclass(frozen=True, slots=True)
class TimeMap:
    """boot_ns = offset_ns + scale * sample_ns; scale is 1 live, 1/speed in a replay."""

    offset_ns: int = 0
    scale: float = 1.0

    def to_boot(self, sample_ns: int) -> int:
        """Return the CLOCK_BOOTTIME instant (ns) at which the sample time `sample_ns` stands."""
        if self.scale == 1.0:
            return self.offset_ns + sample_ns
        return self.offset_ns + round(self.scale * sample_ns)

    def to_sample(self, boot_ns: int) -> int:
        """Return the sample time (ns) that stands at the CLOCK_BOOTTIME instant `boot_ns`."""
        if self.scale == 1.0:
            return boot_ns - self.offset_ns
        return round((boot_ns - self.offset_ns) / self.scale)
