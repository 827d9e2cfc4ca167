"""Sensors that come and go while the phone runs (SystemSensorManager.updateDynamicSensorList)."""

import threading
from collections.abc import Callable

from posed.binder.proxy import Proxy
from posed.binder.stub import Caller, Stub
from posed.client.binding import call_back
from posed.client.handler import Handler
from posed.client.sensor import DynamicSensorCallback, Sensor
from posed.client.service import Service
from posed.proto import binder_pb2, sensors_pb2

_NAME = "dynamic-sensors"


class DynamicSensors(Stub):
    """The list as this client knows it, and who is told of changes. The daemon is asked once it is of interest."""

    descriptor = sensors_pb2.DESCRIPTOR.services_by_name["IDynamicSensorCallback"]

    def __init__(self, service: Service, on_gone: Callable[[int], None]) -> None:
        self._service = service
        self._on_gone = on_gone
        self._sensor_service: Proxy | None = None
        self._boot_id = b""
        self._lock = threading.Lock()
        self._callbacks: dict[int, tuple[DynamicSensorCallback, Handler | None]] = {}
        self._sensors: dict[int, Sensor] = {}
        self._is_watching = False

    # From any thread

    def sensors(self) -> list[Sensor]:
        """Return those that are there; raises ServiceUnavailableError without a daemon."""
        self._service.run(self._watch)
        return list(self._sensors.values())

    def add(self, callback: DynamicSensorCallback, handler: Handler | None) -> None:
        """Have a callback told of changes from now on; raises ServiceUnavailableError without a daemon."""
        self._service.run(self._watch)
        with self._lock:
            self._callbacks.setdefault(id(callback), (callback, handler))

    def remove(self, callback: DynamicSensorCallback | None) -> None:
        """Undo `add`."""
        with self._lock:
            self._callbacks.pop(id(callback), None)

    # On the service thread

    def restore(self, sensor_service: Proxy, boot_id: bytes) -> None:
        """Ask a daemon just connected, if the list is of interest; another daemon's sensors are others."""
        self._sensor_service = sensor_service
        if boot_id != self._boot_id:
            self._boot_id = boot_id
            self._take({})
        if self._is_watching:
            self._ask()

    def onDynamicSensorsChanged(self, request: sensors_pb2.SensorList, caller: Caller) -> None:
        self._take_list(request)

    def _watch(self) -> None:
        if not self._is_watching:
            self._service.connection.remove_callback(_NAME)  # of an earlier try
            self._service.connection.add_callback(_NAME, self)
            self._ask()
            self._is_watching = True

    def _ask(self) -> None:
        assert self._sensor_service is not None
        self._sensor_service.registerDynamicSensorCallback(sensors_pb2.DynamicSensorCallbackRequest(callback=_NAME))
        self._take_list(self._sensor_service.getDynamicSensorList(binder_pb2.Empty()))

    def _take_list(self, message: sensors_pb2.SensorList) -> None:
        sensors = {each.handle: Sensor.of_message(each) for each in message.sensors}
        for handle in self._sensors.keys() - sensors.keys():
            self._on_gone(handle)
        self._take(sensors)

    def _take(self, sensors: dict[int, Sensor]) -> None:
        before, self._sensors = self._sensors, sensors
        gone = [sensor for handle, sensor in before.items() if handle not in sensors]
        come = [sensor for handle, sensor in sensors.items() if handle not in before]
        with self._lock:
            callbacks = list(self._callbacks.values())
        for callback, handler in callbacks:
            _tell(callback, handler, gone, come)


def _tell(callback: DynamicSensorCallback, handler: Handler | None, gone: list[Sensor], come: list[Sensor]) -> None:
    def tell() -> None:
        for sensor in gone:
            _call_if_there(callback, "on_dynamic_sensor_disconnected", sensor)
        for sensor in come:
            _call_if_there(callback, "on_dynamic_sensor_connected", sensor)

    if handler is None:
        tell()
    elif gone or come:
        handler.post(tell)


def _call_if_there(callback: DynamicSensorCallback, method: str, sensor: Sensor) -> None:
    called = getattr(callback, method, None)
    if called is not None:
        call_back(called, sensor)
