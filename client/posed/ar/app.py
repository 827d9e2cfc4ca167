"""The AR client's web application: its page, its places, its corrections, and the values that flow to it."""

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from posed.ar.corrections import CorrectionStore
from posed.ar.stream import RATE_MODES, Feed
from posed.errors import InvalidArgumentError, PosedError
from posed.web.live import Handover, Hub, Outbox
from posed.web.server import shared_files

_PAGE = Path(__file__).with_name("page")
_MAX_BODY_BYTES = 4000


@dataclass(frozen=True)
class ArContent:
    """What the user gave the page to show: JSON of the places and settings, and a picture for the background."""

    places: dict[str, Any]
    settings: dict[str, Any]
    background: Path | None = None


def make_app(feed: Feed, content: ArContent, corrections: CorrectionStore) -> Starlette:
    """Return the application; the feed runs as long as it does."""
    return _Ar(feed, content, corrections).app


class _Ar:
    def __init__(self, feed: Feed, content: ArContent, corrections: CorrectionStore) -> None:
        self._feed = feed
        self._content = content
        self._corrections = corrections
        self._hub = Hub(lasting=("p", "s", "o", "v"))
        self._feeding: set[asyncio.Task[None]] = set()
        self.app = Starlette(
            routes=[
                Route("/", self._page),
                Route("/places.json", self._places),
                Route("/settings.json", self._settings),
                Route("/background", self._background),
                Route("/corrections.json", self._list_corrections),
                Route("/corrections/{name}", self._change_correction, methods=["PUT", "DELETE"]),
                WebSocketRoute("/live", self._live),
                Mount("/page", StaticFiles(directory=_PAGE)),
                shared_files(),
            ],
            exception_handlers={InvalidArgumentError: _refused, PosedError: _failed},
            lifespan=self._lifespan,
        )

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Starlette) -> AsyncIterator[None]:
        hand_over = Handover(
            asyncio.get_running_loop(), lambda key, value: self._hub.put(key, value, optional=key == "t")
        )
        await asyncio.to_thread(self._feed.start, hand_over)
        try:
            yield
        finally:
            # A page that goes meanwhile has a wish more.
            while self._feeding:
                await asyncio.wait(set(self._feeding))
            await asyncio.to_thread(self._feed.close)

    async def _page(self, request: Request) -> Response:
        return FileResponse(_PAGE / "index.html")

    async def _places(self, request: Request) -> Response:
        return JSONResponse(self._content.places)

    async def _settings(self, request: Request) -> Response:
        return JSONResponse(self._content.settings)

    async def _background(self, request: Request) -> Response:
        if self._content.background is None or not self._content.background.is_file():
            return Response(status_code=404)
        return FileResponse(self._content.background)

    async def _list_corrections(self, request: Request) -> Response:
        return JSONResponse({"corrections": await asyncio.to_thread(self._corrections.load)})

    async def _change_correction(self, request: Request) -> Response:
        name = request.path_params["name"]
        if request.method == "DELETE":
            await asyncio.to_thread(self._corrections.delete, name)
        else:
            await asyncio.to_thread(self._corrections.save, name, await _body(request))
        return await self._list_corrections(request)

    async def _live(self, socket: WebSocket) -> None:
        try:
            await self._hub.serve(socket, self._take_request)
        finally:
            self._follow_wishes()

    def _take_request(self, page: Outbox, request: dict[str, Any]) -> None:
        if "c" in request:
            page.put("c", {"c": request["c"], "b": time.clock_gettime_ns(time.CLOCK_BOOTTIME) / 1e6})
        if "t" in request:
            self._hub.want(page, "t", bool(request["t"]))
            self._follow_wishes()
        if "m" in request:
            mode = request["m"]
            if mode not in RATE_MODES:
                raise ValueError(f"rate mode {mode!r}; allowed: {', '.join(RATE_MODES)}")
            self._in_background(self._feed.set_rate_mode, mode)

    def _follow_wishes(self) -> None:
        self._in_background(self._feed.want_truth, "t" in self._hub.wanted)

    def _in_background(self, call: Any, argument: Any) -> None:
        """Make a call that may wait for the daemon, one after the other."""
        before = set(self._feeding)

        async def make() -> None:
            if before:
                await asyncio.wait(before)
            with contextlib.suppress(PosedError):  # the state that the page is told says why
                await asyncio.to_thread(call, argument)

        task = asyncio.ensure_future(make())
        self._feeding.add(task)
        task.add_done_callback(self._feeding.discard)


async def _body(request: Request) -> Any:
    received = b""
    async for piece in request.stream():
        received += piece
        if len(received) > _MAX_BODY_BYTES:
            raise InvalidArgumentError(f"a body of more than {_MAX_BODY_BYTES} bytes")
    try:
        return json.loads(received)
    except (ValueError, RecursionError) as error:
        raise InvalidArgumentError(f"the body is not JSON: {error}") from error


async def _refused(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, status_code=400)


async def _failed(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": str(error)}, status_code=500)
