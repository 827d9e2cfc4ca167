"""The ZeroMQ sockets of both sides, with every option that keeps them safe set in this one place."""

import os
import struct
from collections.abc import Iterator

import zmq
from google.protobuf.internal import api_implementation

from posed.errors import PosedError

Context = zmq.Context[zmq.Socket[bytes]]
Socket = zmq.Socket[bytes]


def context() -> Context:
    """Return a context; raises PosedError if libzmq or protobuf are not fit for input from strangers."""
    if zmq.zmq_version_info() < (4, 3, 5):
        raise PosedError(f"libzmq is {zmq.zmq_version()}, posed needs 4.3.5 or newer: install pyzmq 26 or newer")
    if api_implementation.Type() != "upb":
        # The pure Python decoder has no depth limit that holds against hostile input.
        raise PosedError(
            f"protobuf runs its {api_implementation.Type()!r} implementation, posed needs 'upb': "
            "unset PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION and install protobuf 6.33.5 or newer from a wheel"
        )
    # One I/O thread: monitor events and messages of a connection then keep the order in which they happened.
    made = zmq.Context(io_threads=1)
    made.set(zmq.BLOCKY, 0)
    return made


def router(context: Context) -> Socket:
    """The daemon's control socket: calls in, replies and callbacks out."""
    socket = _bound(context, zmq.ROUTER, high_water_mark=64)
    # A full or missing client shows as EAGAIN or EHOSTUNREACH instead of a silent drop.
    socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
    # A second client that claims a routing id in use must not take over the first one's replies.
    socket.setsockopt(zmq.ROUTER_HANDOVER, 0)
    socket.setsockopt(zmq.LINGER, _FAREWELL_MS)
    return socket


def dealer(context: Context) -> Socket:
    """The client's control socket."""
    # Once its receive queue is full, libzmq stops reading and with that answering heartbeats: the daemon cuts the
    # connection 1.9 s later. At 350 events/s, a message each, 1,000 give a busy client 3 s before that.
    socket = _connected(context, zmq.DEALER, high_water_mark=1000)
    socket.setsockopt(zmq.SNDHWM, 64)
    socket.setsockopt(zmq.LINGER, _FAREWELL_MS)
    _heartbeat(socket, _LEISURELY_MS)
    return socket


def xpub(context: Context) -> Socket:
    """The daemon's pose socket."""
    # A second of poses at 10 Hz: what a subscriber that stops reading can make the daemon hold.
    return _bound(context, zmq.XPUB, high_water_mark=10)


def sub(context: Context, conflate: bool) -> Socket:
    """A client's pose socket; `conflate` keeps only the newest message, of whatever topic, so one topic a socket."""
    socket = _connected(context, zmq.SUB, high_water_mark=10)
    if conflate:
        socket.setsockopt(zmq.CONFLATE, 1)
    return socket


def monitor_events(monitor: Socket) -> Iterator[tuple[int, int]]:
    """Yield the events that wait at a socket's monitor, with their values: of an accept or a loss, the descriptor.

    zmq.utils.monitor does the same but imports asyncio.
    """
    while True:
        try:
            event, _address = monitor.recv_multipart(zmq.NOBLOCK)
        except zmq.Again:
            return
        yield struct.unpack("=hi", event)


def credentials(frame: zmq.Frame) -> tuple[int, int]:
    """Return uid and pid of the process that sent a frame over ipc, as the kernel told libzmq when it connected."""
    _host, uid, _gid, pid = str(frame.get("Peer-Address")).rsplit(":", 3)
    return int(uid), int(pid)


# What a closing side may still have on its way: the daemon's farewell to its clients, a client's last oneway call.
_FAREWELL_MS = 200


def _bound(context: Context, kind: int, high_water_mark: int) -> Socket:
    socket = _socket(context, kind, high_water_mark)
    # On a pose socket a stopped client only costs what is sent in vain. Clients send no ping there: they see a stopped
    # daemon on the other.
    _heartbeat(socket, _SOON_MS if kind == zmq.ROUTER else _LEISURELY_MS)
    # The mode of the directory keeps strangers out; this is the lock behind it.
    socket.setsockopt(zmq.IPC_FILTER_UID, os.getuid())
    # What does not begin as ZMTP 3 passes for ZMTP 1, which has no heartbeat: an HTTP request would keep its connection
    # for ever. A domain for ZAP, though nobody serves it, makes libzmq refuse the old versions.
    socket.setsockopt(zmq.ZAP_DOMAIN, b"posed")
    return socket


# The daemon has a stopped client's registrations freed within 2 s. For a client the age of its poses tells sooner that
# a daemon stands still, and each ping wakes the daemon twice: a tenth of what a pose client costs it, at one a second.
_SOON_MS = 900
_LEISURELY_MS = 3000


def _heartbeat(socket: Socket, interval_ms: int) -> None:
    """Have a stopped process seen, which answers nothing but keeps its sockets open: a second after the next ping.

    Time to live would tell the other side without a ping of its own, but any message cancels it.
    """
    socket.setsockopt(zmq.HEARTBEAT_IVL, interval_ms)
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, 1000)


def _connected(context: Context, kind: int, high_water_mark: int) -> Socket:
    socket = _socket(context, kind, high_water_mark)
    socket.setsockopt(zmq.RECONNECT_IVL, 100)
    # A try costs microseconds on a Unix socket; half a second is what a returned daemon is missed for at most.
    socket.setsockopt(zmq.RECONNECT_IVL_MAX, 500)
    return socket


def _socket(context: Context, kind: int, high_water_mark: int) -> Socket:
    socket = context.socket(kind)
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.SNDHWM, high_water_mark)
    socket.setsockopt(zmq.RCVHWM, high_water_mark)
    # By default a frame that claims 1 GiB gets 1 GiB. Parcels end at 64 KiB.
    socket.setsockopt(zmq.MAXMSGSIZE, 128 * 1024)
    # Who connects and says nothing, or not ZMTP, is gone after this long.
    socket.setsockopt(zmq.HANDSHAKE_IVL, 500)
    return socket
