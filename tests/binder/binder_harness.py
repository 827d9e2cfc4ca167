"""What the binder's tests share: plain services, a server in a thread, peers in processes, and a raw ZMTP speaker."""

import os
import queue
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, TypeVar

import zmq

from posed.binder import sockets
from posed.binder.connection import Connection
from posed.binder.interface import check_version, interface_of
from posed.binder.peer import Peer
from posed.binder.server import Server
from posed.binder.stub import Caller, Stub
from posed.proto import binder_pb2, events_pb2, sensors_pb2, service_manager_pb2

T = TypeVar("T")
NOBODY = 65534
PATIENCE_S = 20.0
"""How long a test waits for what must happen: long, so that only what never happens fails."""

MANAGER = service_manager_pb2.DESCRIPTOR.services_by_name["IServiceManager"]
SENSORS = sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]
LISTENER = sensors_pb2.DESCRIPTOR.services_by_name["ISensorEventListener"]
EMPTY = binder_pb2.Empty()


class Manager(Stub):
    """Checks versions as a daemon does; services it knows no interface of are open to anybody."""

    descriptor = MANAGER

    def __init__(self) -> None:
        self.bound: queue.Queue[Caller] = queue.Queue()
        self.died: queue.Queue[int] = queue.Queue()

    def getService(self, request: Any, caller: Caller) -> Any:
        if request.name == "sensorservice":
            check_version(interface_of(SENSORS), request.interface)
        return service_manager_pb2.ServiceInfo(boot_id=b"0123456789abcdef")

    def bindService(self, request: Any, caller: Caller) -> Any:
        caller.peer.link_to_death(lambda peer: self.died.put(peer.pid))
        self.bound.put(caller)
        return EMPTY

    def unbindService(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def startService(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def stopService(self, request: Any, caller: Caller) -> Any:
        return service_manager_pb2.StopReply()

    def getStatus(self, request: Any, caller: Caller) -> Any:
        return service_manager_pb2.ServiceStatus(pid=caller.pid, connections=caller.uid)


class Sensors(Stub):
    """Answers with what a test puts into `answer` or raises what it puts into `error`."""

    descriptor = SENSORS

    def __init__(self) -> None:
        self.answer: Any = sensors_pb2.SensorList()
        self.error: Exception | None = None
        self.calls = 0

    def getSensorList(self, request: Any, caller: Caller) -> Any:
        self.calls += 1
        if self.error is not None:
            raise self.error
        return self.answer

    def enableSensor(self, request: Any, caller: Caller) -> Any:
        listener = caller.peer.proxy(LISTENER, request.listener)
        for sequence in range(request.sampling_period_us):
            assert listener.onSensorEvents(events(sequence))
        return EMPTY

    def disableSensor(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def flush(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def getStatistics(self, request: Any, caller: Caller) -> Any:
        return sensors_pb2.Statistics()

    def getDynamicSensorList(self, request: Any, caller: Caller) -> Any:
        return sensors_pb2.SensorList()

    def registerDynamicSensorCallback(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def unregisterDynamicSensorCallback(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def setEnvironment(self, request: Any, caller: Caller) -> Any:
        return EMPTY

    def dump(self, request: Any, caller: Caller) -> Any:
        return sensors_pb2.DumpReply()


class Listener(Stub):
    """Keeps the sequence numbers of what it is sent."""

    descriptor = LISTENER

    def __init__(self, error: Exception | None = None) -> None:
        self.sequences: list[int] = []
        self.callers: list[Caller] = []
        self.error = error

    def onSensorEvents(self, request: Any, caller: Caller) -> None:
        self.sequences.append(request.header.sequence)
        self.callers.append(caller)
        if self.error is not None:
            raise self.error


def events(sequence: int, dropped: int = 0, flushes: int = 0) -> Any:
    """A message without events; each flush-complete makes it a byte longer."""
    return events_pb2.SensorEvents(
        header=events_pb2.DeliveryHeader(sequence=sequence), events_dropped=dropped, flush_completes=[1] * flushes
    )


class ServerThread:
    """A server with the three test services, owned by a thread; `do` runs a function in it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.manager = Manager()
        self.sensors = Sensors()
        self.listener = Listener()
        self._work: queue.Queue[tuple[Callable[[Server], Any], Future[Any]]] = queue.Queue()
        self._wake_end, self._wait_end = socket.socketpair()
        self._ready: Future[None] = Future()
        self._stopping = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        self._ready.result(PATIENCE_S)

    def do(self, work: Callable[[Server], T]) -> T:
        done: Future[T] = Future()
        self._work.put((work, done))
        self._wake_end.send(b"x")
        return done.result(PATIENCE_S)

    def wait_until(self, held: Callable[[Server], bool]) -> None:
        deadline = time.monotonic() + PATIENCE_S
        while not self.do(held):
            assert time.monotonic() < deadline, "waited in vain"

    def peers(self) -> list[Peer]:
        return self.do(lambda server: list(server.peers.values()))

    def refused(self) -> int:
        return self.do(lambda server: server.parcels_refused)

    def stop(self) -> None:
        self._stopping = True
        self._wake_end.send(b"x")
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()
        self._wake_end.close()
        self._wait_end.close()

    def _run(self) -> None:
        context = sockets.context()
        try:
            server = Server(self.path, context)
        except BaseException as error:
            self._ready.set_exception(error)
            context.term()
            return
        server.add_service("servicemanager", self.manager)
        server.add_service("sensorservice", self.sensors)
        server.add_service("listener", self.listener)
        self._ready.set_result(None)
        poller = zmq.Poller()
        poller.register(self._wait_end.fileno(), zmq.POLLIN)
        for each in server.sockets:
            poller.register(each, zmq.POLLIN)
        while not self._stopping:
            more = server.process()
            timeout = 0 if more else None if server.retry_s is None else round(server.retry_s * 1000)
            if self._wait_end.fileno() in dict(poller.poll(timeout)):
                self._wait_end.recv(1)
                if not self._work.empty():
                    work, done = self._work.get()
                    try:
                        done.set_result(work(server))
                    except BaseException as error:
                        done.set_exception(error)
        server.close()
        context.term()


def pump(connection: Connection, held: Callable[[], bool]) -> None:
    """Let a connection work until `held`."""
    deadline = time.monotonic() + PATIENCE_S
    poller = zmq.Poller()
    for each in connection.sockets:
        poller.register(each, zmq.POLLIN)
    while True:
        more = connection.process()
        if held():
            return
        assert time.monotonic() < deadline, "waited in vain"
        poller.poll(0 if more else 100)


def get_service(connection: Connection, name: str = "sensorservice") -> Any:
    request = service_manager_pb2.GetServiceRequest(name=name, interface=interface_of(SENSORS).info)
    return connection.proxy(MANAGER, "servicemanager").getService(request)


def spawn(role: str, path: Path) -> subprocess.Popen[str]:
    """Start this file as a process of its own: `client`, `server`, `foreign-client` or `foreign-server`."""
    command = [sys.executable, __file__, role, str(path)]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


class RawClient:
    """Speaks ZMTP 3.0 byte by byte, and says in its READY what libzmq would never let it say."""

    def __init__(self, path: Path, **properties: bytes) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(str(path))
        self.socket.sendall(b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32))
        ready = b"\x05READY" + _property(b"Socket-Type", b"DEALER")
        for name, value in properties.items():
            ready += _property(name.encode().replace(b"_", b"-"), value)
        self.socket.sendall(b"\x04" + bytes([len(ready)]) + ready)
        assert len(self._receive(64)) == 64
        assert self._receive_any()[0] == 4

    def send(self, *frames: bytes) -> None:
        for index, frame in enumerate(frames):
            flags = 2 | (index < len(frames) - 1)
            self.socket.sendall(struct.pack(">BQ", flags, len(frame)) + frame)

    def receive_frame(self) -> tuple[int, bytes]:
        """Return flags and body of the next message frame; (-1, b"") once the connection is closed."""
        while (received := self._receive_any())[0] == 4:
            pass  # a heartbeat, not answered
        return received

    def close(self) -> None:
        self.socket.close()

    def _receive_any(self) -> tuple[int, bytes]:
        head = self._receive(2)
        if len(head) < 2:
            return -1, b""
        size = head[1] if not head[0] & 2 else struct.unpack(">Q", head[1:] + self._receive(7))[0]
        return head[0], self._receive(size)

    def _receive(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            try:
                part = self.socket.recv(size - len(data))
            except ConnectionError:
                part = b""
            if not part:
                break
            data += part
        return data


def _property(name: bytes, value: bytes) -> bytes:
    return bytes([len(name)]) + name + struct.pack(">I", len(value)) + value


def _run_client(path: Path) -> None:
    """Bind, say so, then obey: `close` ends the connection but not the process."""
    context = sockets.context()
    connection = Connection(path, context)
    pump(connection, lambda: connection.connected)
    connection.on_connected = lambda: print("connected", flush=True)
    connection.on_disconnected = lambda: print("disconnected", flush=True)
    connection.proxy(MANAGER, "servicemanager").bindService(service_manager_pb2.BindRequest())
    print("bound", flush=True)
    poller = zmq.Poller()
    poller.register(sys.stdin.fileno(), zmq.POLLIN)
    for each in connection.sockets:
        poller.register(each, zmq.POLLIN)
    while sys.stdin.fileno() not in dict(poller.poll()):
        connection.process()
    connection.close()
    print("closed", flush=True)
    sys.stdin.readline()
    sys.stdin.readline()


def _run_server(path: Path) -> None:
    server = ServerThread(path)
    print("ready", flush=True)
    sys.stdin.readline()
    server.stop()


def _run_foreign_client(path: Path) -> None:
    """Send a ping as another user, and say what comes back within a second: bytes, or nothing."""
    _become_nobody()
    with zmq.Context() as context, context.socket(zmq.DEALER) as dealer:
        dealer.setsockopt(zmq.LINGER, 0)
        dealer.connect(f"ipc://{path}")
        dealer.send(_ping())
        print(len(dealer.recv()) if dealer.poll(1000) else 0, flush=True)


def _run_foreign_server(path: Path) -> None:
    """Answer one ping as another user."""
    _become_nobody()
    with zmq.Context() as context, context.socket(zmq.ROUTER) as router:
        router.bind(f"ipc://{path}")
        os.chmod(path, 0o666)
        print("ready", flush=True)
        routing_id, call = router.recv_multipart()
        call_id = binder_pb2.Parcel.FromString(call).transaction.call_id
        reply = binder_pb2.Parcel(reply=binder_pb2.Reply(call_id=call_id))
        router.send_multipart([routing_id, reply.SerializeToString()])
        sys.stdin.readline()


def _become_nobody() -> None:
    # Only now: another user may not be able to read the interpreter.
    os.setgroups([])
    os.setgid(NOBODY)
    os.setuid(NOBODY)


def _ping() -> bytes:
    call = binder_pb2.Transaction(call_id=1, target="servicemanager", code=0x5F504E47)
    return binder_pb2.Parcel(transaction=call).SerializeToString()


PING = _ping()

if __name__ == "__main__":
    roles = {
        "client": _run_client,
        "server": _run_server,
        "foreign-client": _run_foreign_client,
        "foreign-server": _run_foreign_server,
    }
    roles[sys.argv[1]](Path(sys.argv[2]))
