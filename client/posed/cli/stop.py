"""`posed stop`: end the daemon and wait until it is gone."""

import argparse
import contextlib
import os
import select

from posed.cli.connection import connect, service_manager
from posed.client.launcher import daemon_listens
from posed.errors import InvalidStateError, ServiceUnavailableError
from posed.proto import binder_pb2, service_manager_pb2

_GONE_TIMEOUT_S = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --force."""
    parser.add_argument("--force", action="store_true", help="end it even under clients that keep it alive")
    parser.epilog = """\
Exit codes: 0 it is gone, or there was none; 1 bound clients keep it alive (it ends with the last of them); 69 it does
not answer."""


def run(arguments: argparse.Namespace) -> int:
    """Stop the daemon; to find none is success, as with systemctl."""
    if not daemon_listens():
        print("posed is not running")
        return 0
    with connect() as connection:
        manager = service_manager(connection)
        pid: int = manager.getStatus(binder_pb2.Empty()).pid
        # Taken before the call: afterwards the number could already be somebody else's.
        daemon = os.pidfd_open(pid)
        try:
            reply = manager.stopService(service_manager_pb2.StopRequest(force=arguments.force))
            if not reply.stopping:
                raise InvalidStateError(
                    f"{_clients(reply.bound_clients)} the daemon alive; it ends with the last of them, or now with"
                    " 'posed stop --force'"
                )
            _await_end(daemon, pid)
        finally:
            os.close(daemon)
    print(f"stopped: process {pid}")
    return 0


def _clients(count: int) -> str:
    return "1 bound client keeps" if count == 1 else f"{count} bound clients keep"


def _await_end(daemon: int, pid: int) -> None:
    with contextlib.closing(select.epoll()) as ended:
        ended.register(daemon, select.EPOLLIN)
        if not ended.poll(_GONE_TIMEOUT_S):
            raise ServiceUnavailableError(
                f"process {pid} was told to stop and is still there after {_GONE_TIMEOUT_S:g} s; end it with 'kill -9'"
            )
