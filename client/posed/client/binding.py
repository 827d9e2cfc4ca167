"""What a binding to the daemon is: its states, what a client does on it, and how the user's code is called."""

import logging
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from posed.client.service import Service

_log = logging.getLogger(__name__)


class ServiceState(Enum):
    """Where a binding stands (android.content.ServiceConnection)."""

    CONNECTING = "connecting"
    """No daemon has answered yet."""
    CONNECTED = "connected"
    DISCONNECTED = "disconnected"
    """The daemon crashed or was killed; the binding stays and connects again by itself."""
    BINDING_DIED = "binding died"
    """The daemon ended on purpose or refused this client; it connects again when one comes that accepts it."""
    CLOSED = "closed"


class Binding(Protocol):
    """What a client does on its connection; every method is called on the service thread."""

    def bind(self, service: "Service") -> None:
        """Register with the daemon just connected."""

    def unbind(self, service: "Service") -> None:
        """Undo `bind` towards a daemon that is still there."""

    def release(self, service: "Service") -> None:
        """Close what `bind` opened on this side; the daemon may be gone."""


def call_back(callback: Callable[..., None], *arguments: Any) -> None:
    """Call the user's code; what it raises is logged with its name and harms nothing else."""
    try:
        callback(*arguments)
    except Exception:
        _log.exception("callback %s failed", getattr(callback, "__qualname__", callback))
