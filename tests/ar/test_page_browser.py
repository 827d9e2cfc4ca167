"""What the AR page tells and draws, against the geodesist, the truth, and full turns about every axis."""

import csv
import io
import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ar_turn import Step, SteppedFeed, faithful, places_around, simulate
from PIL import Image
from playwright.sync_api import Browser, Page
from pyproj import Geod
from served import Served

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore
from posed.ar.places import SAMPLE, load_places

_AROUND = {"Gate": 350.0, "מגדל": 10.0, "Oak": 40.0, "Well": 200.0}


@pytest.fixture(scope="module")
def steps() -> list[Step]:
    return simulate("compass", 26)


Open = Callable[..., tuple[Page, SteppedFeed]]


@pytest.fixture
def open_page(browser: Browser, steps: list[Step], tmp_path: Path) -> Iterator[Open]:
    """Serve a page and open it; it looks north."""
    with ExitStack() as stack:

        def open_page(
            places: dict[str, Any] | None = None,
            settings: dict[str, Any] | None = None,
            background: Path | None = None,
            has_truth: bool = True,
            **context: Any,
        ) -> tuple[Page, SteppedFeed]:
            feed = SteppedFeed(steps, has_truth=has_truth)
            content = ArContent(places or places_around(_AROUND, 800.0, 60.0), settings or {}, background)
            served = stack.enter_context(Served(feed, content, CorrectionStore(tmp_path / "corrections.json")))
            opened = browser.new_context(**{"viewport": {"width": 1280, "height": 720}, **context})
            stack.callback(opened.close)
            page = opened.new_page()
            page.goto(served.links[-1])
            page.wait_for_function("() => window.posedAr !== undefined")
            if has_truth:
                with feed.asked:
                    assert feed.asked.wait_for(lambda: feed.wishes[-1:] == [True], 20)
            _look(page, feed, 0.0)
            return page, feed

        yield open_page


def _look(page: Page, feed: SteppedFeed, bearing: float) -> None:
    off = [abs((step.heading - bearing + 180) % 360 - 180) for step in feed.steps]
    number = int(np.argmin(off))
    feed.show(number, faithful)
    page.wait_for_function("n => posedAr.pose?.sequence === n", arg=feed.steps[number].pose["n"])
    _await_drawn(page)


def _await_drawn(page: Page) -> None:
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def _told(page: Page, what: str) -> Any:
    return page.evaluate("(what) => posedAr[what]", what)


def _labels(page: Page) -> dict[str, Any]:
    return {label["name"]: label for label in _told(page, "labels")}


def test_nothing_goes_wrong_behind_the_scenes(open_page: Open) -> None:
    page, _ = open_page(load_places(SAMPLE))
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.reload()
    page.wait_for_function("() => posedAr.pose?.isStale === false && posedAr.labels.length > 20")
    for key in ("b", "c", "s", "?", "Escape", "e", "+", "-", "ArrowLeft", "ArrowRight", "r", "1", "4"):
        page.keyboard.press(key)
        _await_drawn(page)
    assert said == []


def test_bearing_elevation_and_distance_are_those_of_the_geodesist(open_page: Open) -> None:
    page, _ = open_page()
    truth = json.loads(json.dumps(_labels(page)))
    assert all(truth[name] for name in ("Gate", "Oak"))
    for _ in _AROUND:
        page.keyboard.press("ArrowRight")
        _await_drawn(page)
        target = _told(page, "target")
        # The camera has moved a little with the hand: some centimetres of 800 m.
        assert abs((target["bearing"] - _AROUND[target["name"]] + 180) % 360 - 180) < 0.02
        assert target["distance"] == pytest.approx(math.hypot(800, 60), abs=0.5)
        assert target["elevation"] == pytest.approx(math.degrees(math.atan2(60, 800)), abs=0.02)


def test_the_field_book_is_kept_and_given_out_as_csv_and_geojson(open_page: Open, tmp_path: Path) -> None:
    page, _ = open_page()
    for _ in range(3):
        # Both before the next frame is drawn, as somebody who is quick has it on a slow machine.
        page.evaluate(
            """() => {
              for (const key of ["ArrowRight", "r"]) {
                document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
              }
            }"""
        )
    page.reload()
    page.keyboard.press("b")
    files = {}
    for kind in ("csv", "geojson"):
        with page.expect_download() as download:
            page.locator(f"#book-{kind}").click()
        assert download.value.suggested_filename.endswith(f".{kind}")
        download.value.save_as(tmp_path / kind)
        files[kind] = (tmp_path / kind).read_text()
    rows = list(csv.DictReader(io.StringIO(files["csv"])))
    features = json.loads(files["geojson"])["features"]
    assert [row["name"] for row in rows] == [feature["properties"]["name"] for feature in features]
    assert len(rows) == 3
    for row, feature in zip(rows, features, strict=True):
        longitude, latitude, _ = feature["geometry"]["coordinates"]
        here = (float(row["position_longitude"]), float(row["position_latitude"]))
        azimuth, _, distance = Geod(ellps="WGS84").inv(*here, longitude, latitude)
        assert abs((float(row["bearing_deg"]) - azimuth + 180) % 360 - 180) < 0.02
        assert float(row["distance_m"]) == pytest.approx(math.hypot(distance, 60), abs=0.5)
        assert row["rate_mode"] == "GAME"
        assert abs(float(row["declination_deg"]) - 5.5) < 0.01


