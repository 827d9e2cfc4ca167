"""Filters of other packages behind the one protocol: what they have in common is done here.

They step at gyroscope samples of one rate and know no timestamps. So each sensor's period is measured over the first
second, during which events wait, and over every second after it; and an accelerometer or magnetometer sample waits for
the gyroscope sample that covers it, to act at the nearer of the two between which it was taken. A sample that came a
millisecond before a slow gyroscope's would otherwise act on an orientation one period old: at 15 Hz that costs VQF
7.1 degrees instead of 5.8 over BROAD's recordings.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import nan, pi, sqrt
from typing import Any

from posed.errors import InvalidArgumentError
from posed.events import FilterStatus, FlatEvent, Float64Array, Orientation, SensorType

_ACCELEROMETER = int(SensorType.ACCELEROMETER)
_MAGNETIC_FIELD = int(SensorType.MAGNETIC_FIELD)
_GYROSCOPE = int(SensorType.GYROSCOPE)

UNKNOWN_HEADING = pi / sqrt(3.0)
"""rad, one sigma of a heading uniform over the circle: the packages state no accuracy."""

UNKNOWN_BIAS = ((0.0, 0.0, 0.0), (nan, nan, nan))
"""What `gyro_bias` says before there is a filter to ask."""

_LONGEST_HOLD_NS = 500_000_000
_STRETCH_NS = 1_000_000_000
_MOST_HELD = 10_000
"""Events kept while the periods are not known: without a gyroscope they never are."""
_PERIOD_TOLERANCE = 0.1
"""Share by which a period may differ from the one in use before the filter is told another."""


@dataclass(frozen=True, slots=True)
class Periods:
    """Seconds between the samples of each sensor."""

    gyro: float
    acc: float
    mag: float


@dataclass
class PacedState:
    """What is remembered beside the package's own state; times in ns, each valid only with its flag."""

    periods: list[float] = field(default_factory=list)
    """Of gyroscope, accelerometer, magnetometer; empty until they have been measured."""
    stretch: dict[str, list[int]] = field(default_factory=dict)
    """Of the second that runs, by sensor type: first time, last time, samples."""
    held: list[FlatEvent] = field(default_factory=list)
    has_gyro: bool = False
    gyro_ns: int = 0
    newest_ns: int = 0
    rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyro_lost: bool = False
    has_acc: bool = False
    has_mag: bool = False
    events: int = 0


