"""One listener's queue: from the daemon's messages to its callbacks (SystemSensorManager's BaseEventQueue)."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from posed.binder.stub import Caller, Stub
from posed.client.binding import call_back
from posed.client.handler import Handler
from posed.client.sensor import (
    SENSOR_STATUS_ACCURACY_HIGH,
    Sensor,
    SensorEvent,
    SensorEventListener,
    TriggerEvent,
    TriggerEventListener,
)
from posed.proto import events_pb2, sensors_pb2

# Only these carry a status of their own; JNI reports every other type as high (android_hardware_SensorManager.cpp).
_TYPES_WITH_STATUS = frozenset((1, 2, 3, 4, 9, 10, 21))
# What a handler that nobody pumps can make a process hold: half a minute of a phone's raw sensors.
_BACKLOG = 10_000


@dataclass(frozen=True, slots=True)
class Registration:
    """One sensor of a queue, and what was asked of the daemon for it."""

    sensor: Sensor
    sampling_period_us: int
    max_report_latency_us: int
    decimate: bool = False


class _Arrival(NamedTuple):
    """One event, or with no values a flush-complete."""

    handle: int
    timestamp_ns: int
    values: tuple[float, ...] | None
    accuracy: int


class EventQueue(Stub):
    """The callback object of one listener, and the sensors it has.

    The daemon's messages come in on the binding's thread; they are dispatched there, or by the handler.
    """

    descriptor = sensors_pb2.DESCRIPTOR.services_by_name["ISensorEventListener"]

    def __init__(self, name: str, handler: Handler | None) -> None:
        self.name = name
        self.registrations: dict[int, Registration] = {}
        self.accuracies: dict[int, int] = {}
        self._handler = handler
        self._lock = threading.Lock()
        self._arrivals: deque[_Arrival] = deque()
        self._events_waiting = 0
        self._spared: deque[_Arrival] = deque()
        """Flush-completes that stood before events dropped."""
        self._dropped_by_daemon = 0
        self._dropped_here = 0

    @property
    def events_dropped(self) -> int:
        """Events that the daemon or this queue dropped, oldest first, because the listener was too slow."""
        return self._dropped_by_daemon + self._dropped_here

    def onSensorEvents(self, request: events_pb2.SensorEvents, caller: Caller) -> None:
        self._dropped_by_daemon = request.events_dropped
        arrivals = list(_arrivals(request))
        if self._handler is None:
            for arrival in arrivals:
                self._dispatch(arrival)
            return
        with self._lock:
            waited = len(self._arrivals) + len(self._spared)
            self._arrivals.extend(arrivals)
            self._events_waiting += len(arrivals) - len(request.flush_completes)
            while self._events_waiting > _BACKLOG:
                oldest = self._arrivals.popleft()
                if oldest.values is None:
                    self._spared.append(oldest)
                else:
                    self._events_waiting -= 1
                    self._dropped_here += 1
            waiting = len(self._arrivals) + len(self._spared)
        # One each: then the handler may quit after any of them, and one that raises costs none of the others.
        for _ in range(waiting - waited):
            self._handler.post(self._dispatch_next)

    def take_event(self, registration: Registration, arrival: _Arrival) -> None:
        """Call the listener for an event of a sensor it has."""
        raise NotImplementedError

    def take_flush_complete(self, sensor: Sensor) -> None:
        """Call the listener for a flush-complete."""

    def _dispatch_next(self) -> None:
        if (arrival := self._next_waiting()) is not None:
            self._dispatch(arrival)

    def _next_waiting(self) -> _Arrival | None:
        with self._lock:
            if self._spared:
                return self._spared.popleft()
            if not self._arrivals:
                return None
            arrival = self._arrivals.popleft()
            self._events_waiting -= arrival.values is not None
            return arrival

    def _dispatch(self, arrival: _Arrival) -> None:
        registration = self.registrations.get(arrival.handle)
        if registration is None:
            return  # still on its way when its sensor was unregistered: dropped, as in Android
        if arrival.values is None:
            self.take_flush_complete(registration.sensor)
        else:
            self.take_event(registration, arrival)


class SensorEventQueue(EventQueue):
    """The queue of a SensorEventListener."""

    def __init__(self, name: str, handler: Handler | None, listener: SensorEventListener) -> None:
        super().__init__(name, handler)
        self.listener = listener

    def take_event(self, registration: Registration, arrival: _Arrival) -> None:
        sensor, accuracy = registration.sensor, arrival.accuracy
        if sensor.type not in _TYPES_WITH_STATUS:
            accuracy = SENSOR_STATUS_ACCURACY_HIGH
        if accuracy >= 0 and accuracy != self.accuracies.get(sensor.handle, 0):
            self.accuracies[sensor.handle] = accuracy
            on_accuracy_changed = getattr(self.listener, "on_accuracy_changed", None)
            if on_accuracy_changed is not None:
                call_back(on_accuracy_changed, sensor, accuracy)
        assert arrival.values is not None
        call_back(self.listener.on_sensor_changed, SensorEvent(sensor, arrival.timestamp_ns, arrival.values, accuracy))

    def take_flush_complete(self, sensor: Sensor) -> None:
        on_flush_completed = getattr(self.listener, "on_flush_completed", None)
        if on_flush_completed is not None:
            call_back(on_flush_completed, sensor)


class TriggerEventQueue(EventQueue):
    """The queue of a TriggerEventListener. Its requests end with their event, before the listener hears of it."""

    def __init__(
        self, name: str, listener: TriggerEventListener, on_fired: Callable[["TriggerEventQueue", int], None]
    ) -> None:
        super().__init__(name, None)
        self.listener = listener
        self._on_fired = on_fired

    def take_event(self, registration: Registration, arrival: _Arrival) -> None:
        self._on_fired(self, arrival.handle)
        assert arrival.values is not None
        call_back(self.listener.on_trigger, TriggerEvent(registration.sensor, arrival.timestamp_ns, arrival.values))


def _arrivals(batch: events_pb2.SensorEvents) -> Iterator[_Arrival]:
    """Yield the events of a message in time order, then the flush-completes behind them."""
    events: list[_Arrival] = []
    for column in batch.columns:
        times, values = column.timestamp_ns, tuple(column.values)
        width = len(values) // max(1, len(times))
        accuracies = column.accuracy if len(column.accuracy) > 1 else (*column.accuracy,) * len(times)
        for row, (timestamp_ns, accuracy) in enumerate(zip(times, accuracies, strict=True)):
            events.append(_Arrival(column.handle, timestamp_ns, values[row * width : (row + 1) * width], accuracy))
    if len(batch.columns) > 1:
        events.sort(key=lambda event: (event.timestamp_ns, event.handle))
    yield from events
    for handle in batch.flush_completes:
        yield _Arrival(handle, 0, None, 0)
