"""The alignment tool: overlays are dragged onto their objects with the mouse, and the pose's errors come out."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ar_turn import HERE, Step, SteppedFeed, places_around, simulate
from playwright.sync_api import Browser, Page
from pyproj import Transformer
from served import Served

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore

_TURNED_DEG = 7.3
_MOVED_M = (7.0, -9.7, 0.5)
_BEARINGS = {"Gate": 15.0, "Well": 80.0, "Oak": 160.0}
_DISTANCE_M = 120.0


def turned_by(steps: Sequence[Step], number: int) -> dict[str, Any]:
    """The truth as a pose, its heading 7.3 degrees too large, the phone held still."""
    truth = steps[number].truth
    # Against magnetic north headings are smaller by the declination, and about up the turn is the other way round.
    half = math.radians(truth["d"] - _TURNED_DEG) / 2
    x, y, z, w = truth["q"]
    s, c = math.sin(half), math.cos(half)
    q = [c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z]
    return {**steps[number].pose, "q": q, "w": [0.0, 0.0, 0.0]}


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    return simulate("compass", 26)


@pytest.fixture
def corrections(tmp_path: Path) -> Path:
    return tmp_path / "corrections.json"


@pytest.fixture
def feed(steps: list[Step], request: pytest.FixtureRequest) -> SteppedFeed:
    moved = list(request.param)
    return SteppedFeed([replace(step, truth={**step.truth, "e": moved}) for step in steps])


@pytest.fixture
def page(browser: Browser, feed: SteppedFeed, corrections: Path) -> Iterator[Page]:
    content = ArContent(places_around(_BEARINGS, _DISTANCE_M, 15.0), {})
    with Served(feed, content, CorrectionStore(corrections)) as served:
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(served.links[-1])
        page.wait_for_function("() => window.posedAr !== undefined")
        with feed.asked:
            assert feed.asked.wait_for(lambda: feed.wishes[-1:] == [True], 20)
        yield page
        page.close()


def _look_at(page: Page, feed: SteppedFeed, bearing: float) -> None:
    off = [abs((step.heading - bearing + 180) % 360 - 180) for step in feed.steps]
    number = int(np.argmin(off))
    feed.show(number, turned_by)
    page.wait_for_function("n => posedAr.pose?.sequence === n", arg=feed.steps[number].pose["n"])
    _await_drawn(page)


def _await_drawn(page: Page) -> None:
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def _drag(page: Page, name: str) -> None:
    """Drag a place's dot onto the green ring that marks the object."""
    (label,) = [label for label in page.evaluate("() => posedAr.labels") if label["name"] == name]
    truth = label["truth"]
    page.mouse.move(label["x"], label["y"])
    page.mouse.down()
    page.mouse.move((label["x"] + truth["x"]) / 2, (label["y"] + truth["y"]) / 2)
    page.mouse.move(truth["x"], truth["y"])
    page.mouse.up()
    _await_drawn(page)


def _correction(page: Page) -> Any:
    return page.evaluate("() => posedAr.correction")


def _start_dragging(page: Page) -> None:
    page.keyboard.press("c")
    page.locator("#drag").click()
    page.keyboard.press("Escape")


@pytest.mark.parametrize("feed", [(0.0, 0.0, 0.0)], indirect=True, ids=["at the spot"])
def test_one_drag_takes_a_heading_error_out_and_it_can_be_saved(
    page: Page, feed: SteppedFeed, corrections: Path
) -> None:
    _look_at(page, feed, _BEARINGS["Well"])
    _start_dragging(page)
    _drag(page, "Well")
    assert abs(_correction(page)["headingOffsetDeg"] + _TURNED_DEG) < 0.2
    _look_at(page, feed, _BEARINGS["Oak"])
    (oak,) = [label for label in page.evaluate("() => posedAr.labels") if label["name"] == "Oak"]
    assert math.hypot(oak["x"] - oak["truth"]["x"], oak["y"] - oak["truth"]["y"]) < 4

    page.keyboard.press("c")
    page.get_by_label("Name of the correction").fill("Balcony, צפון")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_role("button", name="Load Balcony, צפון").wait_for()
    kept = json.loads(corrections.read_text())["corrections"]["Balcony, צפון"]
    assert abs(kept["heading_offset_deg"] + _TURNED_DEG) < 0.2
    page.locator("#reset").click()
    assert _correction(page)["headingOffsetDeg"] == 0
    page.get_by_role("button", name="Load Balcony, צפון").click()
    assert _correction(page)["headingOffsetDeg"] == pytest.approx(kept["heading_offset_deg"])


@pytest.mark.parametrize("feed", [_MOVED_M], indirect=True, ids=["12 m off"])
def test_three_alignments_take_position_and_heading_errors_out(page: Page, feed: SteppedFeed) -> None:
    _look_at(page, feed, _BEARINGS["Gate"])
    _start_dragging(page)
    for name, bearing in _BEARINGS.items():
        _look_at(page, feed, bearing)
        _drag(page, name)
    page.keyboard.press("c")
    page.locator("#solve-both").click()
    found = _correction(page)
    assert abs(found["headingOffsetDeg"] + _TURNED_DEG) < 0.2
    topocentric = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 +step"
        f" +proj=topocentric +ellps=WGS84 +lon_0={HERE['longitude']} +lat_0={HERE['latitude']} +h_0={HERE['height']}"
    )
    moved = topocentric.transform(*(found["position"][key] for key in ("longitude", "latitude", "height")))
    assert math.dist(moved, _MOVED_M) < 0.5
    assert "moved 12.0 m" in page.locator("#solution").inner_text()
    for name, bearing in _BEARINGS.items():
        _look_at(page, feed, bearing)
        (label,) = [label for label in page.evaluate("() => posedAr.labels") if label["name"] == name]
        assert math.hypot(label["x"] - label["truth"]["x"], label["y"] - label["truth"]["y"]) < 6


@pytest.mark.parametrize("feed", [(0.0, 0.0, 0.0)], indirect=True, ids=["at the spot"])
def test_a_correction_by_numbers_holds_and_a_bad_number_is_told(page: Page, feed: SteppedFeed) -> None:
    _look_at(page, feed, _BEARINGS["Gate"])
    page.keyboard.press("c")
    page.get_by_label("Heading offset").fill("7° 18′ W")
    page.get_by_role("button", name="Apply").click()
    assert _correction(page)["headingOffsetDeg"] == pytest.approx(-_TURNED_DEG)
    page.get_by_label("Latitude").fill("91")
    page.get_by_role("button", name="Apply").click()
    assert "latitude is a number from −90 to 90" in page.locator("#numbers-error").inner_text()
    assert _correction(page)["position"] is None
