"""The process at the other end of a connection: who it is, how to call it, and word of its death."""

import logging
from collections.abc import Callable

from google.protobuf.descriptor import ServiceDescriptor

from posed.binder.interface import interface_of
from posed.binder.parcel import encode_transaction
from posed.binder.proxy import Proxy
from posed.binder.status import DeadObjectError, ExceptionCode, RemoteError
from posed.errors import InvalidArgumentError

_log = logging.getLogger(__name__)

# A name stands before every parcel to its object: a long one would leave a full message no room in 64 KiB.
_LONGEST_NAME = 255


class Peer:
    """One connection's other end. uid and pid come from the kernel and are those of the moment it connected."""

    def __init__(self, id: bytes, uid: int, pid: int, send: Callable[[bytes], bool]) -> None:
        self.id = id
        self.uid = uid
        self.pid = pid
        self.alive = True
        self._send = send
        self._recipients: list[Callable[[Peer], None]] = []

    def __repr__(self) -> str:
        return f"Peer(id={self.id.hex()}, uid={self.uid}, pid={self.pid}, alive={self.alive})"

    def link_to_death(self, recipient: "Callable[[Peer], None]") -> None:
        """Have `recipient` called once, with the peer, when that dies; linking it again changes nothing.

        Raises DeadObjectError if the peer is dead already.
        """
        if not self.alive:
            raise DeadObjectError(f"process {self.pid} is gone already; its death cannot be waited for")
        if recipient not in self._recipients:
            self._recipients.append(recipient)

    def unlink_to_death(self, recipient: "Callable[[Peer], None]") -> bool:
        """Undo link_to_death; False if the recipient was not linked or has been called already."""
        if recipient not in self._recipients:
            return False
        self._recipients.remove(recipient)
        return True

    def proxy(self, descriptor: ServiceDescriptor, target: str) -> Proxy:
        """Return an object of the peer's, for its oneway calls.

        Raises InvalidArgumentError if the peer gave it no name, or one that is too long.
        """
        if not 0 < len(target) <= _LONGEST_NAME:
            raise InvalidArgumentError(
                f"the name {target[:40]!r} of a callback object has {len(target)} characters; give 1 to {_LONGEST_NAME}"
            )
        return Proxy(interface_of(descriptor), target, self, timeout_s=0.0)

    def post(self, target: str, code: int, payload: bytes) -> bool:
        """Send a oneway call; False if it cannot be queued now or the peer is dead."""
        return self._send(encode_transaction(0, target, code, payload))

    def call(self, target: str, code: int, payload: bytes, timeout_s: float) -> bytes:
        """Refuse: waiting for one peer would hold up all the others."""
        raise RemoteError(
            ExceptionCode.UNSUPPORTED_OPERATION, f"{target!r} of process {self.pid} can only be called oneway"
        )

    def die(self) -> None:
        """Mark the peer dead and tell its recipients; one that raises does not keep the others from hearing."""
        self.alive = False
        while self._recipients:
            recipient = self._recipients.pop(0)
            try:
                recipient(self)
            except Exception:
                _log.exception("a death recipient of process %d failed", self.pid)
