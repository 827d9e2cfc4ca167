"""Detectors on the accelerometer alone, as a phone's sensor hub has them (sensors-base.h: what each tells)."""

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence

from posed.events import EventColumn, FlatEvent, SensorType
from posed.sensors.virtual import Computation

_LARGEST = 10_000.0
"""m/s2. A sample beyond it, or with NaN, is no measurement, for the filters neither."""
_LONGEST_GAP_NS = 500_000_000
"""Behind a longer one a detector counts anew: nobody knows what the phone did meanwhile."""
_Vector = tuple[float, float, float]


def make(kind: SensorType) -> Computation:
    """Make the detector of a type."""
    return Detector(_DETECTORS[kind])


def event_column(found: Sequence[tuple[int, float]]) -> EventColumn | None:
    """Return (timestamp, value) pairs as a sensor's events of one value, None if there are none."""
    if not found:
        return None
    return EventColumn.of_rows([timestamp_ns for timestamp_ns, _ in found], [[value] for _, value in found])


def accelerations(events: Sequence[FlatEvent]) -> Iterator[tuple[int, _Vector]]:
    """Yield timestamp and value of each accelerometer event that is a measurement: a recording holds others too."""
    for kind, timestamp_ns, x, y, z in events:
        if kind == SensorType.ACCELEROMETER and math.hypot(x, y, z) <= _LARGEST:
            yield timestamp_ns, (x, y, z)


class Detector:
    """Runs a rule over accelerometer events: a rule takes one at a time and may return a value to report."""

    def __init__(self, make_rule: "Callable[[], Rule]") -> None:
        self._make_rule = make_rule
        self._rule = make_rule()

    def restart(self) -> None:
        """Begin anew."""
        self._rule = self._make_rule()

    def take(self, events: Sequence[FlatEvent]) -> EventColumn | None:
        """Report at the timestamp of the accelerometer event that decides."""
        return event_column(
            [
                (timestamp_ns, value)
                for timestamp_ns, acceleration in accelerations(events)
                if (value := self._rule(timestamp_ns, acceleration)) is not None
            ]
        )


Rule = Callable[[int, _Vector], float | None]
"""Takes sample time (ns) and acceleration (m/s2, device axes)."""


class Tilt:
    """1.0 whenever the mean of 2 s has turned by 35 degrees since the last time, or since it began."""

    _WINDOW_NS = 2_000_000_000
    _COSINE = math.cos(math.radians(35.0))

    def __init__(self) -> None:
        self._window: deque[tuple[int, _Vector]] = deque()
        self._sum = [0.0, 0.0, 0.0]
        self._reference: list[float] | None = None

    def __call__(self, timestamp_ns: int, acceleration: _Vector) -> float | None:
        self._window.append((timestamp_ns, acceleration))
        for axis in range(3):
            self._sum[axis] += acceleration[axis]
        if timestamp_ns - self._window[0][0] < self._WINDOW_NS:
            return None
        if self._reference is None:
            self._reference = list(self._sum)
        turned = _cosine(self._sum, self._reference) < self._COSINE
        if turned:
            self._reference = list(self._sum)
        # More than one goes after a change to a slower rate, or a gap.
        while timestamp_ns - self._window[0][0] >= self._WINDOW_NS:
            _, oldest = self._window.popleft()
            for axis in range(3):
                self._sum[axis] -= oldest[axis]
        return 1.0 if turned else None


class DeviceOrientation:
    """Which way up the screen is held: 0 natural, 1 with its x axis up, 2 on its head, 3 with its x axis down.

    A quadrant counts once gravity, smoothed over 0.2 s, has been within 30 degrees of its middle for half a second;
    while the phone lies flatter than 25 degrees the one before stays.
    """

    _SMOOTHED_NS = 200_000_000
    _STEADY_NS = 500_000_000
    _FLAT = math.sin(math.radians(25.0))
    _REACH = math.radians(30.0)

    def __init__(self) -> None:
        self._gravity: list[float] = []
        self._before_ns = 0
        self._told: int | None = None
        self._candidate: int | None = None
        self._since_ns = 0

    def __call__(self, timestamp_ns: int, acceleration: _Vector) -> float | None:
        if not self._gravity:
            self._gravity = list(acceleration)
            self._since_ns = timestamp_ns
        else:
            share = min(1.0, (timestamp_ns - self._before_ns) / self._SMOOTHED_NS)
            self._gravity = [g + share * (a - g) for g, a in zip(self._gravity, acceleration, strict=True)]
        self._before_ns = timestamp_ns
        candidate = self._quadrant()
        if candidate != self._candidate:
            self._candidate, self._since_ns = candidate, timestamp_ns
        if timestamp_ns - self._since_ns < self._STEADY_NS:
            return None
        # A phone that has lain flat from the start is taken to be the natural way up.
        settled = candidate if candidate is not None else self._told if self._told is not None else 0
        if settled == self._told:
            return None
        self._told = settled
        return float(settled)

    def _quadrant(self) -> int | None:
        x, y, z = self._gravity
        across = math.hypot(x, y)
        if across < self._FLAT * math.hypot(across, z):
            return None
        angle = math.atan2(x, y) / (math.pi / 2)
        nearest = round(angle)
        return nearest % 4 if abs(angle - nearest) * (math.pi / 2) <= self._REACH else None


