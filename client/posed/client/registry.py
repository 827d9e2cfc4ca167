"""Which listener has which sensor, here and in the daemon (SystemSensorManager's maps of queues)."""

import logging
import threading
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import count
from typing import TypeVar

from posed.binder.proxy import Proxy
from posed.binder.status import RemoteError, TransactionTimeoutError
from posed.client.binding import ServiceState
from posed.client.event_queue import EventQueue, Registration, SensorEventQueue, TriggerEventQueue
from posed.client.handler import Handler
from posed.client.sensor import Sensor, SensorEventListener, TriggerEventListener
from posed.client.service import Service
from posed.errors import InvalidStateError
from posed.proto import sensors_pb2

_log = logging.getLogger(__name__)
_Queue = TypeVar("_Queue", bound=EventQueue)

MAX_LISTENER_COUNT = 128
"""Listeners of each kind that a manager takes (SystemSensorManager.MAX_LISTENER_COUNT)."""


class ListenerRegistry:
    """The queues of a manager's listeners. The calls it makes run on the service's thread."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._sensor_service: Proxy | None = None
        self._lock = threading.Lock()
        self._queues: dict[int, SensorEventQueue] = {}
        self._triggers: dict[int, TriggerEventQueue] = {}
        self._names = count(1)
        self._callbacks: set[str] = set()
        """Names of the callback objects of the connection, which outlive a daemon."""

    # From any thread

    def register(self, listener: SensorEventListener, registration: Registration, handler: Handler | None) -> bool:
        """Give a listener a sensor; False if it has it or the daemon refuses."""
        self._check_count(self._queues)

        def register() -> bool:
            with self._lock:
                queue = self._queues.get(id(listener))
                if queue is None:
                    queue = SensorEventQueue(f"listener-{next(self._names)}", handler, listener)
            if not self._add_sensor(queue, registration):
                return False
            with self._lock:
                self._queues[id(listener)] = queue
            return True

        return self._service.run(register)

    def unregister(self, listener: SensorEventListener, sensor: Sensor | None) -> None:
        """Take one sensor, or all, from a listener."""
        self._remove(self._queues, listener, sensor)

    def flush(self, listener: SensorEventListener) -> bool:
        """Flush a listener's sensors; False if it has none or the daemon refuses."""
        queue = self._queues.get(id(listener))
        if queue is None:
            return False
        try:
            self._service.run(lambda: self._proxy.flush(sensors_pb2.FlushRequest(listener=queue.name)))
        except RemoteError as error:
            _log.error("cannot flush: %s", error)
            return False
        return True

    def request_trigger(self, listener: TriggerEventListener, registration: Registration) -> bool:
        """Have a listener wait for a one-shot sensor; False if it does or the daemon refuses."""
        self._check_count(self._triggers)

        def request() -> bool:
            with self._lock:
                queue = self._triggers.get(id(listener))
                if queue is None:
                    queue = TriggerEventQueue(f"trigger-{next(self._names)}", listener, self._fired)
            if not self._add_sensor(queue, registration):
                return False
            with self._lock:
                self._triggers[id(listener)] = queue
            return True

        return self._service.run(request)

    def cancel_trigger(self, listener: TriggerEventListener | None, sensor: Sensor | None) -> bool:
        """Take a listener's pending requests back, of one sensor or of all; False if there was none."""
        return self._remove(self._triggers, listener, sensor)

    def events_dropped(self, listener: SensorEventListener) -> int:
        """Return how many events were dropped because the listener was too slow; 0 for one that has no sensor."""
        queue = self._queues.get(id(listener))
        return 0 if queue is None else queue.events_dropped

    def clear(self) -> None:
        """End every registration on this side: of what has arrived no listener is told any more."""
        with self._lock:
            for queue in (*self._queues.values(), *self._triggers.values()):
                queue.registrations.clear()

    # On the service thread

    def restore(self, sensor_service: Proxy, sensors: Mapping[int, Sensor]) -> None:
        """Make the registrations anew at a daemon just connected."""
        self._sensor_service = sensor_service
        with self._lock:
            queues: list[EventQueue] = [*self._queues.values(), *self._triggers.values()]
        for name in self._callbacks - {queue.name for queue in queues}:
            self._remove_callback(name)
        for queue in queues:
            queue.accuracies.clear()
            for handle, registration in list(queue.registrations.items()):
                try:
                    # A daemon that was slow to answer may have it: it would refuse it, and stand by its old periods.
                    self._disable_sensor(queue, handle)
                    self._enable_or_stream(queue, registration)
                except RemoteError as error:
                    # The daemon that returned may have another phone: what it lacks is no reason to lose the rest.
                    _log.error("sensor %d of %s is not registered any more: %s", handle, queue.name, error)
                    queue.registrations.pop(handle, None)

    def drop(self, handle: int) -> None:
        """Take a dynamic sensor that is gone from every listener: in the daemon it has ended already."""
        self._drop(self._queues, handle)
        self._drop(self._triggers, handle)

    # Private

    @property
    def _proxy(self) -> Proxy:
        assert self._sensor_service is not None, "nothing runs on the service thread before the first bind"
        return self._sensor_service

    def _check_count(self, queues: Mapping[int, EventQueue]) -> None:
        if len(queues) >= MAX_LISTENER_COUNT:
            raise InvalidStateError(
                f"register failed, the sensor listeners size has exceeded the maximum limit {MAX_LISTENER_COUNT}:"
                " unregister those no longer needed"
            )

    def _add_sensor(self, queue: EventQueue, registration: Registration) -> bool:
        sensor = registration.sensor
        if sensor.handle in queue.registrations:
            return False
        if queue.name not in self._callbacks:
            self._service.connection.add_callback(queue.name, queue)
            self._callbacks.add(queue.name)
        try:
            self._enable_or_stream(queue, registration)
        except RemoteError as error:
            _log.error("cannot register %s: %s", sensor.name, error)
            return False
        except TransactionTimeoutError:
            # The daemon may yet carry it out, and after it this one, which nobody waits for.
            with suppress(TransactionTimeoutError):
                self._disable_sensor(queue, sensor.handle, timeout_s=0.0)
            raise
        else:
            queue.registrations[sensor.handle] = registration
            return True
        finally:
            if not queue.registrations:
                self._remove_callback(queue.name)

    def _enable_or_stream(self, queue: EventQueue, registration: Registration) -> None:
        """Enable a sensor, without a latency if it fails with one (BaseEventQueue.addSensor)."""
        try:
            self._enable(queue, registration)
        except RemoteError:
            if not registration.max_report_latency_us:
                raise
            streaming = Registration(registration.sensor, registration.sampling_period_us, 0, registration.decimate)
            self._enable(queue, streaming)

    def _enable(self, queue: EventQueue, registration: Registration) -> None:
        self._proxy.enableSensor(
            sensors_pb2.EnableSensorRequest(
                listener=queue.name,
                handle=registration.sensor.handle,
                sampling_period_us=registration.sampling_period_us,
                max_report_latency_us=registration.max_report_latency_us,
                decimate=registration.decimate,
            )
        )

    def _disable_sensor(self, queue: EventQueue, handle: int, timeout_s: float | None = None) -> None:
        """Undo `_enable`; a sensor that the daemon does not know of is no error."""
        request = sensors_pb2.DisableSensorRequest(listener=queue.name, handle=handle)
        self._proxy.disableSensor(request, timeout_s=timeout_s)

    def _remove(self, queues: dict[int, _Queue], listener: object, sensor: Sensor | None) -> bool:
        with self._lock:
            queue = queues.get(id(listener))
            if queue is None:
                return False
            handles = list(queue.registrations) if sensor is None else [sensor.handle]
            gone = [handle for handle in handles if queue.registrations.pop(handle, None) is not None]
            if not queue.registrations:
                del queues[id(listener)]
        if gone and self._service.state is ServiceState.CONNECTED:
            self._service.run(lambda: self._disable(queue, gone))
        elif gone and self._service.state is not ServiceState.CLOSED:
            # It may be being restored at this moment.
            self._service.post(lambda: self._disable(queue, gone))
        return bool(gone)

    def _disable(self, queue: EventQueue, handles: Iterable[int]) -> None:
        for handle in handles:
            if handle not in queue.registrations:  # nor asked for again since
                self._disable_sensor(queue, handle)
        if not queue.registrations:
            self._remove_callback(queue.name)

    def _drop(self, queues: dict[int, _Queue], handle: int) -> None:
        with self._lock:
            for key, queue in list(queues.items()):
                if queue.registrations.pop(handle, None) is not None and not queue.registrations:
                    del queues[key]
                    self._remove_callback(queue.name)

    def _fired(self, queue: TriggerEventQueue, handle: int) -> None:
        """End a request whose sensor has fired: in the daemon it has ended already."""
        with self._lock:
            queue.registrations.pop(handle, None)
            if queue.registrations or self._triggers.get(id(queue.listener)) is not queue:
                return
            del self._triggers[id(queue.listener)]
        self._remove_callback(queue.name)

    def _remove_callback(self, name: str) -> None:
        self._service.connection.remove_callback(name)
        self._callbacks.discard(name)
