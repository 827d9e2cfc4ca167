"""The client's side: one connection to the daemon, its calls, and the objects the daemon calls back."""

import logging
import math
import os
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path

import zmq
from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.message import DecodeError

from posed.binder.interface import PING, interface_of
from posed.binder.parcel import encode_transaction
from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.binder.runtime import endpoint
from posed.binder.sockets import Context, Socket, credentials, dealer, monitor_events
from posed.binder.status import DeadObjectError, TransactionTimeoutError, raise_for
from posed.binder.stub import BadTransactionError, Caller, Stub, dispatch
from posed.errors import InvalidArgumentError, PosedError, RuntimeDirectoryError
from posed.proto.binder_pb2 import Parcel, Reply, Transaction

_log = logging.getLogger(__name__)


class Connection:
    """A connection that ZeroMQ makes in the background and remakes when it is lost. One thread owns it.

    Call `process`, then poll `sockets` for input, and so on. Callbacks, death recipients, `on_connected` and
    `on_disconnected` run inside `process`, in the order in which things happened: what arrives while a call waits for
    its reply is kept for the next `process`, so call that before polling again. `connected` tells the state of the
    moment. What the daemon knew of this client goes with the connection: on_connected must register it anew.
    """

    def __init__(self, socket_path: Path, context: Context) -> None:
        self._path = socket_path
        self._owner_pid = os.getpid()
        self._address = endpoint(socket_path)
        self._dealer: Socket = dealer(context)
        self._monitor: Socket = self._dealer.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_DISCONNECTED)
        self.sockets: list[Socket] = [self._dealer, self._monitor]
        self.on_connected: Callable[[], None] | None = None
        self.on_disconnected: Callable[[], None] | None = None
        self._poller = zmq.Poller()
        for socket in self.sockets:
            self._poller.register(socket, zmq.POLLIN)
        self._daemon: Peer | None = None
        self._callbacks: dict[str, Stub] = {}
        self._happened: deque[Callable[[], None]] = deque()
        self._replies: dict[int, Reply | None] = {}
        self._last_call_id = 0
        self._dealer.connect(self._address)

    @property
    def connected(self) -> bool:
        """True from the end of the handshake to the loss of the connection."""
        return self._daemon is not None

    def process(self) -> bool:
        """Dispatch what has happened; True if more has happened meanwhile."""
        self._check_owner()
        self._read()
        for _ in range(len(self._happened)):
            if self._happened:  # a handler may call process itself
                self._happened.popleft()()
        return bool(self._happened)

    def add_callback(self, name: str, stub: Stub) -> None:
        """Let the daemon call an object under a name; raises InvalidArgumentError if the name is taken."""
        if name in self._callbacks:
            raise InvalidArgumentError(f"this connection has a callback object {name!r} already; choose another name")
        self._callbacks[name] = stub

    def remove_callback(self, name: str) -> None:
        """Undo add_callback; calls still on their way are dropped. An unknown name is no error."""
        self._callbacks.pop(name, None)

    def proxy(self, descriptor: ServiceDescriptor, target: str, timeout_s: float = 2.0) -> Proxy:
        """Return an object of the daemon's; `timeout_s` is how long its calls wait unless they say otherwise."""
        return Proxy(interface_of(descriptor), target, self, timeout_s)

    def ping(self, timeout_s: float = 2.0) -> None:
        """Return when the daemon has answered; raises DeadObjectError or TransactionTimeoutError."""
        self.call("servicemanager", PING, b"", timeout_s)

    def link_to_death(self, recipient: Callable[[Peer], None]) -> None:
        """Have `recipient` called once, with the daemon, when this connection is lost.

        Raises DeadObjectError if it is not connected.
        """
        self._live_daemon().link_to_death(recipient)

    def unlink_to_death(self, recipient: Callable[[Peer], None]) -> bool:
        """Undo link_to_death; False if the recipient was not linked or the connection it was linked to is lost."""
        return self._daemon is not None and self._daemon.unlink_to_death(recipient)

    def close(self) -> None:
        """Close the sockets; in a forked child, whose parent still uses them, nothing is done."""
        if os.getpid() != self._owner_pid or self._dealer.closed:
            return
        # libzmq waits for room in the monitor's queue while it holds a lock that disable_monitor needs.
        for _ in monitor_events(self._monitor):
            pass
        self._dealer.disable_monitor()
        self._monitor.close()
        self._dealer.close()
        self._daemon = None

    def call(self, target: str, code: int, payload: bytes, timeout_s: float) -> bytes:
        """Make a synchronous call and return the serialised response; proxies call this."""
        deadline = time.monotonic() + timeout_s
        self._check_owner()
        self._read()
        daemon = self._live_daemon()
        call_id = self._last_call_id = self._last_call_id % 0xFFFFFFFF + 1
        parcel = encode_transaction(call_id, target, code, payload)
        self._replies[call_id] = None
        try:
            while not self._send_now(parcel):
                self._wait(zmq.POLLIN | zmq.POLLOUT, deadline, f"a call of {target!r} could not be sent")
                self._require_alive(daemon, target)
            while (reply := self._replies[call_id]) is None:
                self._require_alive(daemon, target)
                self._wait(zmq.POLLIN, deadline, f"{target!r} did not answer")
        finally:
            del self._replies[call_id]
        raise_for(reply.status)
        return reply.payload

    def post(self, target: str, code: int, payload: bytes) -> bool:
        """Send a oneway call; False if the queue is full, DeadObjectError if not connected; proxies call this."""
        self._check_owner()
        self._read()
        self._live_daemon()
        return self._send_now(encode_transaction(0, target, code, payload))

    def _read(self) -> None:
        lost = False
        for event, _value in monitor_events(self._monitor):
            if self._daemon is not None:
                # Its end, whichever event it is: a new handshake follows one that was not seen.
                self._lose(self._daemon)
                lost = True
            if event == zmq.EVENT_HANDSHAKE_SUCCEEDED:
                self._daemon = Peer(b"", _UNKNOWN, _UNKNOWN, self._send_if_connected)
                self._happened.append(self._tell_connected)
        if lost and self._daemon is None:
            # Calls that were not sent any more must not reach the next daemon. ZMQ_IMMEDIATE would see to it too, but
            # throws away with them what the last one sent and was not read yet: its farewell.
            self._dealer.disconnect(self._address)
            self._dealer.connect(self._address)
        self._read_parcels()

    def _lose(self, daemon: Peer) -> None:
        # What still arrived comes before the loss. None of it is from a later connection: on that one the daemon, not
        # called yet, has nothing to say.
        while self._read_parcels():
            pass
        self._happened.append(daemon.die)
        self._happened.append(self._tell_disconnected)
        self._daemon = None

    def _read_parcels(self) -> bool:
        """Take in what has arrived, a bounded number of parcels; True if there is more."""
        for _ in range(_PARCELS_AT_ONCE):
            try:
                frames = self._dealer.recv_multipart(zmq.NOBLOCK, copy=False)
            except zmq.Again:
                return False
            if self._daemon is not None and len(frames) == 1:
                self._take(frames[0], self._daemon)
        return True

    def _take(self, frame: zmq.Frame, daemon: Peer) -> None:
        if daemon.pid == _UNKNOWN:
            daemon.uid, daemon.pid = credentials(frame)
        if daemon.uid != os.getuid():
            raise RuntimeDirectoryError(
                f"{self._path} is served by user {daemon.uid}, not by {os.getuid()}; nothing it says is used"
            )
        try:
            parcel = Parcel.FromString(frame.bytes)
        except DecodeError:
            _log.warning("the daemon sent %d bytes that are no parcel", len(frame))
            return
        if parcel.WhichOneof("kind") == "transaction":
            self._happened.append(partial(self._call_back, parcel.transaction, Caller(daemon)))
        elif parcel.reply.call_id in self._replies:
            self._replies[parcel.reply.call_id] = parcel.reply
        # Any other reply came too late: its caller has stopped waiting.

    def _call_back(self, call: Transaction, caller: Caller) -> None:
        stub = self._callbacks.get(call.target)
        if stub is None or call.call_id:
            return
        try:
            dispatch(stub, call, caller)
        except BadTransactionError as error:
            _log.warning("the daemon made a bad call: %s", error)

    def _tell_connected(self) -> None:
        if self.on_connected is not None:
            self.on_connected()

    def _tell_disconnected(self) -> None:
        if self.on_disconnected is not None:
            self.on_disconnected()

    def _send_now(self, parcel: bytes) -> bool:
        try:
            self._dealer.send(parcel, zmq.NOBLOCK)
        except zmq.Again:
            return False
        return True

    def _send_if_connected(self, parcel: bytes) -> bool:
        return self._daemon is not None and self._send_now(parcel)

    def _wait(self, dealer_events: int, deadline: float, otherwise: str) -> None:
        """Wait until something happens and take it in; raises TransactionTimeoutError at the deadline."""
        remaining = deadline - time.monotonic()
        if remaining <= 0:
            raise TransactionTimeoutError(f"{otherwise} in time; the daemon is stopped, hung or overloaded")
        self._poller.modify(self._dealer, dealer_events)
        # Poller cuts off what is below a millisecond; rounded down, the last one would be spent spinning.
        self._poller.poll(math.ceil(remaining * 1000))
        self._read()

    def _live_daemon(self) -> Peer:
        if self._daemon is None:
            raise DeadObjectError(f"no daemon is connected at {self._path}; start one and wait for on_connected")
        return self._daemon

    def _require_alive(self, daemon: Peer, target: str) -> None:
        if self._daemon is not daemon:
            raise DeadObjectError(f"the daemon went away during a call of {target!r}; it may have been carried out")

    def _check_owner(self) -> None:
        if os.getpid() != self._owner_pid:
            raise PosedError(
                f"this connection belongs to process {self._owner_pid}, not to its fork {os.getpid()}; "
                "open one of its own there, with a context of its own"
            )


_PARCELS_AT_ONCE = 1000
_UNKNOWN = -1
