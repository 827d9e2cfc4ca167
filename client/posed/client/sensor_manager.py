"""SensorManager: Android's way to a phone's sensors (android.hardware.SensorManager)."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from types import TracebackType

from posed.binder.proxy import Proxy
from posed.binder.status import RemoteError
from posed.binder.stub import Caller, Stub
from posed.client.sensor import Sensor, SensorEvent, SensorEventListener, period_of_delay_us
from posed.client.service import Service, ServiceState, call_back
from posed.errors import InvalidArgumentError, ServiceUnavailableError
from posed.proto import binder_pb2, events_pb2, sensors_pb2

_log = logging.getLogger(__name__)

# Only these carry a status of their own; JNI reports every other type as high (android_hardware_SensorManager.cpp).
_TYPES_WITH_STATUS = frozenset((1, 2, 3, 4, 9, 10, 21))
_ACCURACY_HIGH = 3


@dataclass(slots=True)
class _Registration:
    sampling_period_us: int
    max_report_latency_us: int


@dataclass(slots=True)
class _Queue:
    """One listener: its callback object's name, its sensors, and the last accuracy told of each."""

    name: str
    listener: SensorEventListener
    registrations: dict[int, _Registration] = field(default_factory=dict)
    accuracies: dict[int, int] = field(default_factory=dict)
    events_dropped: int = 0


