"""Serving a page: the socket first, so that the link is true, then uvicorn until a signal comes."""

import logging
import socket
from collections.abc import Callable
from pathlib import Path

import uvicorn
from starlette.routing import BaseRoute, Mount
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from posed.errors import InvalidArgumentError
from posed.web.access import Access

LOOPBACK = "127.0.0.1"
_SHARED = Path(__file__).with_name("page")


def shared_files() -> BaseRoute:
    """Return the route of what all pages share: /web/NAME."""
    return Mount("/web", StaticFiles(directory=_SHARED))


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens, so that who follows the link at once is let wait; port 0 takes any that is free.

    Raises InvalidArgumentError if it cannot be had.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        bound = socket.socket(family, socket.SOCK_STREAM)
        try:
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            bound.bind((host, port))
            bound.listen()
        except BaseException:
            bound.close()
            raise
    except UnicodeError as error:
        raise InvalidArgumentError(f"--host {host!r} is no name of a host: {error}") from error
    except OSError as error:
        raise InvalidArgumentError(
            f"cannot listen at {host} port {port}: {error.strerror}; give another --port (0 takes any that is free)"
        ) from error
    return bound


def guarded(app: ASGIApp, bound: socket.socket, host: str, tell_link: Callable[[str], None]) -> Access:
    """Return the app behind the token: reachable by the address it is bound to and, on loopback, as localhost."""
    port = bound.getsockname()[1]
    hosts = (host, "localhost") if host in (LOOPBACK, "::1") else (host,)
    return Access(app, hosts, port, tell_link)


def make_server(app: ASGIApp) -> uvicorn.Server:
    """Return a server for `app`, quiet but for warnings."""
    logging.getLogger("uvicorn").setLevel(logging.WARNING)
    return uvicorn.Server(
        uvicorn.Config(
            app,
            log_config=None,
            access_log=False,
            ws="websockets-sansio",
            # The kernel knows when a page on this machine is gone, and a tab that sleeps is to stay connected.
            ws_ping_interval=None,
            ws_max_size=4096,
            # Frames are too small to gain, and each page would cost 300 KB.
            ws_per_message_deflate=False,
            server_header=False,
            proxy_headers=False,
            timeout_graceful_shutdown=1,
        )
    )