class Persistence:
    """1.0 once a phone has been still, or moving, for so many seconds on end.

    A second counts as still if no axis leaves its mean by 0.5 m/s2 and the mean is that of the second before, likewise.
    """

    _SECOND_NS = 1_000_000_000
    _DEVIATION = 0.5

    def __init__(self, moving: bool, seconds: int) -> None:
        self._moving = moving
        self._seconds = seconds
        self._samples: list[_Vector] = []
        self._before_ns = 0
        self._begun_ns = 0
        self._mean: list[float] | None = None
        self._count = 0

    def __call__(self, timestamp_ns: int, acceleration: _Vector) -> float | None:
        if timestamp_ns - self._before_ns > _LONGEST_GAP_NS:
            self._samples, self._mean, self._count = [], None, 0
        self._before_ns = timestamp_ns
        if not self._samples:
            self._begun_ns = timestamp_ns
        self._samples.append(acceleration)
        if timestamp_ns - self._begun_ns < self._SECOND_NS:
            return None
        self._count = self._count + 1 if self._moved() == self._moving else 0
        self._samples = []
        return 1.0 if self._count >= self._seconds else None

    def _moved(self) -> bool:
        axes = list(zip(*self._samples, strict=True))
        mean = [sum(axis) / len(axis) for axis in axes]
        before, self._mean = self._mean or mean, mean
        return any(
            max(max(axis) - centre, centre - min(axis), abs(centre - earlier)) > self._DEVIATION
            for axis, centre, earlier in zip(axes, mean, before, strict=True)
        )


class SignificantMotion:
    """1.0 once the phone has been carried along: eight seconds on end in each of which its acceleration shakes.

    In each the standard deviation of the acceleration's size is above 0.5 m/s2, as of one who walks, rides or drives;
    that of a phone that is looked at, turned or laid down is not, for so long.
    """

    _SECOND_NS = 1_000_000_000
    _DEVIATION = 0.5
    _SECONDS = 8

    def __init__(self) -> None:
        self._sizes: list[float] = []
        self._before_ns = 0
        self._begun_ns = 0
        self._count = 0

    def __call__(self, timestamp_ns: int, acceleration: _Vector) -> float | None:
        if timestamp_ns - self._before_ns > _LONGEST_GAP_NS:
            self._sizes, self._count = [], 0
        self._before_ns = timestamp_ns
        if not self._sizes:
            self._begun_ns = timestamp_ns
        self._sizes.append(math.hypot(*acceleration))
        if timestamp_ns - self._begun_ns < self._SECOND_NS:
            return None
        mean = sum(self._sizes) / len(self._sizes)
        deviation = math.sqrt(sum((size - mean) ** 2 for size in self._sizes) / len(self._sizes))
        self._count = self._count + 1 if deviation > self._DEVIATION else 0
        self._sizes = []
        return 1.0 if self._count >= self._SECONDS else None


_DETECTORS: dict[SensorType, Callable[[], Rule]] = {
    SensorType.TILT_DETECTOR: Tilt,
    SensorType.DEVICE_ORIENTATION: DeviceOrientation,
    SensorType.STATIONARY_DETECT: lambda: Persistence(moving=False, seconds=5),
    SensorType.MOTION_DETECT: lambda: Persistence(moving=True, seconds=5),
    SensorType.SIGNIFICANT_MOTION: SignificantMotion,
}


def _cosine(a: Sequence[float], b: Sequence[float]) -> float:
    dot = sum(p * q for p, q in zip(a, b, strict=True))
    return dot / max(math.hypot(*a) * math.hypot(*b), 1e-12)
