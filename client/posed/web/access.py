"""Who may see a page: whoever has followed the link that its server printed.

Loopback is open to every user of the machine, and through a browser to every site its user visits. So the link holds
a token that works once and buys a session cookie, requests have to name this server as their host, and those that
change something or open a WebSocket have to come from its own pages. Cookies know no ports: a browser sends the
session to every other server on the same host that its user visits as well, so visit none of somebody else's.
"""

import hmac
import secrets
from collections.abc import Callable
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_HARDENING = {
    "content-security-policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
_MAX_SESSIONS = 32


class Access:
    """ASGI middleware that lets in requests with a session, and hands a session out for the token in the link."""

    def __init__(self, app: ASGIApp, hosts: tuple[str, ...], port: int, tell_link: Callable[[str], None]) -> None:
        """hosts: names and addresses by which this server may be asked.

        tell_link: shows a link to the user, the first once the server runs and a signal ends it in order.
        """
        self._app = app
        # Browsers leave the port of http out.
        suffix = "" if port == 80 else f":{port}"
        self._authorities = frozenset(f"{_bracketed(host)}{suffix}" for host in hosts)
        self._base = f"http://{_bracketed(hosts[0])}{suffix}/"
        # Cookies know no ports: two servers on one host would overwrite each other's.
        self._cookie = f"posed-{port}"
        self._sessions: list[str] = []
        self._tell_link = tell_link
        self._token = secrets.token_urlsafe(32)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer 403 to whoever has no business here, hand the rest on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, self._telling(send))
            return
        headers = Headers(scope=scope)
        refusal = self._refusal(scope, headers)
        if refusal is None and scope["type"] == "http" and self._takes_token(scope):
            await self._open_session()(scope, receive, send)
        elif refusal is None and self._has_session(headers):
            await self._app(scope, receive, _hardened(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})  # before it was accepted: 403
        else:
            response = PlainTextResponse(f"{refusal or _NO_SESSION}\n", status_code=403)
            await response(scope, receive, _hardened(send))

    def _refusal(self, scope: Scope, headers: Headers) -> str | None:
        host = headers.get("host", "")
        if host not in self._authorities:
            return f"This server does not answer for {host!r}; use the link that it printed."
        if scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD"):
            origin = headers.get("origin", "")
            if origin != f"http://{host}":
                return f"A page of {origin or 'no origin'} may not do this; only this server's own pages may."
        return None

    def _takes_token(self, scope: Scope) -> bool:
        if scope["path"] != "/" or scope["method"] != "GET":
            return False
        given = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        return hmac.compare_digest(given.encode(), self._token.encode())

    def _open_session(self) -> RedirectResponse:
        session = secrets.token_urlsafe(32)
        self._sessions = [*self._sessions[1 - _MAX_SESSIONS :], session]
        self._renew_token()
        response = RedirectResponse("/", status_code=303)
        # Not strict: a link clicked on another site's page would be spent, and the browser not let in.
        response.set_cookie(self._cookie, session, httponly=True, samesite="lax")
        return response

    def _has_session(self, headers: Headers) -> bool:
        given = cookie_parser(headers.get("cookie", "")).get(self._cookie, "").encode()
        return any(hmac.compare_digest(given, session.encode()) for session in self._sessions)

    def _telling(self, send: Send) -> Send:
        async def send_and_tell(message: Message) -> None:
            await send(message)
            if message["type"] == "lifespan.startup.complete":
                self._renew_token()

        return send_and_tell

    def _renew_token(self) -> None:
        self._token = secrets.token_urlsafe(32)
        self._tell_link(f"{self._base}?token={self._token}")


_NO_SESSION = (
    "This page needs the link that its server printed, and that link works once: other users of this machine could"
    " guess the address, but not the link. The server prints a fresh one each time one was used; follow the newest."
)


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _hardened(send: Send) -> Send:
    async def send_hardened(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HARDENING.items():
                headers.setdefault(name, value)
        await send(message)

    return send_hardened
