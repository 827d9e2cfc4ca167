"""What a user does on the AR page, in a real browser: keys, targets, settings, and what is said when no pose comes."""

import json
import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from ar_turn import HERE, places_around
from playwright.sync_api import Browser, ConsoleMessage, Page, expect
from served import Served, SilentFeed

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore

_BEARINGS = {"Gate": 10.0, "Well": 80.0, "Oak": 200.0, "מגדל": 350.0}
_MAGNETIC_DEG = 2.0
_DECLINATION_DEG = 5.0


class UprightFeed(SilentFeed):
    """A phone that stands upright, its camera level; poses come ten times a second unless `pausing`."""

    def __init__(self) -> None:
        super().__init__()
        self.pausing = threading.Event()
        self._ended = threading.Event()
        self._posing = threading.Thread(target=self._pose)

    def start(self, publish: Callable[[str, Any], None]) -> None:
        super().start(publish)
        publish("v", {"name": "patonis2018", "fov_deg": 60.0, "rotation": 0})
        publish("o", {**HERE, "source": "stated", "wmm_declination_deg": None})
        self.tell("CONNECTED")
        self._posing.start()

    def tell(self, state: str) -> None:
        self.publish("s", {"state": state, "reason": ""})

    def close(self) -> None:
        self._ended.set()
        self._posing.join()

    def _pose(self) -> None:
        half = math.radians(-_MAGNETIC_DEG) / 2
        s, c, r = math.sin(half), math.cos(half), math.sqrt(0.5)
        pose = {"t": 0, "b": 0, "q": [r * c, r * s, r * s, r * c], "w": [0, 0, 0], "a": 1.0, "s": 0, "m": "GAME"}
        number = 0
        while not self._ended.wait(0.1):
            if not self.pausing.is_set():
                number += 1
                self.publish("p", {"n": number, **pose, "f": 14, "x": 0})


@pytest.fixture
def feed() -> UprightFeed:
    return UprightFeed()


@pytest.fixture
def page(browser: Browser, feed: UprightFeed, tmp_path: Path) -> Iterator[Page]:
    complaints: list[str] = []

    def take(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            complaints.append(message.text)

    content = ArContent(places_around(_BEARINGS), {"declination_deg": _DECLINATION_DEG})
    with Served(feed, content, CorrectionStore(tmp_path / "corrections.json")) as served:
        page = browser.new_page(viewport={"width": 1280, "height": 720}, reduced_motion="reduce")
        page.on("console", take)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(served.links[-1])
        page.wait_for_function("() => window.posedAr?.labels.length === 4")
        yield page
        page.close()
    # Among others of what the content security policy forbids.
    assert complaints == []


def _heading(page: Page) -> float:
    return float(page.evaluate("posedAr.attitude.heading"))


def test_keys_choose_targets_by_bearing_and_record_them(page: Page) -> None:
    names = []
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
        names.append(page.evaluate("posedAr.target?.name"))
    # The first from the camera's bearing, the others from the target before.
    assert names == ["Gate", "Well", "Oak", "Well"]
    page.keyboard.press("Enter")
    page.keyboard.press("b")
    expect(page.locator("#book-records li")).to_have_count(1)
    expect(page.locator("#book-records")).to_contain_text("Well")
    expect(page.locator("#book-title")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator("#book")).to_be_hidden()
    page.keyboard.press("Escape")
    page.wait_for_function("() => !posedAr.target?.held")


def test_the_field_book_outlives_a_reload_and_is_downloaded(page: Page) -> None:
    page.keyboard.press("ArrowRight")
    page.get_by_role("button", name="Record").click()
    page.reload()
    page.keyboard.press("b")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save GeoJSON").click()
    (sight,) = json.loads(Path(download.value.path()).read_text())["features"]
    assert sight["properties"]["name"] == "Gate"
    assert sight["properties"]["bearing_deg"] == pytest.approx(_BEARINGS["Gate"], abs=0.01)
    assert sight["properties"]["camera_bearing_deg"] == pytest.approx(_MAGNETIC_DEG + _DECLINATION_DEG, abs=0.01)


def test_the_target_is_shown_and_spoken(page: Page) -> None:
    page.keyboard.press("ArrowRight")
    expect(page.locator("#target-name")).to_have_text("Gate")
    expect(page.locator("#target-bearing")).to_have_text("10.00°")
    spoken = page.locator("#said[aria-live=polite]")
    expect(spoken).to_have_text("Gate, bearing 10.0°, elevation 8.0°, 808 m.", timeout=10_000)


def test_a_tap_holds_the_place_under_it_and_a_tap_on_nothing_lets_go(page: Page) -> None:
    (gate,) = [label for label in page.evaluate("posedAr.labels") if label["name"] == "Gate"]
    page.mouse.click(gate["x"], gate["y"])
    assert page.evaluate("posedAr.target.held")
    assert page.evaluate("posedAr.target.name") == "Gate"
    page.mouse.click(900, 500)
    page.wait_for_function("() => !posedAr.target?.held")


def test_what_is_behind_the_user_is_not_drawn(page: Page) -> None:
    visible = {label["name"]: label["visible"] for label in page.evaluate("posedAr.labels")}
    assert visible == {"Gate": True, "Well": False, "Oak": False, "מגדל": True}


def test_declination_is_added_once(page: Page) -> None:
    assert _heading(page) == pytest.approx(_MAGNETIC_DEG + _DECLINATION_DEG, abs=0.01)
    page.keyboard.press("s")
    page.get_by_label("Declination").fill("3° 30′ W")
    page.keyboard.press("Tab")
    page.wait_for_function("() => posedAr.declination.source === 'entered'")
    page.wait_for_function("() => posedAr.attitude.heading > 180")
    assert _heading(page) == pytest.approx(360 + _MAGNETIC_DEG - 3.5, abs=0.01)
    page.get_by_label("Declination").fill("much")
    page.keyboard.press("Tab")
    expect(page.locator("#settings-error")).to_contain_text("is no declination")
    assert page.evaluate("posedAr.declination.deg") == pytest.approx(-3.5)


def test_angles_are_shown_in_the_unit_that_was_chosen(page: Page) -> None:
    page.keyboard.press("ArrowRight")
    page.keyboard.press("s")
    page.get_by_label("Angles").select_option("gon")
    expect(page.locator("#target-bearing")).to_have_text("11.11 gon")
    page.get_by_label("Angles").select_option("dms")
    expect(page.locator("#target-bearing")).to_have_text("10° 00′ 00″")


def test_a_wider_view_shows_more(page: Page) -> None:
    page.keyboard.press("s")
    page.get_by_label("Field of view").fill("150")
    page.keyboard.press("Tab")
    # 73 degrees to the right.
    page.wait_for_function("() => posedAr.labels.find(({ name }) => name === 'Well').visible")
    page.get_by_label("Field of view").fill("200")
    page.keyboard.press("Tab")
    expect(page.locator("#settings-error")).to_contain_text("10 to 150")
    assert page.evaluate("posedAr.camera.fovDeg") == 150


def test_rate_modes_are_asked_for_by_button_and_by_key(page: Page, feed: UprightFeed) -> None:
    expect(page.get_by_role("button", name="GAME")).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="FASTEST").click()
    page.keyboard.press("1")
    with feed.asked:
        assert feed.asked.wait_for(lambda: feed.modes == ["FASTEST", "NORMAL"], 20), feed.modes


