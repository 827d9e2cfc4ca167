"""Who may see a page."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest
from served import Served, SilentFeed
from starlette.applications import Starlette
from starlette.types import Message
from websockets.exceptions import InvalidStatus

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore
from posed.errors import InvalidArgumentError
from posed.web.access import Access
from posed.web.server import LOOPBACK, listen

_PATHS = ("/", "/places.json", "/settings.json", "/background", "/corrections.json", "/page/ar.css", "/web/base.css")


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    content = ArContent({"viewpoint": None, "places": []}, {})
    with Served(SilentFeed(), content, CorrectionStore(tmp_path / "corrections.json")) as served:
        yield served


def test_the_link_lets_one_browser_in_and_the_server_prints_the_next(served: Served) -> None:
    first = served.links[0]
    status, headers, _ = served.follow(first)
    assert (status, headers["location"]) == (303, "/")
    assert "httponly" in headers["set-cookie"].lower()
    assert "samesite=lax" in headers["set-cookie"].lower()
    assert served.ask("/", headers={"Cookie": headers["set-cookie"].partition(";")[0]})[0] == 200
    status, _, said = served.follow(first)
    assert status == 403
    assert "follow the newest" in said
    assert len(served.links) == 2
    assert served.follow(served.links[1])[0] == 303


@pytest.mark.parametrize("path", [*_PATHS, "/?token=", "/?token=AAAA", "/nothing"])
def test_who_has_no_session_sees_nothing(served: Served, path: str) -> None:
    # Another user of this machine reaches the port as well as its owner: over TCP nobody has a uid.
    status, _, said = served.ask(path)
    assert status == 403
    assert "link" in said


def test_who_has_no_session_gets_no_values(served: Served) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        served.open({"Origin": f"http://{served.authority}"})


@pytest.mark.parametrize("host", ["example.org", "127.0.0.1", "127.0.0.1:1", "localhost.example.org:{port}", ""])
def test_a_server_asked_by_another_name_refuses(served: Served, host: str) -> None:
    # A name of somebody else's that resolves to loopback would carry that somebody's pages past the origin check.
    cookie = served.enter()["Cookie"]
    status, _, said = served.ask("/", headers={"Cookie": cookie, "Host": host.format(port=served.port)})
    assert status == 403
    assert "does not answer for" in said


@pytest.mark.parametrize(
    ("host", "port", "base"),
    [
        ("127.0.0.1", 80, "http://127.0.0.1/"),
        ("127.0.0.1", 8474, "http://127.0.0.1:8474/"),
        ("::1", 80, "http://[::1]/"),
    ],
)
def test_the_port_of_http_is_left_out_as_browsers_do(host: str, port: int, base: str) -> None:
    links: list[str] = []
    access = Access(Starlette(), (host,), port, links.append)
    sent: list[Message] = []
    asked: list[Message] = [{"type": "lifespan.startup"}, {"type": "lifespan.shutdown"}, {"type": "http.request"}]

    async def receive() -> Message:
        return asked.pop(0)

    async def send(message: Message) -> None:
        sent.append(message)

    asyncio.run(access({"type": "lifespan"}, receive, send))
    (link,) = links
    assert link.startswith(f"{base}?token=")
    scope = {
        "type": "http",
        "method": "GET",
        "path": "/",
        "query_string": link.partition("?")[2].encode(),
        "headers": [(b"host", base.split("/")[2].encode())],
    }
    sent.clear()
    asyncio.run(access(scope, receive, send))
    assert sent[0]["status"] == 303


def test_on_loopback_it_is_localhost_too(served: Served) -> None:
    cookie = served.enter()["Cookie"]
    assert served.ask("/", headers={"Cookie": cookie, "Host": f"localhost:{served.port}"})[0] == 200


@pytest.mark.parametrize(
    "origin", [None, "null", "http://example.org", "https://{authority}", "http://localhost:{port}"]
)
def test_only_its_own_pages_change_anything(served: Served, origin: str | None) -> None:
    headers = served.enter()
    del headers["Origin"]
    if origin is not None:
        headers["Origin"] = origin.format(authority=served.authority, port=served.port)
    body = '{"heading_offset_deg": 1}'
    assert served.ask("/corrections/mine", "PUT", body, headers)[0] == 403
    assert served.ask("/corrections/mine", "DELETE", None, headers)[0] == 403
    with pytest.raises(InvalidStatus, match="403"):
        served.open(headers)
    assert '"mine"' not in served.ask("/corrections.json", headers=headers)[2]


@pytest.mark.parametrize(
    "path",
    [
        "/page/../app.py",
        "/page/..%2fapp.py",
        "/page/%2e%2e/app.py",
        "/page//etc/passwd",
        "/page/..\\app.py",
        "/web/../access.py",
        "/web/%2e%2e%2faccess.py",
        "/../../../../etc/passwd",
        "/background",
        "/page/",
        "/page",
    ],
)
def test_no_file_outside_the_pages_is_served(served: Served, path: str) -> None:
    status, _, said = served.ask(path, headers=served.enter())
    assert status in (307, 404)
    assert "import" not in said
    assert "root:" not in said


def test_a_picture_that_is_gone_meanwhile_is_not_found(tmp_path: Path) -> None:
    picture = tmp_path / "round.png"
    picture.write_bytes(b"")
    content = ArContent({"viewpoint": None, "places": []}, {}, picture)
    with Served(SilentFeed(), content, CorrectionStore(tmp_path / "corrections.json")) as served:
        headers = served.enter()
        assert served.ask("/background", headers=headers)[0] == 200
        picture.unlink()
        assert served.ask("/background", headers=headers)[0] == 404


def test_answers_forbid_what_no_page_needs(served: Served) -> None:
    for headers in (served.ask("/", headers=served.enter())[1], served.ask("/")[1]):
        assert headers["content-security-policy"].startswith("default-src 'self'")
        assert "frame-ancestors 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"
        assert headers["referrer-policy"] == "no-referrer"
        assert "server" not in headers


def test_a_host_that_no_name_can_be_is_named() -> None:
    with pytest.raises(InvalidArgumentError, match=r"--host 'a\.\.b' is no name of a host"):
        listen("a..b", 0)


def test_a_port_that_is_taken_is_named_with_the_remedy(served: Served) -> None:
    with pytest.raises(InvalidArgumentError, match=rf"{served.port}: Address already in use; give another --port"):
        listen(LOOPBACK, served.port)