class SensorManager:
    """The sensors of a running posed. Callbacks run on a thread of the manager's own.

    The registrations survive a daemon that crashes or is restarted: they are made again at the next connection.
    """

    def __init__(
        self,
        *,
        auto_create: bool = False,
        on_service_connected: Callable[[], None] | None = None,
        on_service_disconnected: Callable[[], None] | None = None,
        on_binding_died: Callable[[str], None] | None = None,
    ) -> None:
        self._lock = threading.Lock()
        self._queues: dict[int, _Queue] = {}
        self._names = count(1)
        self._callbacks: set[str] = set()
        """Names of the callback objects of the connection, which outlive a daemon."""
        self._sensors: dict[int, Sensor] = {}
        self._service = Service(
            self,
            auto_create=auto_create,
            on_service_connected=on_service_connected,
            on_service_disconnected=on_service_disconnected,
            on_binding_died=on_binding_died,
        )
        self._service.start()

    def __enter__(self) -> "SensorManager":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def state(self) -> ServiceState:
        """Where the binding to the daemon stands."""
        return self._service.state

    @property
    def reason(self) -> str:
        """Why the binding is not connected, for people; empty when it is."""
        return self._service.reason

    def wait_connected(self, timeout_s: float = 5.0) -> None:
        """Wait until a daemon is connected.

        Raises ServiceUnavailableError with the reason after `timeout_s`, at once if the binding died or was closed.
        """
        self._service.wait_connected(timeout_s)

    def get_sensor_list(self, sensor_type: int = Sensor.TYPE_ALL) -> list[Sensor]:
        """Return the sensors of a type, the phone's own first; raises ServiceUnavailableError without a daemon."""
        self._service.wait_connected(5.0)
        sensors = list(self._sensors.values())
        return [sensor for sensor in sensors if sensor_type in (Sensor.TYPE_ALL, sensor.type)]

    def get_default_sensor(self, sensor_type: int) -> Sensor | None:
        """Return the first non-wake-up sensor of a type, None if there is none."""
        return next((s for s in self.get_sensor_list(sensor_type) if not s.is_wake_up_sensor), None)

    def register_listener(
        self,
        listener: SensorEventListener | None,
        sensor: Sensor | None,
        sampling_period_us: int,
        max_report_latency_us: int = 0,
    ) -> bool:
        """Begin events of a sensor for a listener; `sampling_period_us` is a SENSOR_DELAY code or a period in us.

        Returns False, as Android does, for a missing listener or sensor, a negative period or latency, or a sensor the
        listener already has. Raises ServiceUnavailableError if no daemon answers.
        """
        if listener is None or sensor is None:
            _log.error("register_listener needs a listener and a sensor")
            return False
        period_us = period_of_delay_us(sampling_period_us)
        if period_us < 0 or max_report_latency_us < 0:
            return False
        return self._service.run(lambda: self._register(listener, sensor, period_us, max_report_latency_us))

    def unregister_listener(self, listener: SensorEventListener | None, sensor: Sensor | None = None) -> None:
        """End events of one sensor, or of all, for a listener; what is still queued is dropped."""
        if listener is None:
            return
        with self._lock:
            queue = self._queues.get(id(listener))
            if queue is None:
                return
            handles = [sensor.handle] if sensor is not None else list(queue.registrations)
            gone = [handle for handle in handles if queue.registrations.pop(handle, None) is not None]
            if not queue.registrations:
                del self._queues[id(listener)]
        if self.state is ServiceState.CONNECTED:
            try:
                self._service.run(lambda: self._unregister(queue, gone))
            except ServiceUnavailableError as error:
                _log.debug("unregistered by the daemon's going: %s", error)

    def flush(self, listener: SensorEventListener) -> bool:
        """Ask for on_flush_completed(sensor) once for each of the listener's sensors.

        Returns False if it has none or the daemon refuses. Raises ServiceUnavailableError if no daemon answers.
        """
        if listener is None:
            raise InvalidArgumentError("flush needs a listener, not None")
        queue = self._queues.get(id(listener))
        if queue is None:
            return False
        try:
            self._service.run(lambda: self._sensor_service.flush(sensors_pb2.FlushRequest(listener=queue.name)))
        except RemoteError as error:
            _log.error("cannot flush: %s", error)
            return False
        return True

    def get_statistics(self) -> sensors_pb2.Statistics:
        """Return the daemon's counters; raises ServiceUnavailableError if no daemon answers."""
        statistics: sensors_pb2.Statistics = self._service.run(
            lambda: self._sensor_service.getStatistics(binder_pb2.Empty())
        )
        return statistics

    def close(self) -> None:
        """End all events and unbind. Never takes longer than a second."""
        self._service.close()

    # Binding, on the service thread

    def bind(self, service: Service) -> None:
        """Read the sensor list and restore the registrations."""
        self._sensor_service: Proxy
        self._sensor_service, _ = service.get_service("sensorservice", _SENSOR_SERVICE)
        found = self._sensor_service.getSensorList(binder_pb2.Empty()).sensors
        self._sensors = {message.handle: Sensor.of_message(message) for message in found}
        with self._lock:
            queues = list(self._queues.values())
        for name in self._callbacks - {queue.name for queue in queues}:
            self._remove_callback(name)
        for queue in queues:
            queue.accuracies.clear()
            for handle, registration in list(queue.registrations.items()):
                try:
                    self._enable(queue, handle, registration)
                except RemoteError as error:
                    # The daemon that returned may have another phone: what it lacks is no reason to lose the rest.
                    _log.error("sensor %d of %s is not registered any more: %s", handle, queue.name, error)
                    queue.registrations.pop(handle, None)

    def unbind(self, service: Service) -> None:
        """Nothing to undo: the daemon frees a connection's registrations when it closes."""

    def release(self, service: Service) -> None:
        """Nothing is open on this side."""

    def _register(
        self, listener: SensorEventListener, sensor: Sensor, sampling_period_us: int, max_report_latency_us: int
    ) -> bool:
        with self._lock:
            queue = self._queues.get(id(listener)) or _Queue(f"listener-{next(self._names)}", listener)
            if sensor.handle in queue.registrations:
                return False
        registration = _Registration(sampling_period_us, max_report_latency_us)
        if queue.name not in self._callbacks:
            self._service.connection.add_callback(queue.name, _Listener(self, queue))
            self._callbacks.add(queue.name)
        try:
            self._enable(queue, sensor.handle, registration)
        except RemoteError as error:
            _log.error("cannot register %s: %s", sensor.name, error)
            if not queue.registrations:
                self._remove_callback(queue.name)
            return False
        with self._lock:
            queue.registrations[sensor.handle] = registration
            self._queues[id(listener)] = queue
        return True

    def _enable(self, queue: _Queue, handle: int, registration: _Registration) -> None:
        self._sensor_service.enableSensor(
            sensors_pb2.EnableSensorRequest(
                listener=queue.name,
                handle=handle,
                sampling_period_us=registration.sampling_period_us,
                max_report_latency_us=registration.max_report_latency_us,
            )
        )

    def _unregister(self, queue: _Queue, handles: list[int]) -> None:
        for handle in handles:
            self._sensor_service.disableSensor(sensors_pb2.DisableSensorRequest(listener=queue.name, handle=handle))
        if not queue.registrations:
            self._remove_callback(queue.name)

    def _remove_callback(self, name: str) -> None:
        self._service.connection.remove_callback(name)
        self._callbacks.discard(name)

    def _dispatch(self, queue: _Queue, batch: events_pb2.SensorEvents) -> None:
        """Call the listener for each event in time order, then for the flushes behind them."""
        queue.events_dropped = batch.events_dropped
        events: list[tuple[int, int, tuple[float, ...], int]] = []
        for column in batch.columns:
            values = tuple(column.values)
            width = len(values) // max(1, len(column.timestamp_ns))
            accuracies = column.accuracy if len(column.accuracy) > 1 else (*column.accuracy,) * len(column.timestamp_ns)
            for row, (timestamp_ns, accuracy) in enumerate(zip(column.timestamp_ns, accuracies, strict=True)):
                events.append((timestamp_ns, column.handle, values[row * width : (row + 1) * width], accuracy))
        events.sort(key=lambda event: event[:2])
        for timestamp_ns, handle, values, accuracy in events:
            sensor = self._sensors.get(handle)
            # An event still on its way when its sensor was unregistered is dropped, as in Android.
            if sensor is not None and handle in queue.registrations:
                self._deliver(queue, sensor, timestamp_ns, values, accuracy)
        on_flush_completed = getattr(queue.listener, "on_flush_completed", None)
        for handle in batch.flush_completes:
            if on_flush_completed is not None and handle in self._sensors:
                call_back(on_flush_completed, self._sensors[handle])

    def _deliver(
        self, queue: _Queue, sensor: Sensor, timestamp_ns: int, values: tuple[float, ...], accuracy: int
    ) -> None:
        if sensor.type not in _TYPES_WITH_STATUS:
            accuracy = _ACCURACY_HIGH
        if accuracy >= 0 and accuracy != queue.accuracies.get(sensor.handle, 0):
            queue.accuracies[sensor.handle] = accuracy
            on_accuracy_changed = getattr(queue.listener, "on_accuracy_changed", None)
            if on_accuracy_changed is not None:
                call_back(on_accuracy_changed, sensor, accuracy)
        call_back(queue.listener.on_sensor_changed, SensorEvent(sensor, timestamp_ns, values, accuracy))


class _Listener(Stub):
    descriptor = sensors_pb2.DESCRIPTOR.services_by_name["ISensorEventListener"]

    def __init__(self, manager: SensorManager, queue: _Queue) -> None:
        self._manager = manager
        self._queue = queue

    def onSensorEvents(self, request: events_pb2.SensorEvents, caller: Caller) -> None:
        self._manager._dispatch(self._queue, request)


_SENSOR_SERVICE = sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]