def test_poses_are_shown_as_they_come_unless_the_user_wants_them_brought_forward(page: Page) -> None:
    page.keyboard.press("s")
    expect(page.get_by_label("Extrapolate between poses")).not_to_be_checked()
    page.keyboard.press("Escape")
    page.keyboard.press("e")
    page.keyboard.press("s")
    expect(page.get_by_label("Extrapolate between poses")).to_be_checked()


def test_silence_is_told_and_goes_when_poses_come_again(page: Page, feed: UprightFeed) -> None:
    banner = page.locator("#banner")
    expect(banner).to_be_hidden()
    feed.pausing.set()
    expect(banner).to_contain_text("No pose arrives")
    expect(page.locator("#overlay")).to_have_class("stale")
    expect(page.locator("#brief")).to_contain_text("stale")
    feed.tell("DISCONNECTED")
    expect(banner).to_contain_text("Daemon died")
    feed.tell("CONNECTED")
    feed.pausing.clear()
    expect(banner).to_be_hidden()
    expect(page.locator("#overlay")).not_to_have_class("stale")


def test_with_nothing_new_nothing_is_drawn(page: Page, feed: UprightFeed) -> None:
    feed.pausing.set()
    expect(page.locator("#banner")).to_be_visible()
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    before = page.evaluate("posedAr.script.frames")
    page.evaluate("""() => new Promise((done) => {
        let left = 20;
        const next = () => (--left ? requestAnimationFrame(next) : done());
        next();
    })""")
    assert page.evaluate("posedAr.script.frames") == before


@pytest.mark.parametrize("size", [(360, 640), (640, 360), (1920, 1080)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_controls_lie_within_the_screen_and_are_large_enough_for_fingers(page: Page, size: tuple[int, int]) -> None:
    width, height = size
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_function("([w, h]) => posedAr.camera.width === w && posedAr.camera.height === h", arg=[width, height])
    boxes = page.evaluate("""() => [...document.querySelectorAll("#hud button, #hud summary")].map((element) => {
        const { left, top, right, bottom } = element.getBoundingClientRect();
        return [element.textContent, left, top, right, bottom];
    }).filter(([, left, , right]) => right > left)""")
    assert len(boxes) >= 10
    for name, left, top, right, bottom in boxes:
        assert 0 <= left < right <= width, name
        assert 0 <= top < bottom <= height, name
        assert min(right - left, bottom - top) >= 44, name
