"""Death and return: clients that die in every way, a daemon that goes and comes back."""

import signal
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from binder_harness import (
    EMPTY,
    LISTENER,
    MANAGER,
    PATIENCE_S,
    SENSORS,
    Listener,
    RawClient,
    ServerThread,
    events,
    get_service,
    pump,
    spawn,
)

from posed.binder import sockets
from posed.binder.connection import Connection
from posed.binder.peer import Peer
from posed.binder.server import Server
from posed.binder.status import DeadObjectError
from posed.proto import binder_pb2, sensors_pb2, service_manager_pb2


@contextmanager
def running(role: str, path: Path, first_word: str) -> Iterator[subprocess.Popen[str]]:
    """A process of the harness that has said its first word; killed at the end."""
    with spawn(role, path) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == first_word + "\n"
            yield process
        finally:
            process.kill()


def say(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM])
def test_client_that_ends_is_seen_dead(server: ServerThread, how: signal.Signals) -> None:
    with running("client", server.path, "bound") as other, running("client", server.path, "bound") as client:
        client.send_signal(how)
        assert server.manager.died.get(timeout=PATIENCE_S) == client.pid
        assert [peer.pid for peer in server.peers()] == [other.pid]
    assert server.manager.died.get(timeout=PATIENCE_S) == other.pid
    assert server.peers() == []


def test_connection_closed_in_a_living_process_is_seen(server: ServerThread) -> None:
    with running("client", server.path, "bound") as client:
        say(client)
        assert server.manager.died.get(timeout=PATIENCE_S) == client.pid
        assert client.poll() is None


def test_stopped_client_hears_of_the_loss_and_then_of_the_return(server: ServerThread) -> None:
    with running("client", server.path, "bound") as client:
        client.send_signal(signal.SIGSTOP)
        server.manager.died.get(timeout=PATIENCE_S)
        client.send_signal(signal.SIGCONT)
        assert client.stdout is not None
        assert [client.stdout.readline() for _ in range(2)] == ["disconnected\n", "connected\n"]


def test_recipients_are_called_once_each(server: ServerThread, connection: Connection) -> None:
    calls: list[str] = []

    def first(dead: Peer) -> None:
        assert dead is peer
        calls.append("first")

    def failing(_: Peer) -> None:
        calls.append("failing")
        raise ZeroDivisionError

    def unlinked(_: Peer) -> None:
        calls.append("unlinked")

    def last(_: Peer) -> None:
        calls.append("last")

    (peer,) = server.peers()
    for recipient in (first, failing, unlinked, first, last):
        peer.link_to_death(recipient)
    assert peer.unlink_to_death(unlinked)
    assert not peer.unlink_to_death(unlinked)
    connection.close()
    server.wait_until(lambda _: not peer.alive)
    assert calls == ["first", "failing", "last"]
    assert not peer.unlink_to_death(first)
    with pytest.raises(DeadObjectError, match="gone already"):
        peer.link_to_death(first)


def test_dead_peer_takes_no_call(server: ServerThread, connection: Connection) -> None:
    (peer,) = server.peers()
    listener = peer.proxy(LISTENER, "mine")
    connection.close()
    server.wait_until(lambda _: not peer.alive)
    assert server.do(lambda _: listener.onSensorEvents(events(1))) is False


def test_first_words_may_be_read_before_word_of_the_connection(server: ServerThread) -> None:
    def speak(inner: Server) -> RawClient:
        client = RawClient(server.path)
        client.send(bind_call(1))
        assert inner.sockets[0].poll(int(PATIENCE_S * 1000))
        inner._read_parcels()
        return client

    client = server.do(speak)
    assert client.receive_frame()[0] == 0
    assert len(server.peers()) == 1
    client.close()
    assert server.manager.died.get(timeout=PATIENCE_S)


def test_words_of_the_dead_make_no_peer(server: ServerThread) -> None:
    # Connected, spoken and gone before the server looks: its words are read after its death.
    def speak_and_leave(_server: object) -> None:
        clients = [RawClient(server.path) for _ in range(20)]
        for client in clients:
            client.send(bind_call(1))
        for client in clients:
            client.close()
        with socket.socket(socket.AF_UNIX) as probe:  # accepted after them, so all is in the server's queues
            probe.connect(str(server.path))
            assert probe.recv(1) == b"\xff"

    server.do(speak_and_leave)
    server.wait_until(lambda server: not server.peers)
    assert server.manager.died.qsize() == server.manager.bound.qsize()


def test_words_of_the_dead_are_not_given_to_who_has_their_descriptor(server: ServerThread) -> None:
    living: list[RawClient] = []

    def speak_leave_and_return(_server: object) -> None:
        for _ in range(20):
            client = RawClient(server.path)
            for call_id in range(1, 11):
                client.send(bind_call(call_id))
            client.close()
        living.extend(RawClient(server.path) for _ in range(3))
        for client in living:
            client.send(bind_call(1))

    server.do(speak_leave_and_return)
    for client in living:
        flags, _body = client.receive_frame()
        assert flags == 0
    server.wait_until(lambda server: len(server.peers) == 3)
    assert server.manager.died.qsize() == server.manager.bound.qsize() - 3
    for client in living:
        client.close()
    server.wait_until(lambda server: not server.peers)
    assert server.manager.died.qsize() == server.manager.bound.qsize()


