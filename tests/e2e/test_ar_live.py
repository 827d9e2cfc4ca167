"""`posed ar` over a real daemon, in a real browser."""

import json
import os
import re
import signal
import statistics
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from ar_turn import HERE, QUARTERS, places_around
from conftest import Desk
from playwright.sync_api import Browser, Page

_POSITION = ",".join(str(HERE[key]) for key in ("latitude", "longitude", "height"))
_PATIENCE_MS = 20_000

Open = Callable[..., Page]


@pytest.fixture
def open_page(desk: Desk, browser: Browser, tmp_path: Path) -> Iterator[Open]:
    """Start `posed ar` and open its page."""
    opened = []

    def open_page(*arguments: str) -> Page:
        places = tmp_path / "places.geojson"
        features = [
            {
                "type": "Feature",
                "properties": {"name": place["name"]},
                "geometry": {"type": "Point", "coordinates": place["coordinates"][0]},
            }
            for place in places_around(QUARTERS)["places"]
        ]
        places.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
        corrections = tmp_path / "corrections.json"
        words = ["ar", "--port=0", f"--places={places}", f"--corrections={corrections}", *arguments]
        process = desk.spawn([sys.executable, "-m", "posed.cli", *words])
        assert process.stdout is not None
        link = re.search(r"http://\S+", process.stdout.readline())
        assert link is not None
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        opened.append(page)
        page.goto(link[0])
        page.wait_for_function("() => window.posedAr?.pose?.isStale === false", timeout=_PATIENCE_MS)
        return page

    yield open_page
    for page in opened:
        page.close()


_LOOK = """() => {
  window.looked = { North: [], East: [], South: [], West: [] };
  const look = () => {
    const { width, f } = posedAr.camera;
    for (const { name, x, y, truth } of posedAr.labels) {
      if (!truth?.visible || Math.abs(truth.x - width / 2) > 40) continue;
      looked[name].push((Math.atan(Math.hypot(x - truth.x, y - truth.y) / f) * 180) / Math.PI);
    }
    requestAnimationFrame(look);
  };
  look();
}"""


def test_while_the_phone_turns_through_all_quarters_labels_stay_on_their_objects(desk: Desk, open_page: Open) -> None:
    desk.serve("--source", "sim:compass", "--position", _POSITION)
    page = open_page()
    # Between poses the phone turns by 1.5 degrees; brought forward by its own rate the overlay turns along.
    page.keyboard.press("e")
    page.wait_for_function("() => posedAr.pose.sequence > 50", timeout=_PATIENCE_MS)  # the filter has settled
    page.evaluate(_LOOK)
    page.wait_for_function("() => Object.values(looked).every((errors) => errors.length > 4)", timeout=60_000)
    looked: dict[str, list[float]] = page.evaluate("looked")
    middle = {name: statistics.median(errors) for name, errors in looked.items()}
    assert max(middle.values()) < 1.0, middle


def test_a_daemon_that_is_killed_is_told_and_its_return_too_without_a_reload(desk: Desk, open_page: Open) -> None:
    daemon = desk.serve("--source", "sim:still", "--position", _POSITION)
    page = open_page()
    page.evaluate("() => { window.mark = 'the same page' }")
    assert page.locator("#banner").is_hidden()
    daemon.kill()
    daemon.wait()
    page.locator("#banner", has_text="Daemon died").wait_for(timeout=_PATIENCE_MS)
    page.wait_for_function("() => posedAr.pose.isStale", timeout=_PATIENCE_MS)
    assert page.evaluate("() => posedAr.link.state") == "DISCONNECTED"
    desk.serve("--source", "sim:still", "--position", _POSITION)
    page.wait_for_function("() => posedAr.pose.isStale === false", timeout=_PATIENCE_MS)
    page.locator("#banner").wait_for(state="hidden", timeout=_PATIENCE_MS)
    assert page.evaluate("() => window.mark") == "the same page"


def test_a_server_that_ends_is_told(open_page: Open, desk: Desk) -> None:
    page = open_page()
    desk._processes[-1].send_signal(signal.SIGTERM)
    page.locator("#banner", has_text="posed ar does not answer").wait_for(timeout=_PATIENCE_MS)


def test_the_page_switches_the_rate_mode(desk: Desk, open_page: Open) -> None:
    desk.serve("--source", "sim:still")
    page = open_page("--mode", "UI")
    assert page.evaluate("() => posedAr.pose.rateMode") == "UI"
    for mode in ("FASTEST", "NORMAL"):
        page.get_by_role("button", name=mode).click()
        page.wait_for_function("mode => posedAr.pose.rateMode === mode", arg=mode, timeout=_PATIENCE_MS)
        page.locator(f"[data-mode={mode}][aria-pressed=true]").wait_for(timeout=_PATIENCE_MS)


_NOTE = """() => {
  window.shown = [];
  const note = () => {
    if (shown.at(-1) !== posedAr.pose.sequence) shown.push(posedAr.pose.sequence);
    requestAnimationFrame(note);
  };
  note();
}"""


def test_a_tab_that_was_stopped_shows_the_newest_pose_when_it_wakes(
    desk: Desk, browser: Browser, open_page: Open
) -> None:
    desk.serve("--source", "sim:still")
    page = open_page()
    page.evaluate(_NOTE)
    processes = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    renderers = [int(process["id"]) for process in processes if process["type"] == "renderer"]
    for pid in renderers:
        os.kill(pid, signal.SIGSTOP)
    try:
        watched = desk.posed("watch", "--json", "--count", "30")
    finally:
        for pid in renderers:
            os.kill(pid, signal.SIGCONT)
    first, *_, newest = (json.loads(line)["sequence"] for line in watched.stdout.splitlines())
    page.wait_for_function("newest => posedAr.pose.sequence >= newest", arg=newest, timeout=_PATIENCE_MS)
    # Two frames were under way when it stopped; of all the others it is not shown any but the newest.
    shown = [sequence for sequence in page.evaluate("() => shown") if first < sequence < newest]
    assert len(shown) <= 2, (first, newest, shown)


def test_without_a_daemon_the_page_brings_one_and_brings_it_back(desk: Desk, open_page: Open) -> None:
    page = open_page()
    first = desk.daemon_pid
    page.wait_for_function("() => posedAr.pose.sequence > 20", timeout=_PATIENCE_MS)
    os.kill(first, signal.SIGKILL)
    page.wait_for_function("() => posedAr.pose.sequence < 20", timeout=_PATIENCE_MS)
    assert desk.daemon_pid != first
