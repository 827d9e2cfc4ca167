"""`posed ar` as a user runs it, up to the browser."""

import json
import re
import select
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any

import pytest
from cli_shell import Shell
from websockets.sync.client import connect

from posed.client.launcher import daemon_listens

_PATIENCE_S = 30.0


class Browser:
    """Follows the link that a running `posed ar` prints, and keeps its cookie."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self._process = process
        self._cookies = CookieJar()
        self._opener = urllib.request.build_opener(
            urllib.request.ProxyHandler({}), urllib.request.HTTPCookieProcessor(self._cookies)
        )
        link = self.next_link()
        self.base = link.partition("?")[0]
        self.page = self.get(link)

    def next_link(self) -> str:
        stdout = self._process.stdout
        assert stdout is not None
        assert select.select([stdout], [], [], _PATIENCE_S)[0], "posed ar prints no link"
        found = re.search(r"http://\S+", stdout.readline())
        assert found, self._process.stderr
        return found[0]

    def get(self, url: str) -> str:
        with self._opener.open(url, timeout=_PATIENCE_S) as answer:
            return str(answer.read().decode())

    def json(self, path: str) -> Any:
        return json.loads(self.get(self.base + path))

    def frames_until(self, key: str) -> dict[str, Any]:
        """Return the next value of a key on the WebSocket."""
        cookie = "; ".join(f"{each.name}={each.value}" for each in self._cookies)
        url = self.base.replace("http", "ws") + "live"
        headers = {"Cookie": cookie}
        with connect(url, origin=self.base.rstrip("/"), additional_headers=headers, proxy=None) as socket:
            while True:
                frame: dict[str, Any] = json.loads(socket.recv(timeout=_PATIENCE_S))
                if key in frame:
                    return frame
                socket.send(json.dumps({"a": frame["i"]}))


@pytest.fixture(autouse=True)
def _data_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_brings_its_own_daemon_serves_page_and_poses_and_ends_in_order(shell: Shell, number: signal.Signals) -> None:
    process = shell.begin("ar", "--port", "0")
    browser = Browser(process)
    assert "<title>posed AR</title>" in browser.page
    pose = browser.frames_until("p")["p"]
    assert len(pose["q"]) == 4
    assert pose["m"] == "GAME"
    assert browser.frames_until("v")["v"]["name"] == "patonis2018"
    assert browser.next_link().partition("?")[0] == browser.base
    code, said = shell.end(process, number)
    assert (code, said) == (0, "")
    assert process.stdout is not None
    assert process.stdout.read() == ""


def test_the_daemon_it_brought_ends_with_it_and_the_users_own_stays(shell: Shell, eventually: Any) -> None:
    process = shell.begin("ar", "--port", "0")
    Browser(process).frames_until("p")
    shell.end(process, signal.SIGTERM)
    eventually(lambda: not daemon_listens())

    assert shell.run("start", "--position=1,2,3").returncode == 0
    process = shell.begin("ar", "--port", "0", "--mode", "fastest")
    browser = Browser(process)
    pose = browser.frames_until("p")["p"]
    assert pose["m"] == "FASTEST"
    observer = browser.frames_until("o")["o"]
    assert (observer["latitude"], observer["longitude"], observer["height"]) == (1, 2, 3)
    shell.end(process, signal.SIGTERM)
    assert daemon_listens()


@pytest.mark.parametrize(
    ("host", "base"),
    [("127.1", "http://127.0.0.1:"), ("LOCALHOST", "http://localhost:"), ("[0:0:0:0:0:0:0:1]", "http://[::1]:")],
)
def test_a_host_is_spelled_as_browsers_spell_it(shell: Shell, host: str, base: str) -> None:
    browser = Browser(shell.begin("ar", "--port", "0", "--host", host))
    assert browser.base.startswith(base)
    assert "<title>posed AR</title>" in browser.page


def test_a_reader_that_goes_after_the_first_link_ends_nothing(shell: Shell) -> None:
    process = shell.begin("ar", "--port", "0")
    assert process.stdout is not None
    link = process.stdout.readline().split()[-1]
    process.stdout.close()
    cookies = urllib.request.HTTPCookieProcessor(CookieJar())
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), cookies)
    assert b"<title>posed AR</title>" in opener.open(link, timeout=_PATIENCE_S).read()
    assert shell.end(process, signal.SIGTERM) == (0, "")


def test_places_that_cannot_be_shown_yet_are_said_with_the_remedy(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "mine.geojson").write_text('{"type": "Point", "coordinates": [22, 40, 10]}')
    process = shell.begin("ar", "--port", "0", "--places", str(tmp_path / "mine.geojson"))
    assert process.stderr is not None
    assert "with --position LAT,LON,HEIGHT" in process.stderr.readline()


def test_without_options_it_shows_the_sample_and_says_where_north_is(shell: Shell) -> None:
    process = shell.begin("ar", "--port", "0")
    browser = Browser(process)
    assert "Mount Olympus" in [place["name"] for place in browser.json("places.json")["places"]]
    settings = browser.json("settings.json")
    assert 5 < settings.pop("wmm_declination_deg") < 6
    assert settings == {"declination_deg": None, "position": None, "rate_mode": "GAME", "background": None}
    assert browser.json("corrections.json") == {"corrections": {}}


def test_what_the_user_states_reaches_the_page(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "mine.geojson").write_text('{"type": "Point", "coordinates": [410000, 4498000, 10]}')
    (tmp_path / "round.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (tmp_path / "kept.json").write_text('{"corrections": {"roof": {"heading_offset_deg": 7.3}}}')
    process = shell.begin(
        "ar",
        *("--port", "0", "--places", str(tmp_path / "mine.geojson"), "--crs", "EPSG:2100", "--heights", "geoid:43"),
        *("--panorama", str(tmp_path / "round.png"), "--declination=-3.5", "--position=-36.85,174.76,20"),
        *("--corrections", str(tmp_path / "kept.json"), "--mode", "ui"),
    )
    browser = Browser(process)
    (place,) = browser.json("places.json")["places"]
    assert 22 < place["coordinates"][0][0] < 24
    assert place["coordinates"][0][2] == 53
    settings = browser.json("settings.json")
    assert 19 < settings.pop("wmm_declination_deg") < 21
    assert settings == {
        "declination_deg": -3.5,
        "position": {"latitude": -36.85, "longitude": 174.76, "height": 20},
        "rate_mode": "UI",
        "background": "panorama",
    }
    assert "roof" in browser.json("corrections.json")["corrections"]
    request = urllib.request.Request(browser.base + "background")
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(request, timeout=_PATIENCE_S)
    assert browser._opener.open(request, timeout=_PATIENCE_S).headers["content-type"] == "image/png"


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (("--places", "nowhere.geojson"), 1, "cannot read nowhere.geojson: No such file or directory"),
        (("--crs", "EPSG:0"), 1, "--crs 'EPSG:0' is no coordinate reference system"),
        (("--heights", "sea"), 2, "'sea'; give ellipsoidal, or geoid:N"),
        (("--heights", "geoid:nan"), 2, "-120 to 120 m"),
        (("--panorama", "notes.txt"), 1, "notes.txt is no picture by its name"),
        (("--photo", "nowhere.jpg"), 1, "cannot read nowhere.jpg: No such file or directory"),
        (("--photo", "a.jpg", "--panorama", "b.jpg"), 2, "not allowed with argument"),
        (("--declination", "200"), 2, "'200' is no declination; give degrees from -180 to 180"),
        (("--position", "1,2"), 2, "'1,2' is no position; give LAT,LON,HEIGHT"),
        (("--host", "0.0.0.0"), 2, "stands for every address"),
        (("--host", "192.0.2.1", "--port", "0"), 1, "cannot listen at 192.0.2.1 port 0"),
        (("--port", "70000"), 2, "'70000' is no port; give 0 to 65535"),
        (("--mode", "turbo"), 2, "invalid choice: 'TURBO'"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, tuple) else "",
)
def test_a_bad_option_is_one_line_with_the_remedy(
    shell: Shell, options: tuple[str, ...], code: int, said: str, tmp_path: Path
) -> None:
    done = shell.run("ar", *options, cwd=tmp_path)
    assert done.returncode == code
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not daemon_listens()


def test_a_file_of_corrections_that_is_none_is_refused_before_anything_runs(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "kept.json").write_text("{")
    done = shell.run("ar", "--corrections", "kept.json", cwd=tmp_path)
    assert done.returncode == 1
    assert "kept.json holds no corrections" in done.stderr
    assert not daemon_listens()


def test_without_its_extra_it_says_what_to_install() -> None:
    script = "import sys; sys.modules['starlette'] = None\nimport posed.cli; sys.exit(posed.cli.main(['ar']))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=_PATIENCE_S)
    assert done.returncode == 1
    assert "posed ar needs starlette; install it with: pip install 'posed[web]'" in done.stderr


@pytest.mark.parametrize("words", [["--help"], ["ar", "--help"]])
def test_help_loads_no_web_library(words: list[str]) -> None:
    script = (
        "import sys, posed.cli\n"
        f"try: posed.cli.main({words})\n"
        "except SystemExit: pass\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=_PATIENCE_S)
    assert "AR page" in done.stdout or "georeferenced" in done.stdout
    loaded = {name.split(".")[0] for name in done.stderr.split()}
    assert not loaded & {"starlette", "uvicorn", "websockets", "pyproj", "pygeomag", "asyncio", "numpy"}