def test_death_of_the_daemon_reaches_recipients_then_on_disconnected(
    socket_path: Path, unconnected: Connection
) -> None:
    order: list[str] = []

    def unlinked(_: Peer) -> None:
        order.append("unlinked")

    with running("server", socket_path, "ready") as daemon:
        pump(unconnected, lambda: unconnected.connected)
        unconnected.on_disconnected = lambda: order.append("disconnected")
        unconnected.link_to_death(lambda _: order.append("died"))
        unconnected.link_to_death(unlinked)
        assert unconnected.unlink_to_death(unlinked)
        daemon.kill()
        pump(unconnected, lambda: "disconnected" in order)
    assert order == ["died", "disconnected"]
    assert not unconnected.connected
    assert not unconnected.unlink_to_death(unlinked)


def test_call_under_way_fails_when_the_daemon_dies(
    socket_path: Path, unconnected: Connection, stop_process: Callable[[int], None]
) -> None:
    with running("server", socket_path, "ready") as daemon:
        pump(unconnected, lambda: unconnected.connected)
        stop_process(daemon.pid)  # seen by its missing heartbeats
        with pytest.raises(DeadObjectError, match="went away"):
            unconnected.ping(timeout_s=600)


def test_events_that_came_before_the_loss_are_dispatched_before_it(socket_path: Path, unconnected: Connection) -> None:
    listener = Listener()
    seen: list[int] = []
    unconnected.add_callback("mine", listener)
    with running("server", socket_path, "ready") as daemon:
        pump(unconnected, lambda: unconnected.connected)
        unconnected.on_disconnected = lambda: seen.append(len(listener.sequences))
        get_service(unconnected)
        request = sensors_pb2.EnableSensorRequest(listener="mine", sampling_period_us=30)
        unconnected.proxy(SENSORS, "sensorservice").enableSensor(request)
        daemon.kill()
        pump(unconnected, lambda: bool(seen))
    assert seen == [30]


def test_reconnects_to_a_restarted_daemon_without_stale_calls(socket_path: Path, unconnected: Connection) -> None:
    order: list[str] = []
    unconnected.on_connected = lambda: order.append("connected")
    unconnected.on_disconnected = lambda: order.append("disconnected")
    with running("server", socket_path, "ready") as daemon:
        pump(unconnected, lambda: order == ["connected"])
        get_service(unconnected, "listener")
        daemon.kill()
        pump(unconnected, lambda: not unconnected.connected)
    listener = unconnected.proxy(LISTENER, "listener")
    for sequence in range(10):
        with pytest.raises(DeadObjectError):
            listener.onSensorEvents(events(sequence))
    server = ServerThread(socket_path)
    try:
        pump(unconnected, lambda: len(order) == 3)
        get_service(unconnected, "listener")
        assert listener.onSensorEvents(events(77))
        unconnected.ping()
        assert order == ["connected", "disconnected", "connected"]
        assert server.listener.sequences == [77]
        assert server.refused() == 0
    finally:
        server.stop()


def test_farewell_arrives_before_the_loss(socket_path: Path, unconnected: Connection) -> None:
    listener = Listener()
    seen: list[list[int]] = []
    unconnected.add_callback("mine", listener)
    unconnected.on_disconnected = lambda: seen.append(list(listener.sequences))
    server = ServerThread(socket_path)
    try:
        pump(unconnected, lambda: unconnected.connected)
        unconnected.ping()
        server.do(lambda server: [p.proxy(LISTENER, "mine").onSensorEvents(events(5)) for p in server.peers.values()])
    finally:
        server.stop()
    pump(unconnected, lambda: bool(seen))
    assert seen == [[5]]


def test_many_connections_of_one_process_die_one_by_one(server: ServerThread, context: sockets.Context) -> None:
    connections = [Connection(server.path, context) for _ in range(5)]
    for connection in connections:
        pump(connection, lambda connection=connection: connection.connected)  # type: ignore[misc]
        connection.proxy(MANAGER, "servicemanager").bindService(service_manager_pb2.BindRequest())
    for left in range(4, -1, -1):
        connections[left].close()
        server.wait_until(lambda server, left=left: len(server.peers) == left)  # type: ignore[misc]
    assert server.manager.died.qsize() == 5


def bind_call(call_id: int) -> bytes:
    call = binder_pb2.Transaction(call_id=call_id, target="servicemanager", code=2, payload=EMPTY.SerializeToString())
    return binder_pb2.Parcel(transaction=call).SerializeToString()
