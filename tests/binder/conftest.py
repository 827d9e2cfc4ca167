"""A server and a connection to it, over a real socket."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from binder_harness import ServerThread, get_service, pump

from posed.binder import sockets
from posed.binder.connection import Connection


@pytest.fixture
def socket_path() -> Iterator[Path]:
    """Where a control socket may stand: short, because tmp_path can be longer than a socket address."""
    with tempfile.TemporaryDirectory(prefix="posed-") as directory:
        yield Path(directory) / "control.sock"


@pytest.fixture
def server(socket_path: Path) -> Iterator[ServerThread]:
    server = ServerThread(socket_path)
    yield server
    server.stop()


@pytest.fixture
def context() -> Iterator[sockets.Context]:
    context = sockets.context()
    yield context
    context.destroy(linger=0)


@pytest.fixture
def unconnected(socket_path: Path, context: sockets.Context) -> Iterator[Connection]:
    """A connection to a daemon that may not be there yet."""
    connection = Connection(socket_path, context)
    yield connection
    connection.close()


@pytest.fixture
def connection(server: ServerThread, unconnected: Connection) -> Connection:
    """A connection to `server` that has got the services."""
    pump(unconnected, lambda: unconnected.connected)
    get_service(unconnected)
    get_service(unconnected, "listener")
    return unconnected
