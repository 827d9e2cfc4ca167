"""Values on their way to pages: the newest of each kind wins, so that a slow page is late by none and costs nothing."""

import asyncio
import json
import threading
from collections.abc import Callable, Iterable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

# A second frame may be under way while the first one's acknowledgement is; a page that has stopped holds up two.
_IN_FLIGHT = 2
_MAX_REQUEST_BYTES = 2000


class Outbox:
    """What one page has not been sent yet."""

    def __init__(self) -> None:
        self._values: dict[str, Any] = {}
        self._sent = 0
        self._acknowledged = 0
        self._ready = asyncio.Event()

    def put(self, key: str, value: Any) -> None:
        """Have `value` sent next, in place of an older one of the same key."""
        self._values[key] = value
        self._consider()

    def acknowledge(self, frame: int) -> None:
        """Take note that the page has the frame of that number, and all before it."""
        self._acknowledged = max(self._acknowledged, min(frame, self._sent))
        self._consider()

    async def next_frame(self) -> str:
        """Return the next frame as text, once there is something in it and the page keeps up."""
        await self._ready.wait()
        self._sent += 1
        frame = {"i": self._sent, **self._values}
        self._values = {}
        self._consider()
        return json.dumps(frame, separators=(",", ":"))

    def _consider(self) -> None:
        if self._values and self._sent - self._acknowledged < _IN_FLIGHT:
            self._ready.set()
        else:
            self._ready.clear()


class Hub:
    """Every page that is open, and the newest of the values that a page must have from its start."""

    def __init__(self, lasting: Iterable[str]) -> None:
        """lasting: keys whose newest value a page gets when it opens, however old it is."""
        self._lasting = frozenset(lasting)
        self._newest: dict[str, Any] = {}
        self._pages: dict[Outbox, set[str]] = {}

    @property
    def wanted(self) -> set[str]:
        """The optional keys that some page has asked for."""
        return set().union(*self._pages.values())

    def put(self, key: str, value: Any, *, optional: bool = False) -> None:
        """Send a value to every page; an optional one to those that want it."""
        if key in self._lasting:
            if self._newest.get(key) == value:
                return
            self._newest[key] = value
        for outbox, wants in self._pages.items():
            if not optional or key in wants:
                outbox.put(key, value)

    def want(self, outbox: Outbox, key: str, wanted: bool) -> None:
        """Have a page get an optional key, or not."""
        if wanted:
            self._pages[outbox].add(key)
        else:
            self._pages[outbox].discard(key)

    async def serve(self, socket: WebSocket, on_request: Callable[[Outbox, dict[str, Any]], None]) -> None:
        """Serve one page's WebSocket to its end; `on_request` gets what is no acknowledgement."""
        await socket.accept()
        outbox = Outbox()
        self._pages[outbox] = set()
        for key, value in self._newest.items():
            outbox.put(key, value)
        sending = asyncio.create_task(_send(socket, outbox))
        try:
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                request = _request(message.get("text"))
                frame = request.get("a")
                if isinstance(frame, int):
                    outbox.acknowledge(frame)
                else:
                    on_request(outbox, request)
        except ValueError as error:
            # The reason of a close frame has room for 123 bytes.
            await socket.close(1007, str(error).encode()[:120].decode(errors="ignore"))
        finally:
            sending.cancel()
            del self._pages[outbox]


class Handover:
    """Calls from another thread, made on the event loop: of calls with the same key, the newest before each turn."""

    def __init__(self, loop: asyncio.AbstractEventLoop, take: Callable[[str, Any], None]) -> None:
        self._loop = loop
        self._take = take
        self._waiting: dict[str, Any] = {}
        self._lock = threading.Lock()

    def __call__(self, key: str, value: Any) -> None:
        """Hand a value over; after the loop has ended it is lost."""
        with self._lock:
            is_first = not self._waiting
            self._waiting[key] = value
            if is_first and not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self._drain)

    def _drain(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for key, value in waiting.items():
            self._take(key, value)


async def _send(socket: WebSocket, outbox: Outbox) -> None:
    try:
        while True:
            await socket.send_text(await outbox.next_frame())
    except WebSocketDisconnect:
        pass


def _request(text: str | None) -> dict[str, Any]:
    if text is None:
        raise ValueError("a request in binary; send JSON as text")
    if len(text) > _MAX_REQUEST_BYTES:
        raise ValueError(f"a request of {len(text)} characters; at most {_MAX_REQUEST_BYTES}")
    try:
        request = json.loads(text)
    except RecursionError:
        raise ValueError("a request nested too deep") from None
    if not isinstance(request, dict):
        raise ValueError("a request must be a JSON object")
    # What is nested just deep enough to be read may be too deep to be sent back.
    if any(isinstance(value, dict | list) for value in request.values()):
        raise ValueError("a request holds numbers and text, nothing nested")
    return request
