"""Who is at the other end of each connection, as Android's package manager would tell."""

from posed.binder.peer import Peer
from posed.errors import InvalidArgumentError
from posed.proto import service_manager_pb2
from posed.sensors import Client

_LONGEST_NAME = 255
_MOST_PERMISSIONS = 100


class ClientRegistry:
    """What bound processes say of themselves, beside what the kernel says of them."""

    def __init__(self) -> None:
        self._clients: dict[Peer, Client] = {}

    def register(self, peer: Peer, request: service_manager_pb2.BindRequest) -> None:
        """Note who a peer is; raises InvalidArgumentError for a name that cannot be printed."""
        name = request.package_name
        if len(name) > _LONGEST_NAME or not name.isprintable():
            raise InvalidArgumentError(
                f"package name {name[:40]!r} has {len(name)} characters; give {_LONGEST_NAME} printable ones at most"
            )
        if len(request.permissions) > _MOST_PERMISSIONS:
            raise InvalidArgumentError(f"{len(request.permissions)} permissions; at most {_MOST_PERMISSIONS}")
        self._clients[peer] = Client(
            name or _unnamed(peer), peer.uid, peer.pid, request.target_sdk, frozenset(request.permissions)
        )

    def forget(self, peer: Peer) -> None:
        """Undo `register`; an unknown peer is left alone."""
        self._clients.pop(peer, None)

    def of(self, peer: Peer) -> Client:
        """Return who a peer is; one that has not bound is only known by its process."""
        return self._clients.get(peer) or Client(_unnamed(peer), peer.uid, peer.pid)


def _unnamed(peer: Peer) -> str:
    return f"process-{peer.pid}"
