"""What surrounds a simulated phone, as its pressure, light and proximity sensors tell it: values that somebody sets."""

import math
from bisect import bisect_right
from operator import itemgetter

from posed.errors import InvalidArgumentError
from posed.events import EventColumn, ReportingMode, SensorInfo, SensorType
from posed.hal.profile import AmbientPart, exact_period_ns
from posed.hal.quantisation import Quantiser
from posed.hal.seeded import SeededRandom

_AT_FIRST = {SensorType.PRESSURE: 1013.25, SensorType.LIGHT: 300.0}
"""hPa, lux; nothing is near (cm), as far as a proximity sensor sees."""
_NOISE_STREAM = 3
"""Sets the generators of ambient noise apart from the others made from the same seed."""


class Surroundings:
    """Ambient sensors of a phone; times are sample time, ns. A sensor's handle is its type's number.

    Pressure is sampled on a grid from sample time 0, with noise that the seed decides; light and proximity tell their
    value when they are switched on, and then its changes, none sooner than their period after the one before.
    """

    def __init__(self, parts: tuple[AmbientPart, ...], seed: int) -> None:
        self._parts = {int(part.type): part for part in parts}
        self._values = {
            handle: _Value(_AT_FIRST.get(part.type, part.max_range)) for handle, part in self._parts.items()
        }
        self._quantisers = {handle: Quantiser(part.info()) for handle, part in self._parts.items()}
        self._periods_ns = dict.fromkeys(self._parts, 0)
        self._active: dict[int, _Sampled | _Changes] = {}
        self._seed = seed

    @property
    def infos(self) -> tuple[SensorInfo, ...]:
        """The sensors, in handle order."""
        return tuple(self._parts[handle].info() for handle in sorted(self._parts))

    def __contains__(self, handle: int) -> bool:
        return handle in self._parts

    def is_active(self, handle: int) -> bool:
        """Return whether a sensor is on."""
        return handle in self._active

    def set(self, kind: SensorType, value: float, at_ns: int) -> None:
        """Have a value from `at_ns` on, later than anything drained.

        Raises InvalidArgumentError for a sensor that is not here or a value it cannot read.
        """
        part = self._parts.get(int(kind))
        if part is None:
            known = ", ".join(sensor.type.name.lower() for sensor in self._parts.values()) or "nothing"
            raise InvalidArgumentError(f"{kind.name.lower()} cannot be set here; this phone lets one set {known}")
        if not 0.0 <= value <= part.max_range:
            raise InvalidArgumentError(
                f"{kind.name.lower()} = {value:g} is not what its sensor can read; allowed: 0 to {part.max_range:g}"
            )
        self._values[int(kind)].set(value, at_ns)
        active = self._active.get(int(kind))
        if active is None:
            # Whoever switches it on reads from then on; without a drain nothing else would forget.
            self._values[int(kind)].forget_before(at_ns)
        elif isinstance(active, _Changes):
            active.change(value, at_ns)

    def activate(self, handle: int, enabled: bool, at_ns: int) -> None:
        """Switch a sensor on, from `at_ns` on, or off."""
        if not enabled:
            self._active.pop(handle, None)
        elif handle not in self._active:
            self._begin(handle, at_ns)

    def batch(self, handle: int, sampling_period_ns: int, drained_ns: int) -> int:
        """Set a sensor's period, 0 or more, from `drained_ns` on; return the one configured."""
        part = self._parts[handle]
        if sampling_period_ns < 0:
            raise InvalidArgumentError(f"sampling_period_ns = {sampling_period_ns}; allowed: 0 (fastest) or more")
        period_ns = part.configured_period_ns(sampling_period_ns)
        if period_ns != self._periods_ns[handle]:
            self._periods_ns[handle] = period_ns
            active = self._active.get(handle)
            if isinstance(active, _Changes):
                active.period_ns = period_ns
            elif active is not None:
                self._begin(handle, drained_ns)
        return period_ns

    def drain(self, until_ns: int) -> dict[int, EventColumn]:
        """Return what the active sensors sampled up to `until_ns`."""
        columns = {handle: active.take(until_ns) for handle, active in self._active.items()}
        for value in self._values.values():
            value.forget_before(until_ns)
        return {
            handle: EventColumn(column.timestamp_ns, self._quantisers[handle](column.values), column.accuracy)
            for handle, column in columns.items()
            if column is not None
        }

    def next_sample_ns(self, handle: int) -> int | None:
        """Return when the next sample of a sensor is due, None if it is off or nothing changes."""
        active = self._active.get(handle)
        return None if active is None else active.next_ns

    def resume(self, at_ns: int) -> None:
        """Leave out what was sampled up to `at_ns`; what does not come by itself is told then."""
        for handle in self._active:
            self._begin(handle, at_ns)

    def _begin(self, handle: int, after_ns: int) -> None:
        part, value = self._parts[handle], self._values[handle]
        if part.mode is ReportingMode.ON_CHANGE:
            self._active[handle] = _Changes(value.at(after_ns + 1), after_ns + 1, self._periods_ns[handle])
        else:
            self._active[handle] = _Sampled(part, value, self._periods_ns[handle], after_ns, self._seed)


