"""Who dies, who notices, and what is made good."""

import os
import signal
import threading
from collections.abc import Callable
from typing import Any

from posed.client import SENSOR_DELAY_FASTEST, PoseClient, Sensor, SensorEvent, SensorManager, ServiceState

Eventually = Callable[[Callable[[], object]], None]

_FASTEST_CLIENT = """
from posed.client import PoseClient, SENSOR_DELAY_FASTEST
client = PoseClient(SENSOR_DELAY_FASTEST)
print(client.next_pose(), flush=True)
for pose in client:
    print(pose.sequence, flush=True)
"""


class _Events:
    def __init__(self) -> None:
        self.arrived = threading.Event()
        self.boot_events: list[SensorEvent] = []

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.boot_events.append(event)
        self.arrived.set()


def _gyroscope_registrations(manager: SensorManager) -> int:
    return sum(s.registrations for s in manager.get_statistics().sensors if s.handle == Sensor.TYPE_GYROSCOPE)


def test_poses_and_registrations_return_after_the_daemon_was_killed(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    lost, found = threading.Event(), threading.Event()
    listener = _Events()
    with (
        PoseClient(on_service_disconnected=lost.set, on_service_connected=found.set) as poses,
        SensorManager() as manager,
    ):
        before = poses.next_pose(timeout_s=5)
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_FASTEST)
        assert listener.arrived.wait(5)
        found.clear()
        os.kill(desk.daemon_pid, signal.SIGKILL)
        assert lost.wait(5)
        assert poses.state is ServiceState.DISCONNECTED
        assert poses.reason
        listener.arrived.clear()
        desk.serve("--source", "sim:still")
        assert found.wait(5)
        after = poses.next_pose(timeout_s=5)
        assert before is not None
        assert after is not None
        assert after.delivery.boot_id != before.delivery.boot_id
        assert after.missed == 0
        assert listener.arrived.wait(5)


def test_a_client_that_wants_a_daemon_starts_another_after_a_crash(desk: Any) -> None:
    with PoseClient(auto_create=True) as client:
        before = client.next_pose(timeout_s=10)
        pid = desk.daemon_pid
        os.kill(pid, signal.SIGKILL)
        assert before is not None
        after = client.next_pose(timeout_s=10)
        while after is not None and after.delivery.boot_id == before.delivery.boot_id:
            after = client.next_pose(timeout_s=10)
        assert after is not None
        assert desk.daemon_pid != pid


def test_a_killed_clients_registrations_are_freed(desk: Any, eventually: Eventually) -> None:
    desk.serve("--source", "sim:still")
    client = desk.client(_FASTEST_CLIENT)
    with SensorManager() as manager:
        assert _gyroscope_registrations(manager) == 1
        client.kill()
        eventually(lambda: _gyroscope_registrations(manager) == 0)


def test_a_stopped_clients_registrations_are_freed_and_return_when_it_goes_on(
    desk: Any, eventually: Eventually
) -> None:
    desk.serve("--source", "sim:still")
    client = desk.client(_FASTEST_CLIENT)
    with SensorManager() as manager:
        assert _gyroscope_registrations(manager) == 1
        client.send_signal(signal.SIGSTOP)
        eventually(lambda: _gyroscope_registrations(manager) == 0)
        client.send_signal(signal.SIGCONT)
        eventually(lambda: _gyroscope_registrations(manager) == 1)


def test_a_stopped_daemon_makes_poses_stale_and_sends_no_burst_when_it_goes_on(
    desk: Any, eventually: Eventually
) -> None:
    daemon = desk.serve("--source", "sim:still")
    with PoseClient(every=True) as client:
        assert client.next_pose(timeout_s=5) is not None
        assert not client.stale
        daemon.send_signal(signal.SIGSTOP)
        eventually(lambda: client.stale)
        daemon.send_signal(signal.SIGCONT)
        eventually(lambda: not client.stale)
        pose = client.next_pose(timeout_s=5)
        while pose is not None and not pose.missed:
            pose = client.next_pose(timeout_s=5)
        assert pose is not None
        assert pose.missed >= 4


def test_a_daemon_that_stops_in_the_middle_of_a_stream_is_lost_and_streams_again_when_it_goes_on(
    desk: Any, eventually: Eventually
) -> None:
    daemon = desk.serve("--source", "sim:still")
    listener = _Events()
    with SensorManager() as manager:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_FASTEST)
        eventually(lambda: len(listener.boot_events) >= 400)
        daemon.send_signal(signal.SIGSTOP)
        eventually(lambda: manager.state is ServiceState.DISCONNECTED)
        listener.arrived.clear()
        daemon.send_signal(signal.SIGCONT)
        assert listener.arrived.wait(5)
        assert manager.state is ServiceState.CONNECTED
        times = [event.timestamp for event in listener.boot_events]
        assert times == sorted(times)


def test_close_returns_though_the_daemon_hangs(desk: Any, stop_process: Callable[[int], None]) -> None:
    daemon = desk.serve("--source", "sim:still")
    client = PoseClient()
    assert client.next_pose(timeout_s=5) is not None
    stop_process(daemon.pid)
    client.close()
    assert client.state is ServiceState.CLOSED
    assert client.next_pose() is None or client.next_pose() is None
