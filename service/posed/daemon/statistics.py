"""What the daemon counts about itself."""

import time
from collections import deque
from pathlib import Path


class PublicationStatistics:
    """How many poses went out, and how late the last 10,000 of them were."""

    def __init__(self) -> None:
        self.published = 0
        self.skipped = 0
        self._lateness_ns: deque[int] = deque(maxlen=10_000)

    def add(self, lateness_ns: int) -> None:
        """Note one published pose and its send time minus its grid instant, ns."""
        self.published += 1
        self._lateness_ns.append(lateness_ns)

    def lateness_percentiles_ms(self) -> tuple[float, float]:
        """Return the median and the 99th percentile, ms; 0 before any pose."""
        if not self._lateness_ns:
            return 0.0, 0.0
        ordered = sorted(self._lateness_ns)
        return ordered[len(ordered) // 2] / 1e6, ordered[min(len(ordered) - 1, len(ordered) * 99 // 100)] / 1e6


def process_cpu_ns() -> int:
    """Return the CPU time of all threads of this process, ns."""
    return time.process_time_ns()


def voluntary_switches() -> int:
    """Return how often the threads of this process went to sleep."""
    total = 0
    for status in Path("/proc/self/task").glob("*/status"):
        for line in status.read_text().splitlines():
            if line.startswith("voluntary_ctxt_switches:"):
                total += int(line.split()[1])
    return total
