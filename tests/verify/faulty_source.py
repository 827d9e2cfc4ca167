"""A sensor source in virtual time with the SDK's calls, and one fault at a time."""

import heapq
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from itertools import count
from typing import Any

from posed.client import Sensor, SensorEvent, TriggerEvent

MIN_DELAY_US, MAX_DELAY_US = 5_000, 200_000
START_NS = 1_000_000_000_000
# Registrations, counted from 1: thirteen come before those of churn, and those of moving rates behind.
_OF_CHURN = range(40, 65)


class Fault(Enum):
    """What goes wrong; of matrix points from the second second of a registration on, where it is about events."""

    NONE = auto()
    SLOW = auto()
    FAST = auto()
    FIVE_TIMES_TOO_FAST = auto()
    GAPPY = auto()
    JITTERY = auto()
    REORDERED = auto()
    STUCK_CLOCK = auto()
    LATE = auto()
    FROM_THE_FUTURE = auto()
    OTHER_CLOCK = auto()
    DIES = auto()
    FOREIGN = auto()
    WRONG_UNIT = auto()
    NOISY = auto()
    SETTLES = auto()
    BATCH_WITHHELD = auto()
    FIFO_HALVED = auto()
    MISCALIBRATED = auto()
    REGISTERS_TWICE = auto()
    TRIGGERS_ANYTHING = auto()
    FLUSH_LOST = auto()
    FLUSH_TOLD_TO_ALL = auto()
    FLUSH_OF_NOBODY = auto()
    STALE_EVENTS = auto()
    CLIENT_STARVED = auto()
    SILENT_AFTER_MANY = auto()
    REFUSES_SOME = auto()
    STALLS_BY_MOVING = auto()
    TALKS_AFTER_UNREGISTERING = auto()
    CANCELS_TWICE = auto()
    TELLS_NO_VALUE = auto()
    FORGETS_JOINERS = auto()


def a_sensor(kind: int = Sensor.TYPE_ACCELEROMETER, mode: int = Sensor.REPORTING_MODE_CONTINUOUS) -> Sensor:
    one_shot = mode == Sensor.REPORTING_MODE_ONE_SHOT
    return Sensor(
        handle=kind,
        type=kind,
        string_type=f"android.sensor.kind_{kind}",
        name=f"Sensor {kind}",
        vendor="test",
        version=1,
        maximum_range=100.0,
        resolution=0.01,
        power=1.0,
        min_delay=-1 if one_shot else MIN_DELAY_US,
        max_delay=0 if one_shot else MAX_DELAY_US,
        fifo_reserved_event_count=0,
        fifo_max_event_count=0 if one_shot else 1000,
        reporting_mode=mode,
        is_wake_up_sensor=False,
    )


