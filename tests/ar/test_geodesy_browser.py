"""The page's geodesy and camera, in a real browser, against pyproj and plain algebra."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page
from pyproj import Transformer
from served import Served, SilentFeed

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore

_ORIGINS = [
    {"latitude": 40.6265, "longitude": 22.9591, "height": 72.5},
    {"latitude": -36.85, "longitude": 174.76, "height": 20},
    {"latitude": 89.99, "longitude": -100, "height": 0},
    {"latitude": 0, "longitude": 180, "height": 5000},
]


@pytest.fixture(scope="module")
def page(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    store = CorrectionStore(tmp_path_factory.mktemp("ar") / "corrections.json")
    with Served(SilentFeed(), ArContent({"viewpoint": None, "places": []}, {}), store) as served:
        page = browser.new_page()
        page.goto(served.links[-1])
        yield page
        page.close()


def _around(origin: dict[str, float], seed: int) -> list[dict[str, float]]:
    """Return places 10 m to 150 km from an origin."""
    rng = np.random.default_rng(seed)
    found = []
    for distance in np.geomspace(10, 150_000, 20):
        bearing = rng.uniform(0, 2 * math.pi)
        north = math.degrees(distance * math.cos(bearing) / 6.37e6)
        latitude = origin["latitude"] + north
        if latitude > 90:
            latitude = 180 - latitude
        level = max(math.cos(math.radians(origin["latitude"])), 1e-4)
        east = math.degrees(distance * math.sin(bearing) / 6.37e6 / level)
        longitude = (origin["longitude"] + east + 180) % 360 - 180
        found.append({"latitude": latitude, "longitude": longitude, "height": float(rng.uniform(-50, 3000))})
    return found


@pytest.mark.parametrize("origin", _ORIGINS, ids=lambda origin: f"{origin['latitude']:g}")
def test_east_north_and_up_are_those_of_proj(page: Page, origin: dict[str, float]) -> None:
    places = _around(origin, 7)
    found = page.evaluate(
        """async ([origin, places]) => {
            const { enu, fromEnu } = await import("/page/geodesy.js");
            return places.map((place) => { const at = enu(origin, place); return [at, fromEnu(origin, at)]; });
        }""",
        [origin, places],
    )
    topocentric = Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 +step"
        f" +proj=topocentric +ellps=WGS84 +lon_0={origin['longitude']} +lat_0={origin['latitude']}"
        f" +h_0={origin['height']}"
    )
    for place, (enu, back) in zip(places, found, strict=True):
        wanted = topocentric.transform(place["longitude"], place["latitude"], place["height"])
        assert np.allclose(enu, wanted, rtol=0, atol=1e-5)
        assert abs(back["height"] - place["height"]) < 1e-4
        assert abs(back["latitude"] - place["latitude"]) < 1e-9
        turn = (back["longitude"] - place["longitude"] + 180) % 360 - 180
        assert abs(turn) * math.cos(math.radians(place["latitude"])) < 1e-9


def test_at_thirty_kilometres_the_earth_curves_away_and_the_air_lifts_some_of_it(page: Page) -> None:
    origin = {"latitude": 40.0, "longitude": 23.0, "height": 0}
    level, seen = page.evaluate(
        """async (origin) => {
            const { enu, refract } = await import("/page/geodesy.js");
            const at = enu(origin, { latitude: origin.latitude, longitude: 23.3513, height: 0 });
            return [at, refract(at)];
        }""",
        origin,
    )
    distance = math.hypot(*level[:2])
    assert abs(distance - 30_000) < 50
    # d2 / 2R, and 0.13 of it: 71 m and 9 m, a quarter of a degree's half as angles.
    assert abs(level[2] + distance**2 / 2 / 6.388e6) < 0.1
    assert seen[:2] == level[:2]
    assert abs(seen[2] - level[2] - 0.13 * distance**2 / 2 / 6.371e6) < 0.01


_HALF = math.sqrt(0.5)
# Upright in portrait and looking north; then turned to the left about the axis out of the screen, a quarter each.
_HELD = {
    0: (_HALF, 0, 0, _HALF),
    90: (0.5, -0.5, 0.5, 0.5),
    180: (0, -_HALF, _HALF, 0),
    270: (-0.5, -0.5, 0.5, -0.5),
}


@pytest.mark.parametrize("rotation", _HELD)
def test_in_each_screen_rotation_what_is_up_is_up_and_what_is_right_is_right(page: Page, rotation: int) -> None:
    found = page.evaluate(
        """async ([rotation, q]) => {
            const { Camera } = await import("/page/camera.js");
            const { Projector } = await import("/page/projector.js");
            const camera = new Camera({ width: 1280, height: 720, fovDeg: 60, rotation });
            const to = new Projector();
            to.aim(camera, q, [5, 6, 7]);
            const at = (e, n, u) => { const ahead = to.point(e, n, u); return [ahead, to.x, to.y]; };
            return {
                ahead: at(5, 106, 7), right: at(15, 106, 7), up: at(5, 106, 17), behind: at(5, -94, 7)[0],
                edge: at(5 + 100 * Math.tan(Math.PI / 6), 106, 7), ray: camera.ray(q, 640, 360),
            };
        }""",
        [rotation, _HELD[rotation]],
    )
    f = 640 / math.tan(math.radians(30))
    assert np.allclose(found["ray"], [0, 1, 0], atol=1e-9)
    assert _near(found["ahead"], 640, 360)
    assert _near(found["right"], 640 + f / 10, 360)
    assert _near(found["up"], 640, 360 - f / 10)
    assert _near(found["edge"], 1280, 360)
    assert found["behind"] is False


def _near(found: list[Any], x: float, y: float) -> bool:
    return found[0] is True and math.hypot(found[1] - x, found[2] - y) < 1e-6
