"""Registrations between listeners and a daemon that refuses some of them."""

from collections.abc import Callable
from typing import Any

import pytest

from posed.binder.status import ExceptionCode, RemoteError, TransactionTimeoutError
from posed.client import Package, Sensor, SensorEvent, ServiceState
from posed.client.event_queue import Registration
from posed.client.registry import ListenerRegistry
from posed.proto import sensors_pb2

GYRO, ACC = (Sensor.of_message(sensors_pb2.SensorInfo(handle=handle, type=handle)) for handle in (4, 1))


class Daemon:
    """The daemon's end: notes what is enabled, refuses what `refuses` says."""

    def __init__(self) -> None:
        self.enabled: list[tuple[int, int]] = []
        self.disabled: list[int] = []
        self.patience_s: float | None = None
        self.refuses: Callable[[Any], bool] = lambda request: False

    def enableSensor(self, request: Any) -> None:
        if self.refuses(request):
            raise RemoteError(ExceptionCode.ILLEGAL_ARGUMENT, "refused")
        self.enabled.append((request.handle, request.max_report_latency_us))

    def disableSensor(self, request: Any, timeout_s: float | None = None) -> None:
        self.disabled.append(request.handle)
        self.patience_s = timeout_s


class Service:
    """Stands for the binding: runs actions at once."""

    state = ServiceState.CONNECTED

    def __init__(self) -> None:
        self.connection = self
        self.callbacks: set[str] = set()
        self.posted: list[Callable[[], Any]] = []

    def run(self, action: Callable[[], Any]) -> Any:
        return action()

    def post(self, action: Callable[[], Any]) -> None:
        self.posted.append(action)

    def add_callback(self, name: str, stub: Any) -> None:
        self.callbacks.add(name)

    def remove_callback(self, name: str) -> None:
        self.callbacks.discard(name)


class Listener:
    def on_sensor_changed(self, event: SensorEvent) -> None:
        pass


@pytest.fixture
def daemon() -> Daemon:
    return Daemon()


@pytest.fixture
def service() -> Service:
    return Service()


@pytest.fixture
def registry(daemon: Daemon, service: Service) -> ListenerRegistry:
    made = ListenerRegistry(service)  # type: ignore[arg-type]
    made.restore(daemon, {})  # type: ignore[arg-type]
    return made


def test_a_latency_that_is_refused_is_tried_once_more_as_streaming(registry: ListenerRegistry, daemon: Daemon) -> None:
    daemon.refuses = lambda request: request.max_report_latency_us > 0
    assert registry.register(Listener(), Registration(GYRO, 0, 1_000_000), None)
    assert daemon.enabled == [(4, 0)]


def test_a_refused_listener_leaves_nothing_behind(registry: ListenerRegistry, daemon: Daemon, service: Service) -> None:
    daemon.refuses = lambda request: True
    listener = Listener()
    assert not registry.register(listener, Registration(GYRO, 0, 1_000_000), None)
    assert service.callbacks == set()
    daemon.refuses = lambda request: False
    assert registry.register(listener, Registration(GYRO, 0, 0), None)


def test_a_daemon_that_returns_is_asked_for_all_of_it_again(registry: ListenerRegistry) -> None:
    listener = Listener()
    registry.register(listener, Registration(GYRO, 0, 500), None)
    registry.register(listener, Registration(ACC, 0, 0), None)
    returned = Daemon()
    returned.refuses = lambda request: request.handle == 4
    registry.restore(returned, {})  # type: ignore[arg-type]
    assert returned.enabled == [(1, 0)]
    assert registry.register(listener, Registration(ACC, 0, 0), None) is False


def test_a_request_that_is_not_answered_is_taken_back_without_waiting(
    registry: ListenerRegistry, service: Service, daemon: Daemon
) -> None:
    def hang(request: Any) -> bool:
        raise TransactionTimeoutError("slow")

    daemon.refuses = hang
    listener = Listener()
    with pytest.raises(TransactionTimeoutError):
        registry.register(listener, Registration(GYRO, 0, 0), None)
    assert daemon.disabled == [4]
    assert daemon.patience_s == 0
    assert service.callbacks == set()
    daemon.refuses = lambda request: False
    assert registry.register(listener, Registration(GYRO, 0, 0), None)


def test_what_is_unregistered_while_it_is_restored_is_disabled_after_it(
    registry: ListenerRegistry, service: Service
) -> None:
    listener = Listener()
    registry.register(listener, Registration(GYRO, 0, 0), None)

    def unregister(request: Any) -> bool:
        registry.unregister(listener, None)
        return False

    returned = Daemon()
    returned.refuses = unregister
    service.state = ServiceState.DISCONNECTED
    registry.restore(returned, {})  # type: ignore[arg-type]
    assert returned.enabled == [(4, 0)]
    returned.disabled.clear()
    service.state = ServiceState.CONNECTED
    (disable,) = service.posted
    disable()
    assert returned.disabled == [4]
    assert service.callbacks == set()


def test_what_is_registered_again_before_it_is_disabled_stays(
    registry: ListenerRegistry, service: Service, daemon: Daemon
) -> None:
    listener = Listener()
    for sensor in (GYRO, ACC):
        registry.register(listener, Registration(sensor, 0, 0), None)
    service.state = ServiceState.DISCONNECTED
    registry.unregister(listener, GYRO)
    assert registry.register(listener, Registration(GYRO, 0, 0), None)
    (disable,) = service.posted
    disable()
    assert daemon.disabled == []


def test_a_program_is_called_after_its_script(monkeypatch: pytest.MonkeyPatch) -> None:
    for argv, name in ((["/home/me/walk.py"], "walk"), (["-c"], "python"), ([""], "python"), ([], "python")):
        monkeypatch.setattr("sys.argv", argv)
        assert Package().name == name
