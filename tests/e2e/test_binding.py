"""The SDK's binding when calls come at awkward moments: from callbacks, while the daemon goes, before it is there."""

import itertools
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

import posed.client.service as binding
from posed.client import (
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    PoseClient,
    Sensor,
    SensorEvent,
    SensorManager,
    ServiceState,
)
from posed.errors import InvalidArgumentError, ServiceUnavailableError

Eventually = Callable[[Callable[[], object]], None]


class _Listener:
    def __init__(self, on_event: Callable[[SensorEvent], None] = lambda event: None) -> None:
        self._on_event = on_event
        self.called = threading.Event()

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self._on_event(event)
        self.called.set()


def _ended(client: Any) -> None:
    """Wait until the client's thread has ended: nothing is called after that."""
    client._service._thread.join(10)
    assert not client._service._thread.is_alive()


def test_a_pose_callback_may_change_everything(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    done = threading.Event()
    rates: list[float] = []
    failed: list[BaseException] = []

    def on_pose(pose: Any) -> None:
        try:
            if len(rates) < 6:
                rates.append(50.0 if len(rates) % 2 else 20.0)
                client.set_pose_rate(rates[-1])
                client.set_rate_mode(SENSOR_DELAY_FASTEST if len(rates) % 2 else SENSOR_DELAY_GAME)
                assert client.latest() is not None
            else:
                client.close()
                done.set()
        except BaseException as error:
            failed.append(error)
            done.set()

    client = PoseClient(pose_rate_hz=10, on_pose=on_pose)
    assert done.wait(10)
    assert failed == []
    assert client.state is ServiceState.CLOSED


def test_a_sensor_callback_may_unregister_flush_and_register(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    other = _Listener()
    with SensorManager() as manager:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)

        def change(event: SensorEvent) -> None:
            assert manager.flush(first)
            manager.unregister_listener(first)
            assert manager.register_listener(other, gyroscope, SENSOR_DELAY_GAME)

        first = _Listener(change)
        assert manager.register_listener(first, gyroscope, SENSOR_DELAY_GAME)
        assert other.called.wait(5)
        assert len(manager.get_statistics().listeners) == 1


def test_a_pose_callback_slower_than_the_poses_holds_up_neither_calls_nor_close(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    calls = 0
    closed = threading.Event()

    def on_pose(pose: Any) -> None:
        nonlocal calls
        calls += 1
        time.sleep(0.02)
        if calls == 20:
            client.close()
            closed.set()

    client = PoseClient(pose_rate_hz=200, on_pose=on_pose)
    client.wait_connected()
    client.set_pose_rate(199)
    client.set_pose_rate(200)
    assert closed.wait(10)
    _ended(client)
    assert calls == 20


def test_a_manager_closed_in_a_callback_calls_no_more(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    manager = SensorManager()
    gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
    events: list[SensorEvent] = []

    def close(event: SensorEvent) -> None:
        events.append(event)
        manager.close()

    assert manager.register_listener(_Listener(close), gyroscope, SENSOR_DELAY_FASTEST, 500_000)
    _ended(manager)
    assert len(events) == 1


def test_a_change_of_the_pose_rate_counts_no_gap(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    with PoseClient(pose_rate_hz=100, every=True) as client:
        assert client.next_pose(timeout_s=5) is not None
        for rate_hz in (10, 100, 20, 100):
            client.set_pose_rate(rate_hz)
            poses = [pose for _ in range(3) if (pose := client.next_pose(timeout_s=5)) is not None]
            # A busy machine may make the daemon skip an instant: what is counted is to be that, and no more.
            skipped = [later.sequence - earlier.sequence - 1 for earlier, later in itertools.pairwise(poses)]
            assert [pose.missed for pose in poses] == [0, *skipped]
            assert len(poses) == 3


def test_a_client_that_is_refused_does_not_count_as_bound_and_closes(desk: Any, monkeypatch: Any) -> None:
    desk.serve("--source", "sim:still")

    class _Newer:
        def __init__(self, descriptor: Any) -> None:
            self.info = type(real(descriptor).info)()
            self.info.CopyFrom(real(descriptor).info)
            self.info.version += 1

    real = binding.interface_of
    refused = threading.Event()
    monkeypatch.setattr(binding, "interface_of", _Newer)
    client = PoseClient(auto_create=True, on_binding_died=lambda reason: refused.set())
    assert refused.wait(5)
    assert client.state is ServiceState.BINDING_DIED
    assert "newer" in client.reason or "version" in client.reason
    status = desk.posed("status", "--json")
    assert '"bound_clients": 0' in status.stdout, status.stdout
    client.close()
    assert client.state is ServiceState.CLOSED


def test_a_daemon_that_dies_before_it_has_answered_is_started_again(desk: Any, monkeypatch: Any) -> None:
    asked: list[bool] = []

    def ensure_daemon() -> bool:
        asked.append(True)
        # The first time one seems to be there, and is gone before the client has reached it.
        return real() if len(asked) > 1 else False

    real = binding.ensure_daemon
    monkeypatch.setattr(binding, "ensure_daemon", ensure_daemon)
    with PoseClient(auto_create=True) as client:
        assert client.next_pose(timeout_s=20) is not None
    assert len(asked) == 2


def test_calls_to_a_daemon_that_is_away_end_with_one_error(desk: Any, eventually: Eventually) -> None:
    daemon = desk.serve("--source", "sim:still")
    listener = _Listener()
    with SensorManager() as manager, PoseClient() as poses:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_GAME)
        poses.wait_connected()
        daemon.kill()
        daemon.wait()
        eventually(lambda: manager.state is ServiceState.DISCONNECTED)
        eventually(lambda: poses.state is ServiceState.DISCONNECTED)
        manager.unregister_listener(listener)
        poses.set_rate_mode(SENSOR_DELAY_NORMAL)
        desk.serve("--source", "sim:still")
        poses.wait_connected()
        assert poses.rate_mode == "NORMAL"
        manager.wait_connected()
        assert [sensor.registrations for sensor in manager.get_statistics().sensors if sensor.handle == 4] == [1]
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_GAME)


def test_a_hanging_daemon_is_unavailable(desk: Any, stop_process: Callable[[int], None]) -> None:
    daemon = desk.serve("--source", "sim:still")
    with SensorManager() as manager:
        manager.wait_connected()
        stop_process(daemon.pid)
        with pytest.raises(ServiceUnavailableError):
            manager.get_statistics()


@pytest.mark.parametrize(
    "arguments", [{"rate_mode": 2**31}, {"rate_mode": "1"}, {"rate_mode": 1e4}, {"filter": b"dcm"}, {"filter": 1}]
)
def test_arguments_that_no_call_can_carry_are_refused_before_they_are_kept(desk: Any, arguments: Any) -> None:
    with pytest.raises(InvalidArgumentError):
        PoseClient(**arguments)


def test_a_pose_client_keeps_its_rate_mode_when_a_bad_one_is_refused(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    with PoseClient(SENSOR_DELAY_NORMAL) as client:
        client.wait_connected()
        for bad in (2**31, "fast"):
            with pytest.raises(InvalidArgumentError):
                client.set_rate_mode(bad)  # type: ignore[arg-type]
        client.set_pose_rate(50)
        assert client.rate_mode == "NORMAL"


def test_waiting_for_a_pose_ends_with_a_binding_that_failed(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    with PoseClient(filter="\udc80") as client:  # no call can carry it: half of a character
        waiting = threading.Thread(target=client.next_pose, daemon=True)
        waiting.start()
        waiting.join(10)
        assert not waiting.is_alive()
        assert client.state is ServiceState.BINDING_DIED


def test_calls_that_wait_when_the_client_closes_end_with_the_promised_error(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    kept, free = threading.Event(), threading.Event()

    def keep() -> None:
        kept.set()
        free.wait(10)

    ends: list[BaseException | None] = []

    def wait() -> None:
        try:
            manager.get_statistics()
        except ServiceUnavailableError as error:
            ends.append(error)

    manager = SensorManager()
    manager.wait_connected()
    service = manager._service
    keeping = threading.Thread(target=service.run, args=(keep,))
    keeping.start()
    assert kept.wait(5)
    with pytest.raises(ServiceUnavailableError):
        service.run(keep, 0.0)  # given up, and still in the queue
    waiting = threading.Thread(target=wait)
    waiting.start()
    manager.close()
    free.set()
    _ended(manager)
    waiting.join()
    keeping.join()
    assert len(ends) == 1
    assert service._wake_fd is None
    assert service.context.closed


def test_a_callback_on_the_bindings_thread_does_not_wait_for_itself(desk: Any) -> None:
    daemon = desk.serve("--source", "sim:still")
    told = threading.Event()

    def wait() -> None:
        try:
            manager.wait_connected(60)
        except ServiceUnavailableError:
            told.set()

    with SensorManager(on_service_disconnected=wait) as manager:
        manager.wait_connected()
        daemon.kill()
        assert told.wait(10)


def test_binding_twice_on_one_connection_keeps_the_registrations(desk: Any, eventually: Eventually) -> None:
    desk.serve("--source", "sim:still")
    listener = _Listener()
    told: list[bool] = []
    with SensorManager(on_service_connected=lambda: told.append(True)) as manager:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_GAME)
        # Had it been too slow before, to answer in time.
        manager._service.run(manager._service._connected)
        listener.called.clear()
        assert listener.called.wait(5)
        assert [sensor.registrations for sensor in manager.get_statistics().sensors if sensor.handle == 4] == [1]
        assert len(told) == 2
        # Lost, there again, lost and there again, all while a callback kept the thread: one connection to bind.
        manager._service.run(lambda: manager._service._links.extend((False, True, False, True)))
        eventually(lambda: len(told) > 2)
        listener.called.clear()
        assert listener.called.wait(5)
        assert len(told) == 3


def test_what_the_returned_daemon_lacks_does_not_cost_the_rest(desk: Any, tmp_path: Any) -> None:
    daemon = desk.serve("--source", "sim:still")
    lacking = tmp_path / "lacking.csv"
    rows = "".join(f"gyroscope,{k * 20_000_000},0,0,0\n" for k in range(3000))
    lacking.write_text("sensor,timestamp_ns,x,y,z\n" + rows)
    turning, pulling = _Listener(), _Listener()
    with SensorManager() as manager:
        for listener, kind in ((pulling, Sensor.TYPE_ACCELEROMETER), (turning, Sensor.TYPE_GYROSCOPE)):
            assert manager.register_listener(listener, manager.get_default_sensor(kind), SENSOR_DELAY_GAME)
        assert turning.called.wait(5)
        daemon.kill()
        daemon.wait()
        turning.called.clear()
        desk.serve("--source", f"replay:{lacking}")
        assert turning.called.wait(5)
        assert manager.state is ServiceState.CONNECTED
