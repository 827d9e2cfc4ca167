"""Whatever comes over the socket, the daemon goes on and its other clients do not notice."""

import os
import socket
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq
from binder_harness import (
    EMPTY,
    LISTENER,
    NOBODY,
    PING,
    SENSORS,
    Listener,
    RawClient,
    ServerThread,
    events,
    get_service,
    pump,
    spawn,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from posed.binder import sockets
from posed.binder.connection import Connection
from posed.binder.interface import interface_of
from posed.binder.status import ExceptionCode
from posed.errors import PosedError, RuntimeDirectoryError
from posed.proto import binder_pb2, sensors_pb2, service_manager_pb2

needs_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can act as another user")


def reply_of(frame: bytes) -> binder_pb2.Reply:
    return binder_pb2.Parcel.FromString(frame).reply


def transaction(**fields: object) -> bytes:
    call = binder_pb2.Transaction(**fields)  # type: ignore[arg-type]
    return binder_pb2.Parcel(transaction=call).SerializeToString()


GET_SENSORS = transaction(
    call_id=1,
    target="servicemanager",
    code=1,
    payload=service_manager_pb2.GetServiceRequest(
        name="sensorservice", interface=interface_of(SENSORS).info
    ).SerializeToString(),
)


@pytest.mark.parametrize(
    "noise",
    [
        b"",
        b"\xff" + bytes(8) + b"\x7f",
        b"\xff" * 200,
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        bytes(range(256)) * 40,
        b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"PLAIN".ljust(20, b"\0") + bytes(32),
    ],
    ids=["silence", "half a greeting", "ones", "http", "all bytes", "another mechanism"],
)
def test_who_does_not_speak_zmtp_is_cut_off(server: ServerThread, connection: Connection, noise: bytes) -> None:
    intruders = [socket.socket(socket.AF_UNIX) for _ in range(20)]
    for intruder in intruders:
        intruder.settimeout(20)
        intruder.connect(str(server.path))
        intruder.sendall(noise)
    connection.ping()
    for intruder in intruders:
        try:
            while intruder.recv(4096):
                pass
        except ConnectionResetError:
            pass
        intruder.close()
    connection.ping()
    assert len(server.peers()) == 1
    server.wait_until(lambda server: len(server._connections) == 1)


@pytest.mark.parametrize("size", [128 * 1024 + 1, 2**30, 2**62, 2**64 - 1])
def test_huge_frame_ends_the_connection_and_takes_no_memory(
    server: ServerThread, connection: Connection, size: int
) -> None:
    intruder = RawClient(server.path)
    before = virtual_memory()
    intruder.socket.sendall(struct.pack(">BQ", 2, size) + b"x" * 100)
    assert intruder.receive_frame() == (-1, b"")
    intruder.close()
    connection.ping()
    assert virtual_memory() - before < 2**28


def test_parcel_over_the_limit_is_refused(server: ServerThread) -> None:
    client = RawClient(server.path)
    client.send(transaction(call_id=9, target="servicemanager", code=1, payload=bytes(70_000)))
    reply = reply_of(client.receive_frame()[1])
    assert (reply.call_id, reply.status.exception_code) == (9, ExceptionCode.TRANSACTION_FAILED)
    assert server.refused() == 1
    client.close()


@pytest.mark.parametrize(
    "frames",
    [
        (b"",),
        (b"\xff" * 100,),
        (binder_pb2.Parcel(reply=binder_pb2.Reply(call_id=1)).SerializeToString(),),
        (b"\x0b" * 10_000,),
        (transaction(call_id=0, target="servicemanager", code=1),),
        (transaction(call_id=0, target="servicemanager", code=0x5F504E47),),
        (transaction(call_id=0, target="nobody", code=1),),
        (PING, PING),
        (b"", PING),
    ],
    ids=[
        "nothing", "ones", "a reply", "10,000 groups", "no call_id", "ping without call_id", "nobody without call_id",
        "two frames", "an empty delimiter",
    ],
)  # fmt: skip
def test_parcel_that_cannot_be_answered_is_dropped_and_counted(server: ServerThread, frames: tuple[bytes, ...]) -> None:
    client = RawClient(server.path)
    client.send(*frames)
    client.send(PING)
    flags, answer = client.receive_frame()
    assert flags == 0
    assert reply_of(answer).call_id == 1
    assert reply_of(answer).status.exception_code == 0
    assert server.refused() == 1
    client.close()


@pytest.fixture(scope="module")
def lasting_server() -> Iterator[ServerThread]:
    with tempfile.TemporaryDirectory(prefix="posed-") as directory:
        server = ServerThread(Path(directory) / "control.sock")
        yield server
        server.stop()


fuzz = settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
valid = st.builds(
    transaction,
    call_id=st.integers(0, 2**32 - 1),
    target=st.sampled_from(["servicemanager", "sensorservice", "listener", ""]) | st.text(max_size=20),
    code=st.integers(0, 8) | st.integers(0, 2**32 - 1),
    payload=st.binary(max_size=200),
)
mutated = st.builds(
    lambda data, cut, at, byte: (data[:at] + bytes([byte]) + data[at + 1 :])[:cut],
    valid,
    st.integers(0, 200),
    st.integers(0, 200),
    st.integers(0, 255),
)


@fuzz
@given(parcel=st.binary(max_size=300) | valid | mutated)
def test_no_parcel_stops_the_server(lasting_server: ServerThread, parcel: bytes) -> None:
    client = RawClient(lasting_server.path)
    client.send(parcel)
    client.send(transaction(call_id=4_000_000_001, target="servicemanager", code=0x5F504E47))
    while reply_of(client.receive_frame()[1]).call_id != 4_000_000_001:
        pass
    client.close()
    lasting_server.wait_until(lambda server: not server.peers)
    assert lasting_server.sensors.calls == 0


def test_chosen_routing_id_is_refused(server: ServerThread, connection: Connection, context: sockets.Context) -> None:
    with context.socket(zmq.DEALER) as intruder:
        intruder.setsockopt(zmq.ROUTING_ID, b"me")
        intruder.connect(f"ipc://{server.path}")
        intruder.send(PING)
        server.wait_until(lambda server: server.parcels_refused == 1)
        assert intruder.poll(0) == 0
    assert len(server.peers()) == 1


def test_forged_identity_gets_nothing_of_the_victims(server: ServerThread, connection: Connection) -> None:
    (victim,) = server.peers()
    intruder = RawClient(server.path, Identity=victim.id)
    intruder.send(PING)
    for _ in range(100):
        connection.ping()
    assert server.peers() == [victim]
    intruder.socket.settimeout(0.2)
    with pytest.raises(TimeoutError):
        intruder.receive_frame()
    intruder.close()
    connection.ping()


def test_forged_credentials_are_not_believed(server: ServerThread) -> None:
    intruder = RawClient(server.path, Peer_Address=b"localhost:0:0:1", __fd=b"0")
    intruder.send(PING)
    assert reply_of(intruder.receive_frame()[1]).call_id == 1
    assert [(peer.uid, peer.pid) for peer in server.peers()] == [(os.getuid(), os.getpid())]
    intruder.close()
    server.wait_until(lambda server: not server.peers)


@needs_root
@pytest.mark.parametrize("filtered", [True, False], ids=["by the socket", "by its credentials"])
def test_foreign_user_gets_nothing(server: ServerThread, connection: Connection, filtered: bool) -> None:
    open_to_all(server.path)
    if not filtered:
        # Without the socket's own filter, only who the frames come from tells.
        server.do(lambda inner: allow(inner.sockets[0], NOBODY, server.path))
        open_to_all(server.path)
    with spawn("foreign-client", server.path) as client:
        assert client.communicate(timeout=60)[0] == "0\n"
    assert server.refused() == (0 if filtered else 1)
    assert len(server.peers()) == 1
    connection.ping()


@needs_root
def test_daemon_of_a_foreign_user_is_not_believed(socket_path: Path, unconnected: Connection) -> None:
    os.chown(socket_path.parent, NOBODY, NOBODY)
    socket_path.parent.chmod(0o755)
    with spawn("foreign-server", socket_path) as daemon:
        assert daemon.stdout is not None
        assert daemon.stdout.readline() == "ready\n"
        pump(unconnected, lambda: unconnected.connected)
        with pytest.raises(RuntimeDirectoryError, match="served by user 65534"):
            unconnected.ping()
        daemon.kill()


def test_client_that_does_not_read_is_told_off_not_waited_for(server: ServerThread, connection: Connection) -> None:
    sleeper = RawClient(server.path)
    sleeper.send(PING)
    server.wait_until(lambda server: len(server.peers) == 2)
    asleep = next(peer for peer in server.peers() if peer.id != victim_of(connection, server))
    listener = asleep.proxy(LISTENER, "listener")

    def fill(_server: object) -> int:
        sent = 0
        while sent < 10_000 and listener.onSensorEvents(events(sent, flushes=60_000)):
            sent += 1
        return sent

    assert 0 < server.do(fill) < 200
    assert server.do(lambda _: listener.onSensorEvents(events(0))) is False
    connection.ping()
    server.wait_until(lambda _: not asleep.alive)  # its heartbeats go unanswered
    connection.ping()
    sleeper.close()


def test_replies_wait_for_a_slow_reader_and_come_in_order(server: ServerThread) -> None:
    server.sensors.answer = sensors_pb2.SensorList(sensors=[sensors_pb2.SensorInfo(name="n" * 60_000)])
    client = RawClient(server.path)
    client.send(GET_SENSORS)
    assert client.receive_frame()[0] == 0
    for call_id in range(2, 122):
        client.send(transaction(call_id=call_id, target="sensorservice", code=1))
    server.wait_until(lambda server: server.retry_s is not None)
    (peer,) = server.peers()
    assert server.do(lambda server: server.send(peer, PING)) is False  # it must not overtake a reply
    replies = [reply_of(client.receive_frame()[1]) for _ in range(2, 122)]
    assert [reply.call_id for reply in replies] == list(range(2, 122))
    assert all(len(reply.payload) > 60_000 for reply in replies)
    server.wait_until(lambda server: server.retry_s is None)
    client.close()


def test_who_never_reads_its_replies_costs_little_memory(server: ServerThread, connection: Connection) -> None:
    server.sensors.answer = sensors_pb2.SensorList(sensors=[sensors_pb2.SensorInfo(name="n" * 60_000)])
    client = RawClient(server.path)
    client.send(GET_SENSORS)
    assert client.receive_frame()[0] == 0
    calls = server.sensors.calls
    for call_id in range(2, 1002):
        client.send(transaction(call_id=call_id, target="sensorservice", code=1))
    server.wait_until(lambda _: server.sensors.calls - calls == 1000)
    unsent = server.do(lambda server: [unsent.bytes for unsent in server._unsent.values()])
    assert 0 < sum(unsent) <= 4 * 1024 * 1024
    connection.ping()
    client.close()
    server.wait_until(lambda server: not server._unsent)


def test_a_thousand_connections_leave_nothing(server: ServerThread, connection: Connection) -> None:
    def descriptors() -> int:
        return len(os.listdir("/proc/self/fd"))

    for _ in range(3):
        RawClient(server.path).close()
    server.wait_until(lambda server: len(server._connections) == 1)
    before = descriptors()
    for turn in range(1000):
        client = RawClient(server.path)
        if turn % 2:
            client.send(PING)
            assert reply_of(client.receive_frame()[1]).call_id == 1
        client.close()
    server.wait_until(lambda server: len(server._connections) == 1)
    assert descriptors() == before
    assert len(server.peers()) == 1
    connection.ping()


def test_flood_of_calls_leaves_room_for_others(server: ServerThread, connection: Connection) -> None:
    flooder = RawClient(server.path)
    for _ in range(500):
        flooder.send(PING)
    for _ in range(5):
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    for _ in range(500):
        assert flooder.receive_frame()[0] == 0
    flooder.close()


def test_bad_parcel_from_the_daemon_is_survived(socket_path: Path, unconnected: Connection) -> None:
    with zmq.Context() as context, context.socket(zmq.ROUTER) as daemon:
        daemon.setsockopt(zmq.LINGER, 0)
        daemon.bind(f"ipc://{socket_path}")
        pump(unconnected, lambda: unconnected.connected)
        with pytest.raises(PosedError, match="did not answer"):
            unconnected.ping(timeout_s=0.01)
        routing_id, call = daemon.recv_multipart()
        call_id = binder_pb2.Parcel.FromString(call).transaction.call_id
        listener = Listener()
        unconnected.add_callback("good", listener)
        for parcel in (b"\xff\xff", b"", b"\x0b" * 10_000, transaction(call_id=5, target="mine", code=1)):
            daemon.send_multipart([routing_id, parcel])
        daemon.send_multipart([routing_id, PING, PING])
        daemon.send_multipart([routing_id, transaction(target="mine", code=1, payload=b"\xff")])
        reply = binder_pb2.Reply(call_id=call_id + 1)
        daemon.send_multipart([routing_id, binder_pb2.Parcel(reply=reply).SerializeToString()])
        last = binder_pb2.Transaction(target="good", code=1, payload=events(9).SerializeToString())
        daemon.send_multipart([routing_id, binder_pb2.Parcel(transaction=last).SerializeToString()])
        pump(unconnected, lambda: listener.sequences == [9])
        # The reply to the next call has come before the call; it must not have been kept for it.
        with pytest.raises(PosedError, match="did not answer"):
            unconnected.ping(timeout_s=0.01)


def virtual_memory() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def open_to_all(path: Path) -> None:
    path.parent.chmod(0o755)
    path.chmod(0o666)


def allow(router: zmq.Socket[bytes], uid: int, path: Path) -> None:
    """Let a user through the socket's filter too; filters are read when a socket is bound."""
    router.unbind(f"ipc://{path}")
    router.setsockopt(zmq.IPC_FILTER_UID, uid)
    router.bind(f"ipc://{path}")


def victim_of(connection: Connection, server: ServerThread) -> bytes:
    """The routing id of the peer that has got a service."""
    get_service(connection)
    return server.do(lambda server: next(peer.id for peer, opened in server._opened.items() if opened))
