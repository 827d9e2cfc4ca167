"""Steps of one who walks, from the size of the acceleration: a peak a step, told once the peaks come regularly."""

import math
from collections.abc import Sequence

from posed.events import EventColumn, FlatEvent, SensorType
from posed.sensors.detectors import event_column
from posed.sensors.virtual import Computation

# The cadence of walking is 1.1 to 2.9 steps a second; a run's peaks stand closer and are told too.
_SHORTEST_NS = 300_000_000
_INTERVALS_NS = (350_000_000, 900_000_000)
_ALIKE = 0.25
_REGULAR = 3
_HEIGHT = 0.4
_PROMINENCE = 0.8
_SMOOTHED_S = 0.05
_LEVEL_S = 1.0


def make(kind: SensorType) -> Computation:
    """Make the step detector or the step counter."""
    return StepDetector() if kind is SensorType.STEP_DETECTOR else StepCounter()


class StepFinder:
    """Finds steps in accelerometer events.

    The size of the acceleration, less its level over about a second and smoothed over 0.05 s, has a peak at each step:
    at least 0.4 m/s2 high, and 0.8 above the valleys on its sides. A phone that is turned about has such peaks as well,
    but not at a walker's intervals: peaks are kept back until three intervals on end are 0.35 to 0.9 s long and alike
    within a quarter, and are then steps, as is each that follows in time. That takes two seconds at a slow walk.
    """

    def __init__(self) -> None:
        self._before_ns: int | None = None
        self._level = 0.0
        self._smooth = (0.0, 0.0)
        self._highest = (0, -math.inf)
        self._lowest = math.inf
        self._rising = True
        self._peaks: list[int] = []
        self._is_walking = False

    def take(self, timestamp_ns: int, size: float) -> list[int]:
        """Take the size of the acceleration (m/s2); return when the steps were that it confirms, oldest first."""
        value = self._filtered(timestamp_ns, size)
        if self._rising:
            if value > self._highest[1]:
                self._highest = (timestamp_ns, value)
            elif value < self._highest[1] - _PROMINENCE:
                self._rising, self._lowest = False, value
                return self._peak(self._highest[0]) if self._highest[1] >= _HEIGHT else []
        elif value < self._lowest:
            self._lowest = value
        elif value > self._lowest + _PROMINENCE:
            self._rising, self._highest = True, (timestamp_ns, value)
        return []

    def _filtered(self, timestamp_ns: int, size: float) -> float:
        """Return the size without its level, smoothed twice."""
        if self._before_ns is None:
            self._before_ns, self._level = timestamp_ns, size
        seconds = min(1e-9 * (timestamp_ns - self._before_ns), _LEVEL_S)
        self._before_ns = timestamp_ns
        self._level += (1.0 - math.exp(-seconds / _LEVEL_S)) * (size - self._level)
        share = 1.0 - math.exp(-seconds / _SMOOTHED_S)
        once = self._smooth[0] + share * (size - self._level - self._smooth[0])
        twice = self._smooth[1] + share * (once - self._smooth[1])
        self._smooth = (once, twice)
        return twice

    def _peak(self, at_ns: int) -> list[int]:
        if self._peaks and at_ns - self._peaks[-1] < _SHORTEST_NS:
            return []
        interval_ns = at_ns - self._peaks[-1] if self._peaks else 0
        shortest_ns, longest_ns = _INTERVALS_NS
        if self._peaks and not self._fits(interval_ns, shortest_ns, longest_ns):
            self._peaks, self._is_walking = [], False
        self._peaks.append(at_ns)
        if self._is_walking:
            del self._peaks[:-2]
            return [at_ns]
        if len(self._peaks) <= _REGULAR:
            return []
        self._is_walking = True
        return list(self._peaks)

    def _fits(self, interval_ns: int, shortest_ns: int, longest_ns: int) -> bool:
        if not shortest_ns <= interval_ns <= longest_ns:
            return False
        if len(self._peaks) < 2:
            return True
        before_ns = self._peaks[-1] - self._peaks[-2]
        return abs(interval_ns - before_ns) <= _ALIKE * max(interval_ns, before_ns)


class StepDetector:
    """1.0 at the instant of each step."""

    def __init__(self) -> None:
        self._finder = StepFinder()

    def restart(self) -> None:
        """Begin anew."""
        self._finder = StepFinder()

    def take(self, events: Sequence[FlatEvent]) -> EventColumn | None:
        """Report each step at the timestamp of its peak."""
        return event_column([(at_ns, 1.0) for _, steps in _steps(self._finder, events) for at_ns in steps])


class StepCounter:
    """The steps since the daemon began, while anybody asked; told when they change, and at first."""

    def __init__(self) -> None:
        self._finder = StepFinder()
        self._count = 0
        self._is_told = False

    def restart(self) -> None:
        """Begin to look for steps anew, and go on counting."""
        self._finder = StepFinder()
        self._is_told = False

    def take(self, events: Sequence[FlatEvent]) -> EventColumn | None:
        """Report the count at the timestamp of the accelerometer event by which it changed."""
        found: list[tuple[int, float]] = []
        for timestamp_ns, steps in _steps(self._finder, events):
            self._count += len(steps)
            if steps or not self._is_told:
                self._is_told = True
                found.append((timestamp_ns, float(self._count)))
        return event_column(found)


def _steps(finder: StepFinder, events: Sequence[FlatEvent]) -> list[tuple[int, list[int]]]:
    """Return each accelerometer event's timestamp, and the steps it confirms."""
    return [
        (timestamp_ns, finder.take(timestamp_ns, math.hypot(x, y, z)))
        for kind, timestamp_ns, x, y, z in events
        if kind == SensorType.ACCELEROMETER
    ]
