"""The AR page's server in this process, on a free port, with whatever feed a test gives it."""

import http.client
import threading
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

from websockets.sync.client import ClientConnection, connect

from posed.ar.app import ArContent, make_app
from posed.ar.corrections import CorrectionStore
from posed.ar.stream import Feed
from posed.web.server import LOOPBACK, guarded, listen, make_server

_PATIENCE_S = 20.0


class SilentFeed:
    """A feed that says what the test says, and keeps what it is asked."""

    def __init__(self) -> None:
        self.publish: Callable[[str, Any], None] = lambda key, value: None
        self.modes: list[str] = []
        self.wishes: list[bool] = []
        self.asked = threading.Condition()

    def start(self, publish: Callable[[str, Any], None]) -> None:
        self.publish = publish

    def set_rate_mode(self, mode: str) -> None:
        with self.asked:
            self.modes.append(mode)
            self.asked.notify_all()

    def want_truth(self, wanted: bool) -> None:
        with self.asked:
            self.wishes.append(wanted)
            self.asked.notify_all()

    def close(self) -> None:
        pass


class Served:
    """A running server; ends with the `with` block."""

    def __init__(self, feed: Feed, content: ArContent, corrections: CorrectionStore) -> None:
        self.links: list[str] = []
        self._bound = listen(LOOPBACK, 0)
        self.port: int = self._bound.getsockname()[1]
        self.authority = f"{LOOPBACK}:{self.port}"
        app = guarded(make_app(feed, content, corrections), self._bound, LOOPBACK, self.links.append)
        self._server = make_server(app)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._bound]})

    def __enter__(self) -> "Served":
        self._thread.start()
        deadline = time.monotonic() + _PATIENCE_S
        pause = threading.Event()
        while not self._server.started:
            assert time.monotonic() < deadline, "the server does not start"
            pause.wait(0.01)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.should_exit = True
        self._thread.join(_PATIENCE_S)
        self._bound.close()
        assert not self._thread.is_alive(), "the server does not end"

    def ask(
        self, path: str, method: str = "GET", body: str | None = None, headers: Mapping[str, str] | None = None
    ) -> tuple[int, dict[str, str], str]:
        """Return status, headers (names in lower case) and body of the answer."""
        connection = http.client.HTTPConnection(LOOPBACK, self.port, timeout=_PATIENCE_S)
        try:
            connection.request(method, path, body, dict(headers or {}))
            answer = connection.getresponse()
            return answer.status, {key.lower(): value for key, value in answer.getheaders()}, answer.read().decode()
        finally:
            connection.close()

    def follow(self, link: str) -> tuple[int, dict[str, str], str]:
        """Ask for a link that the server printed."""
        return self.ask(link.split(self.authority, 1)[1])

    def enter(self) -> dict[str, str]:
        """Follow the newest link; return what a page of this server would send along."""
        status, headers, _ = self.follow(self.links[-1])
        assert status == 303
        return {"Cookie": headers["set-cookie"].partition(";")[0], "Origin": f"http://{self.authority}"}

    def open(self, headers: Mapping[str, str]) -> ClientConnection:
        """Open the page's WebSocket."""
        sent = dict(headers)
        return connect(
            f"ws://{self.authority}/live", origin=sent.pop("Origin", None), additional_headers=sent, proxy=None
        )