class PacedFilter(ABC):
    """An OrientationFilter over a filter that steps at gyroscope samples."""

    name: str

    def __init__(self) -> None:
        self._state = PacedState()

    # What a package's filter has to do

    @abstractmethod
    def _set_periods(self, periods: Periods) -> None:
        """Begin with these periods, or go on with them from the present state."""

    @abstractmethod
    def _step(self, before: Sequence[FlatEvent], rate: FlatEvent, after: Sequence[FlatEvent]) -> None:
        """Take a gyroscope sample, and the others that act before it and with it."""

    @abstractmethod
    def _measure(self, event: FlatEvent) -> None:
        """Take an accelerometer or magnetometer sample while there is no gyroscope."""

    @abstractmethod
    def _answer(self) -> tuple[tuple[float, ...], tuple[float, ...], FilterStatus]:
        """Return the quaternion (w, x, y, z), device to ENU, the gyroscope's bias (rad/s) and the status."""

    @abstractmethod
    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the gyroscope's bias and its standard deviations, rad/s in device axes.

        Zero with NaN before the filter has begun; NaN for deviations that a package does not state.
        """

    @abstractmethod
    def update_synchronous(
        self, period_s: float, rate: Float64Array, acceleration: Float64Array, field: Float64Array
    ) -> None:
        """Take samples of all three sensors at one rate, float64[n, 3], by the fastest form the package has.

        For measuring what it costs: nothing that it leads to can be asked for.
        """

    # The protocol

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        """Take one event: m/s2, rad/s or uT in device axes; other sensor types are ignored."""
        self._take((int(sensor_type), int(timestamp_ns), float(x), float(y), float(z)))

    def update_batch(self, events: Iterable[FlatEvent]) -> None:
        """Take events in the order given, each as by `update`."""
        for event in events:
            self._take(event)

    def orientation(self) -> Orientation | None:
        """Return the orientation at the newest gyroscope sample, None until gravity and north have been seen."""
        s = self._state
        if not (s.periods and s.has_acc and s.has_mag):
            return None
        (w, x, y, z), bias, status = self._answer()
        status |= FilterStatus(s.events)
        if s.gyro_lost:
            status |= FilterStatus.GYRO_LOST
            rate = (0.0, 0.0, 0.0)
        else:
            rate = (s.rate[0] - bias[0], s.rate[1] - bias[1], s.rate[2] - bias[2])
        sign = -1.0 if w < 0.0 else 1.0
        return Orientation(s.newest_ns, (sign * x, sign * y, sign * z, sign * w), rate, UNKNOWN_HEADING, status)

    def clear_events(self) -> None:
        """Forget GAP and BAD_SAMPLE."""
        self._state.events = 0

    # Private

    def _take(self, event: FlatEvent) -> None:
        s = self._state
        kind, t, x, y, z = event
        if kind not in (_GYROSCOPE, _ACCELEROMETER, _MAGNETIC_FIELD):
            return
        if not x * x + y * y + z * z < 1e8:
            s.events |= int(FilterStatus.BAD_SAMPLE)
            return
        if s.has_gyro and abs(t - s.gyro_ns) > _LONGEST_HOLD_NS and kind == _GYROSCOPE:
            s.events |= int(FilterStatus.GAP)
            s.stretch = {}
            s.has_gyro = False
        if kind == _GYROSCOPE and s.has_gyro and t <= s.gyro_ns:
            s.events |= int(FilterStatus.GAP)
            return
        self._count(kind, t)
        if not s.periods:
            del s.held[: max(0, len(s.held) + 1 - _MOST_HELD)]
            s.held.append(event)
            s.has_gyro, s.gyro_ns = (True, t) if kind == _GYROSCOPE else (s.has_gyro, s.gyro_ns)
            if kind == _GYROSCOPE and self._measure_periods(t):
                held, s.held, s.has_gyro = s.held, [], False
                for each in held:
                    self._pace(each)
            return
        if kind == _GYROSCOPE:
            self._measure_periods(t)
        self._pace(event)

    def _pace(self, event: FlatEvent) -> None:
        s = self._state
        kind, t = event[0], event[1]
        if kind != _GYROSCOPE:
            s.held.append(event)
            if s.gyro_lost or t - s.held[0][1] > _LONGEST_HOLD_NS:
                s.gyro_lost = True
                held, s.held = s.held, []
                for each in held:
                    self._note(each)
                    self._measure(each)
            return
        before: list[FlatEvent] = []
        after: list[FlatEvent] = []
        for each in s.held:
            self._note(each)
            nearer_before = s.has_gyro and each[1] - s.gyro_ns < t - each[1]
            (before if nearer_before else after).append(each)
        s.held = []
        s.rate = event[2:]
        stands_for = (t - s.gyro_ns) * 1e-9 / s.periods[0] if s.has_gyro else 1.0
        s.gyro_lost = False
        s.has_gyro = True
        s.gyro_ns = s.newest_ns = t
        if abs(stands_for - 1.0) > _PERIOD_TOLERANCE:
            # Samples were lost, or the rate has changed and is not yet known: the turn at least is to be right.
            event = (kind, t, event[2] * stands_for, event[3] * stands_for, event[4] * stands_for)
        self._step(before, event, after)

    def _note(self, event: FlatEvent) -> None:
        s = self._state
        if event[0] == _ACCELEROMETER:
            s.has_acc = True
        else:
            s.has_mag = True
        s.newest_ns = max(s.newest_ns, event[1])

    def _count(self, kind: int, t: int) -> None:
        counted = self._state.stretch.setdefault(str(kind), [t, t, 0])
        counted[1] = t
        counted[2] += 1

    def _measure_periods(self, t: int) -> bool:
        """At the end of a stretch tell the filter what periods it showed, if they changed; return if they are known."""
        s = self._state
        gyro = s.stretch[str(_GYROSCOPE)]
        if t - gyro[0] < _STRETCH_NS:
            return False
        period = self._period(_GYROSCOPE, 0, (gyro[1] - gyro[0]) * 1e-9)
        found = [period, self._period(_ACCELEROMETER, 1, period), self._period(_MAGNETIC_FIELD, 2, period)]
        s.stretch = {str(_GYROSCOPE): [t, t, 1]}
        if not s.periods or any(
            abs(new - old) > _PERIOD_TOLERANCE * old for new, old in zip(found, s.periods, strict=True)
        ):
            s.periods = found
            self._set_periods(Periods(*found))
        return True

    def _period(self, kind: int, index: int, default: float) -> float:
        s = self._state
        first, last, count = s.stretch.get(str(kind), (0, 0, 0))
        if count < 3 or last <= first:
            return s.periods[index] if s.periods else default
        return (last - first) * 1e-9 / (count - 1)

    def _saved(self) -> dict[str, Any]:
        state = asdict(self._state)
        return state | {"held": [list(event) for event in self._state.held], "rate": list(self._state.rate)}

    @staticmethod
    def _restored(saved: Any) -> PacedState:
        blank = asdict(PacedState()) | {"rate": []}
        fits = isinstance(saved, Mapping) and saved.keys() == blank.keys()
        if not fits or any(type(saved[name]) is not type(value) for name, value in blank.items()):
            raise InvalidArgumentError(f"the saved state is {saved!r:.100}, which is no state of this filter")
        held, rate = saved["held"], saved["rate"]
        if len(rate) != 3 or any(not isinstance(event, (list, tuple)) or len(event) != 5 for event in held):
            raise InvalidArgumentError(f"the saved state holds {held!r:.100} and the rate {rate!r:.100}; save it anew")
        return PacedState(**{**saved, "held": [tuple(event) for event in held], "rate": tuple(rate)})
