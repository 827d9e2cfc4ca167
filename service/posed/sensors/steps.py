"""Steps of one who walks, from the size of the acceleration: a peak a step, told once the peaks come regularly."""

import math
from collections.abc import Sequence

from posed.events import EventColumn, FlatEvent, SensorType
from posed.sensors.detectors import accelerations, event_column
from posed.sensors.virtual import Computation

_SHORTEST_NS = 300_000_000
_INTERVALS_NS = (350_000_000, 900_000_000)
_PAUSE_NS = 1_300_000_000
_LEGS_APART = 0.45
_STRIDES_APART = 0.2
# Four would tell fewer of the steps that are none, but at 1.8 steps a second only after 2 s, Android's bound.
_REGULAR = 3
_HEIGHT = 0.4
_PROMINENCE = 0.8
_SMOOTHED_S = 0.05
_LEVEL_S = 1.0


def make(kind: SensorType) -> Computation:
    """Make the step detector or the step counter."""
    return StepDetector() if kind is SensorType.STEP_DETECTOR else StepCounter()


class Gait:
    """Tells the peaks that are a walker's steps from those of a phone that is turned about.

    Peaks are kept back until three intervals on end are 0.35 to 0.9 s long and go together, and are then steps, as is
    each that follows in time. Intervals go together if strides, two intervals each, are alike within a fifth: in a
    trouser pocket the two legs differ, 0.43 s by turns with 0.65 s. One interval that does not fit is forgiven, if it
    is no pause. The first steps are told within 2 s at 1.6 steps a second and more.
    """

    def __init__(self) -> None:
        self._held: list[int] = []
        self._last_ns: int | None = None
        self._intervals: list[int] = []
        self._is_walking = False
        self._has_forgiven = False

    def take(self, at_ns: int) -> list[int]:
        """Take the instant of a peak; return those of the steps that it confirms, oldest first."""
        interval_ns = None if self._last_ns is None else at_ns - self._last_ns
        if interval_ns is not None and interval_ns < _SHORTEST_NS:
            return []
        self._last_ns = at_ns
        if interval_ns is not None:
            self._follow(interval_ns)
        self._held.append(at_ns)
        if not self._is_walking and len(self._held) <= _REGULAR:
            return []
        self._is_walking = True
        steps, self._held = self._held, []
        return steps

    def _follow(self, interval_ns: int) -> None:
        if self._fits(interval_ns):
            self._intervals = [*self._intervals[-1:], interval_ns]
            self._has_forgiven = False
        elif self._is_walking and interval_ns <= _PAUSE_NS and not self._has_forgiven:
            self._intervals = []
            self._has_forgiven = True
        else:
            self._held, self._intervals = [], []
            self._is_walking = self._has_forgiven = False

    def _fits(self, interval_ns: int) -> bool:
        shortest_ns, longest_ns = _INTERVALS_NS
        if not shortest_ns <= interval_ns <= longest_ns:
            return False
        if not self._intervals:
            return True
        if not _alike(interval_ns, self._intervals[-1], _LEGS_APART):
            return False
        return len(self._intervals) < 2 or _alike(
            interval_ns + self._intervals[1], self._intervals[1] + self._intervals[0], _STRIDES_APART
        )


def _alike(one: int, other: int, share: float) -> bool:
    return abs(one - other) <= share * max(one, other)


class StepFinder:
    """Finds steps in accelerometer events.

    The size of the acceleration, less its level over about a second and smoothed over 0.05 s, has a peak at each step:
    at least 0.4 m/s2 high, and 0.8 above the valleys on its sides; a second peak within 0.3 s belongs to it. Of these,
    `Gait` tells the steps.
    """

    def __init__(self) -> None:
        self._before_ns: int | None = None
        self._level = 0.0
        self._smooth = (0.0, 0.0)
        self._highest = (0, -math.inf)
        self._lowest = math.inf
        self._rising = True
        self._gait = Gait()

    def take(self, timestamp_ns: int, size: float) -> list[int]:
        """Take the size of the acceleration (m/s2); return when the steps were that it confirms, oldest first."""
        value = self._filtered(timestamp_ns, size)
        if self._rising:
            if value > self._highest[1]:
                self._highest = (timestamp_ns, value)
            elif value < self._highest[1] - _PROMINENCE:
                self._rising, self._lowest = False, value
                return self._gait.take(self._highest[0]) if self._highest[1] >= _HEIGHT else []
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
        (timestamp_ns, finder.take(timestamp_ns, math.hypot(*acceleration)))
        for timestamp_ns, acceleration in accelerations(events)
    ]
