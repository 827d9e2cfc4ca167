"""SensorManager: Android's way to a phone's sensors (android.hardware.SensorManager)."""

import logging
from collections.abc import Callable
from types import TracebackType
from weakref import WeakSet

from posed.binder.proxy import Proxy
from posed.client.binding import ServiceState
from posed.client.dynamic_sensors import DynamicSensors
from posed.client.event_queue import Registration
from posed.client.event_stream import EventStream
from posed.client.handler import Handler
from posed.client.package import Package
from posed.client.registry import ListenerRegistry
from posed.client.rotation import SensorMaths
from posed.client.sensor import (
    DynamicSensorCallback,
    Sensor,
    SensorEventListener,
    TriggerEventListener,
    check_us,
    period_of_delay_us,
)
from posed.client.service import Service
from posed.errors import InvalidArgumentError, PermissionDeniedError, ServiceUnavailableError
from posed.proto import binder_pb2, sensors_pb2

_log = logging.getLogger(__name__)

# Those whose default sensor is the one that wakes the phone (SensorManager.getDefaultSensor).
_WAKE_UP_BY_DEFAULT = frozenset(
    (
        Sensor.TYPE_PROXIMITY,
        Sensor.TYPE_SIGNIFICANT_MOTION,
        Sensor.TYPE_TILT_DETECTOR,
        Sensor.TYPE_WAKE_GESTURE,
        Sensor.TYPE_GLANCE_GESTURE,
        Sensor.TYPE_PICK_UP_GESTURE,
        Sensor.TYPE_WRIST_TILT_GESTURE,
        Sensor.TYPE_DYNAMIC_SENSOR_META,
        Sensor.TYPE_HINGE_ANGLE,
    )
)
_RATE_CAPPED = frozenset(
    (
        Sensor.TYPE_ACCELEROMETER,
        Sensor.TYPE_MAGNETIC_FIELD,
        Sensor.TYPE_GYROSCOPE,
        Sensor.TYPE_ACCELEROMETER_UNCALIBRATED,
        Sensor.TYPE_MAGNETIC_FIELD_UNCALIBRATED,
        Sensor.TYPE_GYROSCOPE_UNCALIBRATED,
    )
)
_CAPPED_PERIOD_US = 5_000


