"""Readiness for systemd: the datagram protocol of sd_notify(3)."""

import logging
import os
import socket

_log = logging.getLogger(__name__)


def sd_notify(state: str) -> None:
    """Send `state` (such as READY=1) to the supervisor that NOTIFY_SOCKET names; without one do nothing."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as notify_socket:
        try:
            notify_socket.sendto(state.encode(), address)
        except OSError as error:
            # Who waited only for the readiness is gone by now; the service does not depend on being heard.
            _log.debug("%s not told to %s: %s", state, address, error)