def test_declination_is_applied_once_and_the_users_word_counts(open_page: Open) -> None:
    page, _ = open_page()
    assert _told(page, "declination") == {"deg": pytest.approx(5.5), "source": "truth"}
    heading = _told(page, "attitude")["heading"]
    assert abs((heading + 180) % 360 - 180) < 2
    page.keyboard.press("s")
    page.locator("[name=declination]").fill("1.5 W")
    page.keyboard.press("Tab")
    _await_drawn(page)
    assert _told(page, "declination") == {"deg": pytest.approx(-1.5), "source": "entered"}
    assert (heading - _told(page, "attitude")["heading"]) % 360 == pytest.approx(7.0, abs=1e-6)
    page.locator("[name=declination]").fill("north")
    page.keyboard.press("Tab")
    assert "is no declination" in page.locator("#settings-error").inner_text()


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"declination_deg": -3.5, "wmm_declination_deg": 5.4}, (-3.5, "given")),
        ({"declination_deg": None, "wmm_declination_deg": 5.4}, (5.4, "WMM 2025")),
        ({}, (0, "unknown")),
    ],
)
def test_without_a_truth_declination_is_the_given_then_the_models(
    open_page: Open, tmp_path: Path, settings: dict[str, Any], told: tuple[float, str]
) -> None:
    Image.new("RGB", (64, 36), "gray").save(tmp_path / "grey.png")
    page, _ = open_page(settings={**settings, "background": "photo"}, background=tmp_path / "grey.png", has_truth=False)
    page.wait_for_function("() => posedAr.view === 'photo'")
    assert _told(page, "declination") == {"deg": pytest.approx(told[0]), "source": told[1]}
    assert math.isnan(_told(page, "registration")["deg"])


@pytest.mark.parametrize("rotation", [90, 180, 270])
def test_the_screen_turns_and_the_world_stays(open_page: Open, rotation: int) -> None:
    page, _ = open_page(viewport={"width": 800, "height": 800})
    before = _labels(page)
    page.keyboard.press("s")
    page.locator("[name=rotation]").select_option(f"{rotation}")
    _await_drawn(page)
    assert _told(page, "camera")["rotation"] == rotation
    sine, cosine = round(math.sin(math.radians(rotation))), round(math.cos(math.radians(rotation)))
    for name in ("Gate", "מגדל"):
        right, up = before[name]["x"] - 400, 400 - before[name]["y"]
        after = _labels(page)[name]
        assert after["x"] - 400 == pytest.approx(cosine * right - sine * up, abs=0.01)
        assert 400 - after["y"] == pytest.approx(sine * right + cosine * up, abs=0.01)


_TRACE = """async ([poses, truths, rotation]) => {
  const { Camera } = await import("/page/camera.js");
  const { Projector } = await import("/page/projector.js");
  const camera = new Camera({ width: 1280, height: 720, fovDeg: 60, rotation });
  const world = new Projector(), overlay = new Projector();
  return poses.map((pose, i) => {
    world.aim(camera, truths[i], [0, 0, 0]);
    overlay.aim(camera, pose, [0, 0, 0]);
    const ahead = overlay.direction(world.axes[6], world.axes[7], world.axes[8]);
    return ahead ? [overlay.x - 640, overlay.y - 360] : null;
  });
}"""


@pytest.mark.parametrize("script", ["turn-x", "turn-y", "turn-z"])
def test_over_full_turns_about_each_axis_the_overlay_neither_flips_nor_jumps(open_page: Open, script: str) -> None:
    page, _ = open_page()
    turn = simulate(script, 40)
    poses = [_turned_about_up(step.pose["q"], -step.truth["d"]) for step in turn]
    for rotation in (0, 90, 180, 270):
        off = page.evaluate(_TRACE, [poses, [step.truth["q"] for step in turn], rotation])
        assert None not in off
        path = np.array(off)
        # 2 degrees of 1108 pixels' focal length, and 1 degree from one pose to the next: the turn itself takes 4.5.
        assert np.linalg.norm(path, axis=1).max() < 2.0 * 19.4 * 1.8
        assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 19.4 * 3.5


def _turned_about_up(q: Sequence[float], degrees: float) -> list[float]:
    half = math.radians(degrees) / 2
    x, y, z, w = q
    s, c = math.sin(half), math.cos(half)
    return [c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z]


def test_a_place_without_a_height_is_drawn_level_with_the_eye(open_page: Open) -> None:
    places = places_around({"Mark": 0.0})
    places["places"][0]["coordinates"][0][2] = None
    page, _ = open_page(places)
    page.keyboard.press("ArrowRight")
    _await_drawn(page)
    assert abs(_told(page, "target")["elevation"]) < 0.02


def test_extrapolation_brings_the_pose_forward_by_its_own_rate(open_page: Open) -> None:
    page, feed = open_page()
    heading = _told(page, "attitude")["heading"]
    page.wait_for_function("() => posedAr.delay.clockErrorMs < 50")
    page.keyboard.press("e")
    # 0.3 s old and more, turning right about the axis along the screen at 0.5 rad/s.
    sampled_ms = time.clock_gettime_ns(time.CLOCK_BOOTTIME) / 1e6 - 300
    number = min(range(len(feed.steps)), key=lambda at: abs((feed.steps[at].heading + 180) % 360 - 180))
    feed.show(number, lambda steps, at: {**steps[at].pose, "t": sampled_ms, "w": [0, -0.5, 0], "m": "UI"})
    page.wait_for_function("() => posedAr.pose.rateMode === 'UI'")
    _await_drawn(page)
    ahead = (_told(page, "attitude")["heading"] - heading + 180) % 360 - 180
    assert ahead > math.degrees(0.5 * 0.3) - 0.5


def test_a_camera_that_is_refused_is_told_and_the_world_stays(open_page: Open) -> None:
    page, _ = open_page()
    page.keyboard.press("s")
    page.locator("[name=view]").select_option("camera")
    page.locator("#notice", has_text="Showing the world").wait_for()
    assert _told(page, "view") == "world"
