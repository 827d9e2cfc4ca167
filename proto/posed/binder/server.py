"""The daemon's side: who is connected, what they call, and the way back to them."""

import logging
import os
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import zmq
from google.protobuf.message import DecodeError

from posed.binder.interface import interface_of
from posed.binder.parcel import MAX_PARCEL_BYTES, encode_reply
from posed.binder.peer import Peer
from posed.binder.runtime import bind_socket, unlink_socket
from posed.binder.sockets import Context, Socket, credentials, monitor_events, router
from posed.binder.status import ExceptionCode, status_of
from posed.binder.stub import META_CODES, BadTransactionError, Caller, Stub, dispatch
from posed.proto.binder_pb2 import Parcel, Transaction
from posed.proto.service_manager_pb2 import DESCRIPTOR as _SERVICE_MANAGER_FILE
from posed.proto.service_manager_pb2 import GetServiceRequest

__all__ = ["Peer", "Server"]

_log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Unsent:
    """Replies that found their peer's queue full."""

    parcels: deque[bytes] = field(default_factory=deque)
    bytes: int = 0


class Server:
    """The objects of this process, and the peers that call them. One thread owns it, and nothing in it waits.

    Poll `sockets` for input and call `process` when one is ready, or when `retry_s` has passed. Handlers and death
    recipients run inside `process` and nowhere else.
    """

    def __init__(self, socket_path: Path, context: Context) -> None:
        self._path = socket_path
        self._router: Socket = router(context)
        # From before the bind on, so that the first connection is not missed.
        self._monitor: Socket = self._router.get_monitor_socket(zmq.EVENT_ACCEPTED | zmq.EVENT_DISCONNECTED)
        self.sockets: list[Socket] = [self._router, self._monitor]
        self.parcels_refused = 0
        self._services: dict[str, Stub] = {}
        self._peers: dict[bytes, Peer] = {}
        self.peers: Mapping[bytes, Peer] = MappingProxyType(self._peers)
        # Every open connection by its file descriptor; None until its first message says which peer it is.
        self._connections: dict[int, Peer | None] = {}
        self._opened: dict[Peer, set[str]] = {}
        self._unsent: dict[Peer, _Unsent] = {}
        self._unreachable: list[Peer] = []
        try:
            bind_socket(self._router, socket_path)
        except BaseException:
            self._close_sockets()
            raise

    def add_service(self, name: str, stub: Stub) -> None:
        """Offer an object under a name."""
        self._services[name] = stub

    def process(self) -> bool:
        """Handle deaths, then calls, a bounded number of them; True if more are waiting."""
        self._read_monitor()
        for peer in list(self._unsent):
            self._send_unsent(peer)
        more = self._read_parcels()
        self._bury_unreachable()
        return more

    @property
    def retry_s(self) -> float | None:
        """When to call `process` again though no socket is ready: seconds from now, None if there is no need.

        A reply waits for room in the queue of a peer that reads too slowly; ZeroMQ does not tell when there is room.
        """
        return _RETRY_S if self._unsent else None

    def send(self, peer: Peer, parcel: bytes) -> bool:
        """Send a parcel; False if the peer's queue is full, or it is gone."""
        # What waits goes first, or calls would overtake the reply to an earlier one.
        return peer.alive and self._send_unsent(peer) and self._send_now(peer, parcel)

    def close(self) -> None:
        """Stop listening and remove the socket; what is queued still goes out for as long as LINGER allows."""
        self._close_sockets()
        unlink_socket(self._path)
        for peer in self._peers.values():
            peer.alive = False

    def _read_monitor(self) -> None:
        for event, fd in monitor_events(self._monitor):
            if event == zmq.EVENT_ACCEPTED:
                self._connections[fd] = None
            elif event == zmq.EVENT_DISCONNECTED:
                peer = self._connections.pop(fd, None)
                if peer is not None:
                    self._bury(peer)

    def _read_parcels(self) -> bool:
        for _ in range(_PARCELS_AT_ONCE):
            try:
                frames = self._router.recv_multipart(zmq.NOBLOCK, copy=False)
            except zmq.Again:
                return False
            peer = self._peers.get(frames[0].bytes) or self._admit(frames[0].bytes, frames[-1])
            if peer is None or len(frames) != 2 or not self._handle(peer, frames[1].bytes):
                self.parcels_refused += 1
        return True

    def _admit(self, routing_id: bytes, frame: zmq.Frame) -> Peer | None:
        """Return a new peer for the first parcel of a connection, None if it may not have one."""
        # The descriptor may be that of an earlier connection: its end is heard of before this one begins.
        self._read_monitor()
        # ZeroMQ's own ids are a zero byte and a 32-bit count; anything else was chosen by the other side.
        if len(routing_id) != 5 or routing_id[0] != 0:
            return None
        try:
            fd = frame.get(zmq.SRCFD)
            uid, pid = credentials(frame)
        except zmq.ZMQError:
            return None
        if uid != os.getuid() or fd not in self._connections:
            return None
        known = self._connections[fd]
        if known is not None:
            # Two peers on one descriptor: one of them spoke and died before its words were read. The ids count up.
            if _count(known.id) - _count(routing_id) & 0x80000000 == 0:
                return None
            self._bury(known)
        peer = Peer(routing_id, uid, pid, lambda parcel: self.send(peer, parcel))
        self._connections[fd] = peer
        self._peers[routing_id] = peer
        self._opened[peer] = set()
        return peer

    def _handle(self, peer: Peer, data: bytes) -> bool:
        """Carry out what a parcel asks and answer it; False if it is no call that can be carried out."""
        try:
            parcel = Parcel.FromString(data)
        except DecodeError:
            return False
        if parcel.WhichOneof("kind") != "transaction":
            return False
        call = parcel.transaction
        try:
            stub = self._target_of(peer, call, len(data))
            status, payload = dispatch(stub, call, Caller(peer))
        except BadTransactionError as error:
            if call.call_id:
                self._reply(peer, encode_reply(call.call_id, status_of(error)))
            return False
        if stub.interface is _SERVICE_MANAGER and call.code == _GET_SERVICE and status.exception_code == 0:
            self._opened[peer].add(GetServiceRequest.FromString(call.payload).name)
        if call.call_id:
            self._reply(peer, encode_reply(call.call_id, status, payload))
        return True

    def _target_of(self, peer: Peer, call: Transaction, size: int) -> Stub:
        if size > MAX_PARCEL_BYTES:
            raise BadTransactionError(
                ExceptionCode.TRANSACTION_FAILED, f"the call takes {size} bytes, a parcel can have {MAX_PARCEL_BYTES}"
            )
        stub = self._services.get(call.target)
        if stub is None:
            raise BadTransactionError(
                ExceptionCode.ILLEGAL_ARGUMENT,
                f"there is no object {call.target[:100]!r} here; there are {', '.join(self._services)}",
            )
        opened = stub.interface is _SERVICE_MANAGER or call.target in self._opened[peer]
        if not opened and call.code not in META_CODES:
            raise BadTransactionError(
                ExceptionCode.ILLEGAL_STATE,
                f"{call.target} was called before getService; call IServiceManager.getService for it first",
            )
        return stub

    def _reply(self, peer: Peer, parcel: bytes) -> None:
        if self.send(peer, parcel) or not peer.alive:
            return
        unsent = self._unsent.setdefault(peer, _Unsent())
        if unsent.bytes + len(parcel) <= _UNSENT_BYTES:
            unsent.parcels.append(parcel)
            unsent.bytes += len(parcel)
        else:
            _log.debug("%r reads none of its replies; one is dropped", peer)

    def _send_unsent(self, peer: Peer) -> bool:
        """Send the replies that found the queue full; False if one still does."""
        unsent = self._unsent.get(peer)
        if unsent is None:
            return True
        while unsent.parcels:
            if not self._send_now(peer, unsent.parcels[0]):
                return False
            unsent.bytes -= len(unsent.parcels.popleft())
        del self._unsent[peer]
        return True

    def _send_now(self, peer: Peer, parcel: bytes) -> bool:
        try:
            self._router.send_multipart([peer.id, parcel], zmq.NOBLOCK)
        except zmq.Again:
            return False
        except zmq.ZMQError as error:
            if error.errno != zmq.EHOSTUNREACH:
                raise
            # Buried at the end of process: its recipients may change what the sender is walking through.
            self._unreachable.append(peer)
            return False
        return True

    def _bury_unreachable(self) -> None:
        while self._unreachable:
            self._bury(self._unreachable.pop())

    def _bury(self, peer: Peer) -> None:
        self._peers.pop(peer.id, None)
        self._opened.pop(peer, None)
        self._unsent.pop(peer, None)
        if peer.alive:
            peer.die()

    def _close_sockets(self) -> None:
        # libzmq waits for room in the monitor's queue while it holds a lock that disable_monitor needs.
        for _ in monitor_events(self._monitor):
            pass
        self._router.disable_monitor()
        self._monitor.close()
        self._router.close()


def _count(routing_id: bytes) -> int:
    return int.from_bytes(routing_id[1:], "big")


_PARCELS_AT_ONCE = 100
_RETRY_S = 0.01
# What a peer that calls and never reads can make the daemon hold, beside its queue.
_UNSENT_BYTES = 4 * 1024 * 1024

_SERVICE_MANAGER = interface_of(_SERVICE_MANAGER_FILE.services_by_name["IServiceManager"])
_GET_SERVICE = _SERVICE_MANAGER.methods_by_name["getService"].code