class _Value:
    """One value over time, as far back as anybody may still ask."""

    def __init__(self, value: float) -> None:
        self._since: list[tuple[int, float]] = [(-(2**63), value)]

    def set(self, value: float, at_ns: int) -> None:
        self._since.append((at_ns, value))

    def at(self, timestamp_ns: int) -> float:
        return next(value for since_ns, value in reversed(self._since) if since_ns <= timestamp_ns)

    def forget_before(self, timestamp_ns: int) -> None:
        while len(self._since) > 1 and self._since[1][0] <= timestamp_ns:
            del self._since[0]


class _Sampled:
    """A continuous sensor: samples on multiples of its period, later than `after_ns`."""

    def __init__(self, part: AmbientPart, value: _Value, period_ns: int, after_ns: int, seed: int) -> None:
        rate_hz = part.configured_rate_hz(period_ns)
        self._period = exact_period_ns(rate_hz)
        self._part = part
        self._value = value
        self._std = part.noise_density * math.sqrt(rate_hz)
        self._key = (seed, _NOISE_STREAM, int(part.type), self._period.numerator, self._period.denominator)
        self._sample = self._period.samples_in(after_ns) + 1
        if self._period.until(self._sample) <= after_ns:
            self._sample += 1
        self.next_ns = self._period.until(self._sample)

    def take(self, until_ns: int) -> EventColumn | None:
        stamps: list[int] = []
        readings: list[list[float]] = []
        while self.next_ns <= until_ns:
            noise = SeededRandom(*self._key, self._sample).normal((1,))[0] if self._std else 0.0
            stamps.append(self.next_ns)
            readings.append([self._digitised(self._value.at(self.next_ns) + self._std * float(noise))])
            self._sample += 1
            self.next_ns = self._period.until(self._sample)
        return EventColumn.of_rows(stamps, readings) if stamps else None

    def _digitised(self, reading: float) -> float:
        step = self._part.resolution
        return min(max(round(reading / step), 0), math.floor(self._part.max_range / step)) * step


class _Changes:
    """An on-change sensor: its value at `at_ns`, then whatever it changes to."""

    def __init__(self, value: float, at_ns: int, period_ns: int) -> None:
        self.period_ns = period_ns
        self._told: list[tuple[int, float]] = []
        """What is to be taken."""
        self._last_told: float | None = None
        self._value = value
        self._earliest_ns = at_ns
        self._due_ns: int | None = at_ns

    @property
    def next_ns(self) -> int | None:
        return self._told[0][0] if self._told else self._due_ns

    def change(self, value: float, at_ns: int) -> None:
        """Have a new value; of several within a period the last is told."""
        self._tell(at_ns - 1)
        self._value = value
        if self._due_ns is None:
            self._due_ns = max(at_ns, self._earliest_ns)

    def take(self, until_ns: int) -> EventColumn | None:
        self._tell(until_ns)
        count = bisect_right(self._told, until_ns, key=itemgetter(0))
        taken, self._told = self._told[:count], self._told[count:]
        return EventColumn.of_rows([at_ns for at_ns, _ in taken], [[value] for _, value in taken]) if taken else None

    def _tell(self, until_ns: int) -> None:
        """Have the value told if it is due by `until_ns` and another than before."""
        if self._due_ns is None or self._due_ns > until_ns:
            return
        at_ns, self._due_ns = self._due_ns, None
        if self._value != self._last_told:
            self._last_told = self._value
            self._earliest_ns = at_ns + self.period_ns
            self._told.append((at_ns, self._value))