class VirtualClock:
    """Time that passes only while somebody waits."""

    def __init__(self) -> None:
        self._now_ns = START_NS
        self._actions: list[tuple[int, int, Callable[[], None]]] = []
        self._order = count()

    def now_ns(self) -> int:
        return self._now_ns

    def at(self, instant_ns: int, action: Callable[[], None]) -> None:
        heapq.heappush(self._actions, (instant_ns, next(self._order), action))

    def wait(self, timeout_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        end_ns = self._now_ns + round(timeout_s * 1e9)
        while not until():
            if not self._actions or self._actions[0][0] > end_ns:
                self._now_ns = end_ns
                return until()
            self._now_ns, _, action = heapq.heappop(self._actions)
            action()
        return True


@dataclass
class _Registration:
    listener: Any
    sensor: Sensor
    period_us: int
    latency_us: int
    begun_ns: int
    samples: int = 0
    batch: list[SensorEvent] = field(default_factory=list)
    active: bool = True


class FaultySource:
    """Samples each sensor on a grid of the period in force; a faultless one passes every verification."""

    def __init__(self, clock: VirtualClock, fault: Fault = Fault.NONE, sensors: tuple[Sensor, ...] = ()) -> None:
        self._clock = clock
        self._fault = fault
        self._sensors = sensors or (a_sensor(),)
        self._registrations: list[_Registration] = []
        self._triggers: list[tuple[Any, Sensor]] = []
        self._times_registered = 0
        self._last_event: SensorEvent | None = None
        self._rng = random.Random(0)
        self._running: set[int] = set()

    def get_sensor_list(self) -> list[Sensor]:
        return list(self._sensors)

    def register_listener(
        self, listener: Any, sensor: Any, sampling_period_us: int, max_report_latency_us: int = 0
    ) -> bool:
        if sensor.reporting_mode == Sensor.REPORTING_MODE_ONE_SHOT:
            return False
        self._times_registered += 1
        if self._fault is Fault.REFUSES_SOME and self._times_registered == 30:
            return False
        if any(r.listener is listener and r.sensor == sensor for r in self._registrations):
            return self._fault is Fault.REGISTERS_TWICE
        period_us = min(max(sampling_period_us, MIN_DELAY_US), MAX_DELAY_US)
        made = _Registration(listener, sensor, period_us, max_report_latency_us, self._clock.now_ns())
        self._registrations.append(made)
        if self._fault is Fault.STALE_EVENTS and self._last_event is not None:
            stale = self._last_event
            self._clock.at(self._clock.now_ns(), lambda: self._hand(made, [stale]))
        if sensor.reporting_mode == Sensor.REPORTING_MODE_ON_CHANGE:
            self._tell_value(made)
        elif sensor.handle not in self._running:
            self._running.add(sensor.handle)
            self._sample_later(sensor)
        if max_report_latency_us:
            self._batch_later(made)
        return True

    def unregister_listener(self, listener: Any, sensor: Any = None) -> None:
        for registration in list(self._registrations):
            if registration.listener is listener:
                self._registrations.remove(registration)
                registration.active = self._fault is Fault.TALKS_AFTER_UNREGISTERING
                if registration.active and self._last_event is not None:
                    event = self._last_event
                    self._clock.at(self._clock.now_ns() + 1_000_000, lambda r=registration, e=event: self._hand(r, [e]))

    def flush(self, listener: Any) -> bool:
        own = [r for r in self._registrations if r.listener is listener]
        if not own:
            if self._fault is Fault.FLUSH_OF_NOBODY:
                listener.on_flush_completed(self._sensors[0])
            return self._fault is Fault.FLUSH_OF_NOBODY
        told = self._registrations if self._fault is Fault.FLUSH_TOLD_TO_ALL else own
        for registration in told:
            self._hand(registration, registration.batch)
            if self._fault is not Fault.FLUSH_LOST:
                self._clock.at(self._clock.now_ns(), lambda r=registration: r.listener.on_flush_completed(r.sensor))
        return True

    def request_trigger_sensor(self, listener: Any, sensor: Any) -> bool:
        if sensor.reporting_mode != Sensor.REPORTING_MODE_ONE_SHOT:
            return self._fault is Fault.TRIGGERS_ANYTHING
        self._triggers.append((listener, sensor))
        return True

    def cancel_trigger_sensor(self, listener: Any, sensor: Any = None) -> bool:
        if (listener, sensor) in self._triggers:
            self._triggers.remove((listener, sensor))
            return True
        return self._fault is Fault.CANCELS_TWICE

    def fire(self) -> None:
        """Have the one-shot sensor fire."""
        for listener, sensor in self._triggers:
            listener.on_trigger(TriggerEvent(sensor, self._clock.now_ns(), (1.0,)))
        self._triggers.clear()

    def _tell_value(self, made: _Registration) -> None:
        begun_ns = [r.begun_ns for r in self._registrations if r.sensor == made.sensor]
        forgotten = self._fault is Fault.FORGETS_JOINERS and len(begun_ns) > 1
        if not forgotten and self._fault is not Fault.TELLS_NO_VALUE:
            event = SensorEvent(made.sensor, begun_ns[0], (300.0,), 3)
            self._clock.at(self._clock.now_ns(), lambda: self._hand(made, [event]))

    def _sample_later(self, sensor: Sensor) -> None:
        own = [r for r in self._registrations if r.sensor == sensor]
        if not own:
            self._running.discard(sensor.handle)
            return
        scale = {Fault.SLOW: 1.25, Fault.FAST: 0.4, Fault.FIVE_TIMES_TOO_FAST: 0.2}.get(self._fault, 1.0)
        period_ns = round(min(r.period_us for r in own) * 1000 * scale)

        def sample() -> None:
            self._deliver(sensor, period_ns)
            self._sample_later(sensor)

        self._clock.at(self._clock.now_ns() + period_ns, sample)

    def _deliver(self, sensor: Sensor, period_ns: int) -> None:
        now_ns = self._clock.now_ns()
        for registration in [r for r in self._registrations if r.sensor == sensor]:
            starved = self._fault is Fault.CLIENT_STARVED and registration.period_us > 100_000
            silent = self._fault is Fault.SILENT_AFTER_MANY and self._times_registered in _OF_CHURN
            moving = self._times_registered > _OF_CHURN.stop and len(self._registrations) > 1
            stalled = self._fault is Fault.STALLS_BY_MOVING and moving
            if (starved and registration.samples % 2) or silent or stalled:
                registration.samples += 1
                continue
            event = self._event(registration, sensor, now_ns, period_ns)
            registration.samples += 1
            if event is None:
                continue
            self._last_event = event
            if registration.latency_us:
                registration.batch.append(event)
                fifo = sensor.fifo_max_event_count // (2 if self._fault is Fault.FIFO_HALVED else 1)
                if len(registration.batch) >= fifo:
                    self._hand(registration, registration.batch)
            elif self._fault is Fault.LATE and now_ns - registration.begun_ns > 3_000_000_000:
                self._clock.at(now_ns + 800_000_000, lambda r=registration, e=event: self._hand(r, [e]))
            else:
                self._hand(registration, [event])

    def _event(self, registration: _Registration, sensor: Sensor, time_ns: int, period_ns: int) -> SensorEvent | None:
        n = registration.samples
        values: tuple[float, ...] = (0.0, 0.0, 9.81)
        match self._fault:
            case Fault.GAPPY if n % 44 == 8:
                return None
            case Fault.DIES if time_ns - registration.begun_ns > 1_000_000_000:
                return None
            case Fault.JITTERY:
                time_ns += round(self._rng.uniform(-0.3, 0.0) * period_ns)
            case Fault.REORDERED if n % 100 == 50:
                time_ns -= round(1.3 * period_ns)
            case Fault.STUCK_CLOCK if n % 100 == 50:
                time_ns -= period_ns
            case Fault.FROM_THE_FUTURE if n >= 50:
                time_ns += 2 * period_ns
            case Fault.OTHER_CLOCK:
                time_ns -= 900_000_000_000
            case Fault.FOREIGN if n == 5:
                sensor = a_sensor(Sensor.TYPE_PRESSURE)
            case Fault.WRONG_UNIT:
                values = (0.0, 0.0, 1.0)
            case Fault.NOISY:
                values = (self._rng.gauss(0, 1.4), 0.0, 9.81)
            case Fault.MISCALIBRATED if sensor.type == Sensor.TYPE_GYROSCOPE:
                values = (0.0, 0.02, 0.01)
            case _ if sensor.type == Sensor.TYPE_GYROSCOPE:
                values = (0.0, 0.0, 0.01)
            case _ if sensor.type == Sensor.TYPE_ROTATION_VECTOR:
                values = (0.0, 0.0, 0.0, 1.0)
            case _ if sensor.type == Sensor.TYPE_PRESSURE:
                values = (1013.0 + (4.0 if self._fault is Fault.SETTLES and n < 200 else 0.0),)
            case _ if sensor.type == Sensor.TYPE_GYROSCOPE_UNCALIBRATED:
                values = (0.1, 0.2, 0.31, 0.1, 0.2, 0.3)
        return SensorEvent(sensor, time_ns, values, 3)

    def _batch_later(self, registration: _Registration) -> None:
        latency_ns = registration.latency_us * 1000
        if self._fault is Fault.BATCH_WITHHELD:
            latency_ns += 6_000_000_000

        def release() -> None:
            if registration in self._registrations:
                self._hand(registration, registration.batch)
                self._batch_later(registration)

        self._clock.at(self._clock.now_ns() + latency_ns, release)

    def _hand(self, registration: _Registration, events: list[SensorEvent]) -> None:
        handed = list(events)
        events.clear()
        if registration.active:
            for event in handed:
                registration.listener.on_sensor_changed(event)
