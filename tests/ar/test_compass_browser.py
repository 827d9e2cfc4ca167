"""A phone turns through north, east, south and west: the overlay lies on the world, and a wrong pose shows."""

import io
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from ar_turn import QUARTERS, Step, SteppedFeed, faithful, frozen, late, places_around, simulate, turned
from PIL import Image
from playwright.sync_api import Browser, Page
from served import Served

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore

_MOST_DEG = 1.0
_RED, _GREEN = (255, 45, 45), (0, 229, 160)


@pytest.fixture(scope="module")
def feed() -> SteppedFeed:
    return SteppedFeed(simulate("compass", 26))


@pytest.fixture(scope="module")
def page(browser: Browser, feed: SteppedFeed, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    store = CorrectionStore(tmp_path_factory.mktemp("ar") / "corrections.json")
    with Served(feed, ArContent(places_around(QUARTERS), {}), store) as served:
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(served.links[-1])
        page.wait_for_function("() => window.posedAr !== undefined")
        with feed.asked:
            assert feed.asked.wait_for(lambda: feed.wishes[-1:] == [True], 20), "the page asks for no truth"
        yield page
        page.close()


def test_at_each_quarter_the_label_is_on_the_object(page: Page, feed: SteppedFeed) -> None:
    by_projection, by_pixels = _errors(page, feed, faithful)
    assert max(by_projection.values()) < _MOST_DEG, by_projection
    assert max(by_pixels.values()) < _MOST_DEG, by_pixels
    # The picture says what the page says: both to a pixel.
    assert all(abs(by_projection[name] - by_pixels[name]) < 0.1 for name in QUARTERS), (by_projection, by_pixels)


@pytest.mark.parametrize("doctored", [frozen, turned, late], ids=lambda function: function.__name__)
def test_a_pose_that_is_wrong_fails_that_check(
    page: Page, feed: SteppedFeed, doctored: Callable[[Sequence[Step], int], dict[str, Any]]
) -> None:
    by_projection, by_pixels = _errors(page, feed, doctored)
    assert max(by_projection.values()) >= _MOST_DEG, by_projection
    assert max(by_pixels.values()) >= _MOST_DEG, by_pixels


def _errors(
    page: Page, feed: SteppedFeed, pose_of: Callable[[Sequence[Step], int], dict[str, Any]]
) -> tuple[dict[str, float], dict[str, float]]:
    """Return how far (deg) the overlay of each place is from the object as the camera is on it: told, and seen."""
    by_projection, by_pixels = {}, {}
    for name, bearing in QUARTERS.items():
        off = [abs((step.heading - bearing + 180) % 360 - 180) for step in feed.steps[1:]]
        number = 1 + int(np.argmin(off))
        assert off[number - 1] < 1.0
        feed.show(number, pose_of)
        page.wait_for_function("n => posedAr.pose?.sequence === n", arg=feed.steps[number].pose["n"])
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        camera = page.evaluate("posedAr.camera")
        (label,) = [label for label in page.evaluate("posedAr.labels") if label["name"] == name]
        assert label["truth"]["visible"]
        by_projection[name] = (
            _angle_deg(camera, (label["x"], label["y"]), (label["truth"]["x"], label["truth"]["y"]))
            if label["visible"]
            else math.inf
        )
        picture = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)
        ring, dot = _ring(picture), _dot(picture)
        by_pixels[name] = math.inf if dot is None else _angle_deg(camera, dot, ring)
    return by_projection, by_pixels


def _angle_deg(camera: dict[str, float], one: tuple[float, float], other: tuple[float, float]) -> float:
    """Return the angle between two pixels as seen from the camera."""
    rays = [np.array([x - camera["width"] / 2, y - camera["height"] / 2, camera["f"]]) for x, y in (one, other)]
    sine = np.linalg.norm(np.cross(*rays))
    return math.degrees(math.atan2(sine, float(rays[0] @ rays[1])))


def _ring(picture: Any) -> tuple[float, float]:
    """Return the middle of the green ring, which marks the object in the drawn world: the circle through its pixels."""
    y, x = np.nonzero(np.abs(picture - _GREEN).max(axis=2) < 40)
    assert len(x) > 30, "no green ring in the picture"
    a = np.column_stack([x, y, np.ones_like(x)]).astype(float)
    solution = np.linalg.lstsq(a, (x**2 + y**2).astype(float), rcond=None)[0]
    middle = (solution[0] / 2, solution[1] / 2)
    radius = math.sqrt(solution[2] + middle[0] ** 2 + middle[1] ** 2)
    assert 5 < radius < 10, f"the green pixels are no ring: radius {radius:.1f}"
    return middle[0] + 0.5, middle[1] + 0.5


def _dot(picture: Any) -> tuple[float, float] | None:
    """Return the middle of the overlay's red dot, the only round red of its size; None if none is in the picture."""
    red = (np.abs(picture - _RED).max(axis=2) < 40).astype(int)
    # Red over a whole square of 7 pixels: neither a label's frame nor its line is so thick, and no dot much thicker.
    sums = np.pad(red.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    full = (sums[7:, 7:] - sums[:-7, 7:] - sums[7:, :-7] + sums[:-7, :-7]) == 49
    y, x = np.nonzero(full)
    if not len(x) or max(np.ptp(x), np.ptp(y)) > 4:
        return None
    return float(x.mean()) + 3.5, float(y.mean()) + 3.5
