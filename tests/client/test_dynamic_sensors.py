"""The list of dynamic sensors as a client knows it."""

from collections.abc import Callable
from typing import Any

import pytest

from posed.binder.status import TransactionTimeoutError
from posed.client.dynamic_sensors import DynamicSensors
from posed.proto import sensors_pb2


class Daemon:
    """The daemon's end: too slow to answer at first."""

    def __init__(self) -> None:
        self.is_slow = True

    def registerDynamicSensorCallback(self, request: Any) -> None:
        if self.is_slow:
            raise TransactionTimeoutError("slow")

    def getDynamicSensorList(self, request: Any) -> Any:
        return sensors_pb2.SensorList(sensors=[sensors_pb2.SensorInfo(handle=5000)])


class Service:
    """Stands for the binding: runs actions at once."""

    def __init__(self) -> None:
        self.connection = self
        self.callbacks: list[str] = []

    def run(self, action: Callable[[], Any]) -> Any:
        return action()

    def add_callback(self, name: str, stub: Any) -> None:
        assert name not in self.callbacks
        self.callbacks.append(name)

    def remove_callback(self, name: str) -> None:
        self.callbacks = [other for other in self.callbacks if other != name]


def test_a_daemon_that_did_not_answer_is_asked_again() -> None:
    daemon = Daemon()
    sensors = DynamicSensors(Service(), lambda handle: None)  # type: ignore[arg-type]
    sensors.restore(daemon, b"boot")  # type: ignore[arg-type]
    with pytest.raises(TransactionTimeoutError):
        sensors.sensors()
    daemon.is_slow = False
    assert [sensor.handle for sensor in sensors.sensors()] == [5000]