class SensorManager(SensorMaths):
    """The sensors of a running posed. Callbacks run on a thread of the manager's own, or on a Handler's.

    The registrations survive a daemon that crashes or is restarted: they are made again at the next connection.
    """

    def __init__(
        self,
        *,
        auto_create: bool = False,
        package: Package | None = None,
        on_service_connected: Callable[[], None] | None = None,
        on_service_disconnected: Callable[[], None] | None = None,
        on_binding_died: Callable[[str], None] | None = None,
    ) -> None:
        """Bind to the daemon; auto_create starts one if need be. package: what this program says of itself."""
        self._sensors: dict[int, Sensor] = {}
        self._streams: WeakSet[EventStream] = WeakSet()
        self._service = Service(
            self,
            auto_create=auto_create,
            package=package,
            on_service_connected=on_service_connected,
            on_service_disconnected=on_service_disconnected,
            on_binding_died=on_binding_died,
        )
        self._registry = ListenerRegistry(self._service)
        self._dynamic = DynamicSensors(self._service, self._registry.drop)
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

    # Which sensors there are

    def get_sensor_list(self, sensor_type: int = Sensor.TYPE_ALL) -> list[Sensor]:
        """Return the static sensors of a type, the phone's own first.

        Raises ServiceUnavailableError without a daemon.
        """
        self._service.wait_connected(5.0)
        sensors = list(self._sensors.values())
        return [sensor for sensor in sensors if sensor_type in (Sensor.TYPE_ALL, sensor.type)]

    def get_default_sensor(self, sensor_type: int, wake_up: bool | None = None) -> Sensor | None:
        """Return the first sensor of a type, None if there is none.

        wake_up: whether it is to be one that wakes the phone; by default as Android has it for the type: so for
        proximity, significant motion, tilt, the gestures and the hinge, not for the others.
        """
        if wake_up is None:
            wake_up = sensor_type in _WAKE_UP_BY_DEFAULT
        return next((s for s in self.get_sensor_list(sensor_type) if s.is_wake_up_sensor is wake_up), None)

    def get_dynamic_sensor_list(self, sensor_type: int = Sensor.TYPE_ALL) -> list[Sensor]:
        """Return the dynamic sensors of a type that are there; raises ServiceUnavailableError without a daemon."""
        sensors = self._dynamic.sensors()
        return [sensor for sensor in sensors if sensor_type in (Sensor.TYPE_ALL, sensor.type)]

    def register_dynamic_sensor_callback(
        self, callback: DynamicSensorCallback | None, handler: Handler | None = None
    ) -> None:
        """Have `callback` told of dynamic sensors that come or go from now on; a second time changes nothing.

        Raises InvalidArgumentError without a callback, ServiceUnavailableError if no daemon answers.
        """
        if callback is None:
            raise InvalidArgumentError("register_dynamic_sensor_callback needs a callback, not None")
        self._dynamic.add(callback, handler)

    def unregister_dynamic_sensor_callback(self, callback: DynamicSensorCallback | None) -> None:
        """Undo register_dynamic_sensor_callback; one that is not registered, or None, is left alone."""
        self._dynamic.remove(callback)

    # Events

    def register_listener(
        self,
        listener: SensorEventListener | None,
        sensor: Sensor | None,
        sampling_period_us: int,
        max_report_latency_us: int = 0,
        *,
        handler: Handler | None = None,
        decimate: bool = False,
    ) -> bool:
        """Begin events of a sensor for a listener; `sampling_period_us` is a SENSOR_DELAY code or a period in us.

        handler: where the callbacks run, on a thread of the manager's own by default; what a listener's first
        registration says holds for all. decimate: have no more than the period asked delivered, whatever other
        listeners ask; an extension of posed's, for Android delivers to all what the fastest asks.

        Returns False, as Android does, for a missing listener or sensor, a one-shot sensor, a negative period or
        latency, or a sensor the listener already has, whose rate is not changed by it. Raises InvalidArgumentError for
        a period or latency that no int of 32 or 64 bits holds, InvalidStateError beyond 128 listeners,
        PermissionDeniedError for a debuggable package that asks for more than 200 Hz and may not have it,
        ServiceUnavailableError if no daemon answers.
        """
        if listener is None or sensor is None:
            _log.error("register_listener needs a listener and a sensor")
            return False
        if sensor.reporting_mode == Sensor.REPORTING_MODE_ONE_SHOT:
            _log.error("%s is a one-shot sensor: use request_trigger_sensor", sensor.name)
            return False
        period_us = period_of_delay_us(sampling_period_us)
        if period_us < 0 or check_us(max_report_latency_us, 64) < 0:
            _log.error("sampling period %d us and latency %d us must not be negative", period_us, max_report_latency_us)
            return False
        self._check_rate(sensor, period_us)
        registration = Registration(sensor, period_us, max_report_latency_us, decimate)
        return self._registry.register(listener, registration, handler)

    def unregister_listener(self, listener: SensorEventListener | None, sensor: Sensor | None = None) -> None:
        """End events of one sensor, or of all, for a listener; what is still queued is dropped.

        A one-shot sensor is left alone: use cancel_trigger_sensor.
        """
        if listener is None or (sensor is not None and sensor.reporting_mode == Sensor.REPORTING_MODE_ONE_SHOT):
            return
        try:
            self._registry.unregister(listener, sensor)
        except ServiceUnavailableError as error:
            _log.debug("unregistered by the daemon's going: %s", error)

    def flush(self, listener: SensorEventListener | None) -> bool:
        """Ask for on_flush_completed(sensor) once for each of the listener's sensors.

        Returns False if it has none or one of them cannot be flushed. Raises InvalidArgumentError without a listener,
        ServiceUnavailableError if no daemon answers.
        """
        if listener is None:
            raise InvalidArgumentError("flush needs a listener, not None")
        return self._registry.flush(listener)

    def request_trigger_sensor(self, listener: TriggerEventListener | None, sensor: Sensor | None) -> bool:
        """Have `listener.on_trigger` called once, when a one-shot sensor fires; the request is over before the call.

        Returns False if the sensor is not one-shot, or the listener waits for it already. Raises InvalidArgumentError
        without a listener or sensor, InvalidStateError beyond 128 listeners, ServiceUnavailableError if no daemon
        answers.
        """
        if listener is None or sensor is None:
            raise InvalidArgumentError("request_trigger_sensor needs a listener and a sensor, not None")
        if sensor.reporting_mode != Sensor.REPORTING_MODE_ONE_SHOT:
            return False
        return self._registry.request_trigger(listener, Registration(sensor, 0, 0))

    def cancel_trigger_sensor(self, listener: TriggerEventListener | None, sensor: Sensor | None = None) -> bool:
        """Undo request_trigger_sensor for one sensor, or for all; True if a pending request was removed."""
        if sensor is not None and sensor.reporting_mode != Sensor.REPORTING_MODE_ONE_SHOT:
            return False
        try:
            return self._registry.cancel_trigger(listener, sensor)
        except ServiceUnavailableError as error:
            _log.debug("cancelled by the daemon's going: %s", error)
            return True

    def stream(
        self,
        sensor: Sensor | None,
        sampling_period_us: int,
        max_report_latency_us: int = 0,
        *,
        decimate: bool = False,
    ) -> EventStream:
        """Return events of a sensor to iterate over with `for` or `async for`; parameters as register_listener's.

        Raises InvalidArgumentError if the sensor is None or what is asked is refused.
        """
        stream = EventStream(self)
        if not self.register_listener(stream, sensor, sampling_period_us, max_report_latency_us, decimate=decimate):
            raise InvalidArgumentError(
                f"no events of {sensor.name if sensor else 'no sensor'} every {sampling_period_us} us with a latency of"
                f" {max_report_latency_us} us: the phone may lack it, or it is a one-shot sensor"
            )
        self._streams.add(stream)
        return stream

    def get_events_dropped(self, listener: SensorEventListener) -> int:
        """Return how many events were dropped, oldest first, because the listener was too slow. Not in Android."""
        return self._registry.events_dropped(listener)

    # The daemon

    def get_statistics(self) -> sensors_pb2.Statistics:
        """Return the daemon's counters; raises ServiceUnavailableError if no daemon answers."""
        statistics: sensors_pb2.Statistics = self._service.run(
            lambda: self._sensor_service.getStatistics(binder_pb2.Empty())
        )
        return statistics

    def close(self) -> None:
        """End all events and unbind. Never takes longer than a second."""
        self._registry.clear()
        self._service.close()
        for stream in list(self._streams):
            stream.end()

    # Binding, on the service thread

    def bind(self, service: Service) -> None:
        """Read the sensor lists and restore the registrations."""
        self._sensor_service: Proxy
        self._sensor_service, boot_id = service.get_service("sensorservice", _SENSOR_SERVICE)
        found = self._sensor_service.getSensorList(binder_pb2.Empty()).sensors
        self._sensors = {message.handle: Sensor.of_message(message) for message in found}
        self._registry.restore(self._sensor_service, self._sensors)
        self._dynamic.restore(self._sensor_service, boot_id)

    def unbind(self, service: Service) -> None:
        """Nothing to undo: the daemon frees a connection's registrations when it closes."""

    def release(self, service: Service) -> None:
        """Nothing is open on this side."""

    def _check_rate(self, sensor: Sensor, sampling_period_us: int) -> None:
        package = self._service.package
        if (
            package.debuggable
            and package.is_rate_capped
            and sampling_period_us < _CAPPED_PERIOD_US
            and sensor.type in _RATE_CAPPED
        ):
            raise PermissionDeniedError(
                f"To use the sampling rate of {sampling_period_us} microseconds, app needs to declare the normal"
                " permission HIGH_SAMPLING_RATE_SENSORS: give the SensorManager a Package with it"
            )


_SENSOR_SERVICE = sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]
