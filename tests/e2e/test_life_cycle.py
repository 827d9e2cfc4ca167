"""Started and bound daemons, as an Android service has it."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest

from posed.client import PoseClient, SensorManager, ServiceState
from posed.errors import ServiceUnavailableError

Eventually = Callable[[Callable[[], object]], None]


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_started_daemon_outlives_its_clients_and_ends_on_stop(desk: Any) -> None:
    daemon = desk.serve("--source", "sim:still")
    with PoseClient(auto_create=True) as client:
        assert client.next_pose(timeout_s=5) is not None
    assert "running" in desk.posed("status").stdout
    assert desk.posed("stop").returncode == 0
    assert daemon.wait(timeout=5) == 0


def test_a_bound_daemon_starts_with_the_first_bind_and_ends_with_the_last_unbind(
    desk: Any, eventually: Eventually
) -> None:
    with PoseClient(auto_create=True) as first:
        assert first.next_pose(timeout_s=10) is not None
        pid = desk.daemon_pid
        with SensorManager(auto_create=True) as second:
            second.wait_connected(5)
            first.close()
            assert second.get_sensor_list()
            assert _runs(pid)
    eventually(lambda: not _runs(pid))


def test_start_makes_a_bound_daemon_stay_and_stop_lets_it_go_after_the_last_unbind(
    desk: Any, eventually: Eventually
) -> None:
    with PoseClient(auto_create=True) as client:
        client.wait_connected(10)
        pid = desk.daemon_pid
        assert desk.posed("start").returncode == 0
        assert desk.daemon_pid == pid
    assert _runs(pid)
    with PoseClient(auto_create=True) as client:
        client.wait_connected(5)
        stopped = desk.posed("stop")
        assert (stopped.returncode, "1 bound client" in stopped.stderr) == (1, True)
        assert client.next_pose(timeout_s=5) is not None
        assert _runs(pid)
    eventually(lambda: not _runs(pid))


def test_a_binding_without_auto_create_neither_starts_nor_keeps_a_daemon(desk: Any, eventually: Eventually) -> None:
    with PoseClient() as watcher:
        with pytest.raises(ServiceUnavailableError, match="posed serve"):
            watcher.wait_connected(timeout_s=0.3)
        with PoseClient(auto_create=True) as keeper:
            keeper.wait_connected(10)
            pid = desk.daemon_pid
            watcher.wait_connected(5)
        eventually(lambda: not _runs(pid))
        eventually(lambda: watcher.state is ServiceState.BINDING_DIED)


def test_a_daemon_told_to_go_says_so_and_one_that_comes_is_found_again(desk: Any, eventually: Eventually) -> None:
    died: list[str] = []
    gone, returned = threading.Event(), threading.Event()

    def on_binding_died(reason: str) -> None:
        died.append(reason)
        gone.set()

    daemon = desk.serve("--source", "sim:still")
    with PoseClient(on_binding_died=on_binding_died, on_service_connected=returned.set) as client:
        client.wait_connected(5)
        returned.clear()
        assert desk.posed("stop", "--force").returncode == 0
        assert gone.wait(5)
        assert daemon.wait(timeout=5) == 0
        assert "told to stop" in died[0]
        assert client.state is ServiceState.BINDING_DIED
        desk.serve("--source", "sim:still")
        assert returned.wait(5)
        assert client.next_pose(timeout_s=5) is not None


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_daemon_cleanly(desk: Any, number: signal.Signals) -> None:
    daemon = desk.serve("--source", "sim:still")
    with PoseClient() as client:
        assert client.next_pose(timeout_s=5) is not None
        daemon.send_signal(number)
        assert daemon.wait(timeout=5) == 0
    assert sorted(path.name for path in (desk.directory / "posed").iterdir()) == ["daemon.lock"]


def test_a_second_daemon_refuses_and_leaves_the_first_alone(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    with PoseClient(every=True) as client:
        before = client.next_pose(timeout_s=5)
        second = desk.posed("serve")
        assert second.returncode == 75
        assert str(desk.daemon_pid) in second.stderr
        assert len(second.stderr.strip().splitlines()) == 1
        after = client.next_pose(timeout_s=5)
        assert before is not None
        assert after is not None
        assert before.delivery.boot_id == after.delivery.boot_id
        assert client.poses_missed == 0


_BIND_AND_SAY_WHICH_DAEMON = """
import sys
from posed.client import PoseClient
sys.stdin.readline()
with PoseClient(auto_create=True) as client:
    print(client.next_pose(timeout_s=20).delivery.boot_id.hex(), flush=True)
    sys.stdin.readline()
"""


def test_ten_processes_binding_at_once_start_one_daemon(desk: Any) -> None:
    clients = [desk.spawn([sys.executable, "-c", _BIND_AND_SAY_WHICH_DAEMON]) for _ in range(10)]
    for line in ("bind", "unbind"):
        for client in clients:
            client.stdin.write(f"{line}\n")
            client.stdin.flush()
        if line == "bind":
            boot_ids = {client.stdout.readline() for client in clients}
    assert [client.wait(timeout=10) for client in clients] == [0] * 10
    assert len(boot_ids) == 1
    assert boot_ids != {""}


def test_a_daemon_that_cannot_start_is_named_to_the_client_that_wants_it(
    desk: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Something in the way that is neither a socket nor ours to remove.
    (desk.directory / "posed").mkdir(mode=0o700)
    (desk.directory / "posed" / "control.sock").write_text("precious")
    with PoseClient(auto_create=True) as client:
        with pytest.raises(ServiceUnavailableError, match=r"control\.sock"):
            client.wait_connected(timeout_s=10)
        assert client.state is ServiceState.BINDING_DIED
    assert (desk.directory / "posed" / "control.sock").read_text() == "precious"
