"""Modules of the AR page that draw nothing, in a real browser: angles, labels, solving, field book."""

import csv
import io
import itertools
import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from ar_turn import HERE
from playwright.sync_api import Browser, Page
from pyproj import Geod
from served import Served, SilentFeed

from posed.ar.app import ArContent
from posed.ar.corrections import CorrectionStore


@pytest.fixture(scope="module")
def page(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    store = CorrectionStore(tmp_path_factory.mktemp("ar") / "corrections.json")
    with Served(SilentFeed(), ArContent({"viewpoint": None, "places": []}, {}), store) as served:
        page = browser.new_page()
        page.goto(served.links[-1])
        yield page
        page.close()


def test_what_one_daemon_knew_is_forgotten_with_the_next(page: Page) -> None:
    found = page.evaluate(
        """async () => {
            const { Scene } = await import("/page/scene.js");
            const scene = new Scene();
            const place = { latitude: 40, longitude: 22, height: 60, source: "gnss", wmm_declination_deg: 5 };
            scene.takeLink({ state: "CONNECTED", reason: "", n: 1 });
            scene.takeTruth({ t: 0, q: [0, 0, 0, 1], d: 4, e: [100, 0, 0] });
            scene.takeObserver(place);
            const before = [scene.declination.source, scene.start.longitude < 22];
            scene.takeLink({ state: "DISCONNECTED", reason: "", n: 1 });
            const meanwhile = scene.truth !== null;
            scene.takeLink({ state: "CONNECTED", reason: "", n: 2 });
            const after = [scene.declination.source, scene.start, scene.knownPosition];
            scene.takeObserver({ ...place, longitude: 30 });
            const isAt30 = () => Math.abs(scene.start.longitude - 30) < 1e-9;
            const anew = isAt30();
            // A tab that slept through the loss is told of the new connection alone.
            scene.takeLink({ state: "CONNECTED", reason: "", n: 2 });
            const same = isAt30();
            scene.takeLink({ state: "CONNECTED", reason: "", n: 3 });
            return { before, meanwhile, after, anew, same, slept: scene.start };
        }"""
    )
    assert found == {
        "before": ["truth", True],
        "meanwhile": True,
        "after": ["unknown", None, None],
        "anew": True,
        "same": True,
        "slept": None,
    }


def test_of_one_frame_the_link_is_taken_before_what_came_over_it(page: Page) -> None:
    taken = page.evaluate(
        """async () => {
            const { Live } = await import("/web/live.js");
            const taken = [];
            const take = (key) => (value) => taken.push([key, value]);
            const live = new Live("/live", { on: { s: take("s"), o: take("o") } });
            live._take({ o: 1, p: "of no interest", s: 2 });
            live._socket.onclose = null;
            live._socket.close();
            return taken;
        }"""
    )
    assert taken[:2] == [["s", 2], ["o", 1]]


def test_a_clock_that_stood_still_is_learned_anew_at_once(page: Page) -> None:
    # As performance.now() does while the machine is suspended.
    offsets = page.evaluate(
        """async () => {
            const { Live } = await import("/web/live.js");
            const live = new Live("/live", { on: {} });
            const ask = (sent, trip, offset) => {
                live._takeClock({ c: sent, b: sent + trip / 2 + offset }, sent + trip);
                return live.offsetMs;
            };
            const offsets = [ask(0, 1, 500)];
            // Held up on the way: still the same clock.
            for (let i = 1; i < 8; i++) offsets.push(ask(5000 * i, 3, 501.2));
            offsets.push(ask(40_000, 4, 3_600_500), ask(45_000, 2, 3_600_500.5));
            live._socket.onclose = null;
            live._socket.close();
            return offsets;
        }"""
    )
    assert offsets == [*[500] * 8, 3_600_500, 3_600_500.5]


@pytest.mark.parametrize(
    ("degrees", "unit", "digits", "text"),
    [
        (12.5, "deg", 2, "12.50°"),
        (-0.001, "deg", 2, "0.00°"),
        (-7.3, "deg", 1, "−7.3°"),
        (12.99999, "dms", 0, "13° 00′ 00″"),
        (-0.5, "dms", 1, "−0° 30′ 00.0″"),
        (90.0, "gon", 1, "100.0 gon"),
    ],
)
def test_angles_are_written_in_their_unit(page: Page, degrees: float, unit: str, digits: int, text: str) -> None:
    written = page.evaluate(
        'async (a) => (await import("/page/angles.js")).format(...a)', [math.radians(degrees), unit, digits]
    )
    assert written == text


def test_a_bearing_is_never_a_full_circle(page: Page) -> None:
    written = page.evaluate(
        """async () => {
            const { formatBearing } = await import("/page/angles.js");
            return ["deg", "dms", "gon"].map((unit) => formatBearing(-1e-7, unit, 1));
        }"""
    )
    assert written == ["0.0°", "0° 00′ 00.0″", "0.0 gon"]


@pytest.mark.parametrize(
    ("text", "unit", "degrees"),
    [
        ("12.5", "deg", 12.5),
        ("12,5°", "gon", 12.5),
        ("100", "gon", 90.0),
        ("−8.1 gon", "deg", -7.29),
        ("5° 30′ W", "deg", -5.5),
        ("12:30:36", "dms", 12.51),
        ("-0 30", "deg", -0.5),
        ("5.5E", "deg", 5.5),
        ("", "deg", None),
        ("north", "deg", None),
        ("12 61", "deg", None),
        ("-5 W", "deg", None),
    ],
)
def test_angles_are_read_as_people_write_them(page: Page, text: str, unit: str, degrees: float | None) -> None:
    read = page.evaluate(
        """async (a) => {
            const rad = (await import("/page/angles.js")).parse(...a);
            return Number.isNaN(rad) ? null : (rad * 180) / Math.PI;
        }""",
        [text, unit],
    )
    assert read == (None if degrees is None else pytest.approx(degrees, abs=1e-9))


def _raw(kind: str, coordinates: Any) -> dict[str, Any]:
    return {"id": "1", "name": "", "kind": kind, "note": "", "color": None, "coordinates": coordinates, "ground": None}


@pytest.mark.parametrize(
    ("kind", "coordinates"),
    [
        ("point", [[22.001, 40, None]]),
        ("line", [[22.001, 40, None], [22.001, 40, None]]),
        ("polygon", [[[22.001, 40, None], [22.001, 40.001, 5], [22.001, 39.999, 5], [22.001, 40, None]]]),
    ],
)
def test_what_has_no_height_stays_level_with_an_eye_that_climbs(page: Page, kind: str, coordinates: Any) -> None:
    above = page.evaluate(
        """async (raw) => {
            const { Places } = await import("/page/places.js");
            const places = new Places();
            places.load({ viewpoint: null, places: [raw] });
            return [0, 60, 60.05].map((height) => {
                const eye = places.moveTo({ latitude: 40, longitude: 22, height });
                return places.all[0].anchor[2] - eye[2];
            });
        }""",
        _raw(kind, coordinates),
    )
    assert above == pytest.approx([0, 0, 0], abs=0.1)


def test_places_with_heights_shift_as_a_whole_until_the_eye_is_far(page: Page) -> None:
    origins = page.evaluate(
        """async (raw) => {
            const { Places } = await import("/page/places.js");
            const places = new Places();
            places.load({ viewpoint: null, places: [raw] });
            return [0, 150, 250].map((height) => {
                places.moveTo({ latitude: 40, longitude: 22, height });
                return places.origin.height;
            });
        }""",
        _raw("point", [[22.001, 40, 5]]),
    )
    assert origins == [0, 0, 250]


def test_a_polygon_across_180_degrees_is_where_its_corners_are(page: Page) -> None:
    ring = [[179.99, -17, 0], [-179.97, -17, 0], [-179.99, -17.01, 0], [179.99, -17, 0]]
    position = page.evaluate(
        """async (raw) => {
            const { Places } = await import("/page/places.js");
            const places = new Places();
            places.load({ viewpoint: null, places: [raw] });
            places.moveTo({ latitude: -17, longitude: 180, height: 0 });
            return places.all[0].position;
        }""",
        _raw("polygon", [ring]),
    )
    assert position["longitude"] == pytest.approx(-179.99)


_FRAME = """
    const { Frame } = await import("/page/frame.js");
    const { Scene } = await import("/page/scene.js");
    const { Target } = await import("/page/target.js");
    const scene = new Scene();
    const target = new Target();
    const frame = new Frame(scene, target, () => {});
    scene.places.load({ viewpoint: null, places: [raw] });
    scene.takeLink({ state: "CONNECTED", reason: "", n: 1 });
    scene.takeObserver({ latitude: 40, longitude: 22, height: 5, source: "gnss", wmm_declination_deg: null });
    // Upright, the camera level and to the north.
    scene.takePose({ n: 1, t: 0, b: 0, q: [Math.SQRT1_2, 0, 0, Math.SQRT1_2], w: [0, 0, 0], a: 1, s: 0 }, 0);
    frame.resize();
"""


def test_places_go_with_the_position_they_were_seen_from(page: Page) -> None:
    found = page.evaluate(
        f"""async (raw) => {{
            {_FRAME}
            const draw = () => {{
                frame.draw(NaN, true);
                return [frame.overlay.drawn.length, target.place?.id];
            }};
            const before = draw();
            target.hold(target.place);
            scene.takeLink({{ state: "CONNECTED", reason: "", n: 2 }});
            return [before, draw()];
        }}""",
        _raw("point", [[22, 40.001, 5]]),
    )
    assert found == [[1, "1"], [0, None]]


def test_a_new_target_is_drawn_as_such_without_a_new_pose(page: Page) -> None:
    goes_on = page.evaluate(
        f"""async (raw) => {{
            {_FRAME}
            return [frame.draw(NaN, true), frame.draw(NaN, false), frame.draw(NaN, false)];
        }}""",
        _raw("point", [[22, 40.001, 5]]),
    )
    assert goes_on == [True, False, False]


@pytest.mark.parametrize(("direction", "names"), [(1, "bcdeabcde"), (-1, "aedcbaedc")])
def test_steps_pass_every_place_even_of_equal_bearing(page: Page, direction: int, names: str) -> None:
    stepped = page.evaluate(
        """async ([direction, count]) => {
            const { Target } = await import("/page/target.js");
            const anchors = { d: [0, -1, 0], b: [1, 1, 0], e: [-1, 0, 0], c: [1, 1, 9], a: [0, 1, 0] };
            const all = Object.entries(anchors).map(([id, anchor]) => ({ id, anchor }));
            const target = new Target();
            const ids = [];
            for (let i = 0; i < count; i++) {
                target.step({ all }, [0, 0, 0], 0.1, direction);
                ids.push(target.place.id);
            }
            return ids.join("");
        }""",
        [direction, len(names)],
    )
    assert stepped == names


def test_the_top_view_is_drawn_anew_when_the_places_were_worked_out_anew(page: Page) -> None:
    drawn = page.evaluate(
        """async (raw) => {
            const { Places } = await import("/page/places.js");
            const { Thumbnail } = await import("/page/thumbnail.js");
            const canvas = document.querySelector("#thumbnail");
            let count = 0;
            canvas.getContext("2d").fillRect = () => count++;
            const thumbnail = new Thumbnail(canvas);
            thumbnail.resize();
            const places = new Places();
            places.load({ viewpoint: null, places: [raw] });
            const counts = [null, 40, 40, 40.01].map((latitude) => {
                const eye = places.moveTo(latitude && { latitude, longitude: 22, height: 0 });
                thumbnail.draw(places, null, eye, 1, 0.5);
                return count;
            });
            delete canvas.getContext("2d").fillRect;
            return counts;
        }""",
        _raw("point", [[22.001, 40, 5]]),
    )
    assert drawn == [1, 2, 2, 3]


def test_a_camera_allowed_twice_is_opened_once_and_closed(page: Page) -> None:
    states = page.evaluate(
        """async () => {
            const { Background } = await import("/page/background.js");
            const pending = [];
            navigator.mediaDevices.getUserMedia = () => new Promise((allow) => pending.push(allow));
            const streamOf = () => {
                const canvas = document.createElement("canvas");
                canvas.getContext("2d").fillRect(0, 0, 9, 9);
                return canvas.captureStream();
            };
            const background = new Background(document.querySelector("#stage"), () => {});
            const streams = [streamOf(), streamOf()];
            const shown = ["camera", "world", "camera"].map((view) => background.show(view));
            streams.forEach((stream, i) => pending[i](stream));
            await shown[2];
            const states = () => streams.map((stream) => stream.getTracks()[0].readyState);
            const open = states();
            await background.show("world");
            delete navigator.mediaDevices.getUserMedia;
            return [open, states()];
        }"""
    )
    assert states == [["live", "ended"], ["ended", "ended"]]


_FREE = {"left": 70, "top": 140, "right": 1272, "bottom": 600}
_CROSS = {"x": 610, "y": 330, "width": 60, "height": 60}

_PLACE_ALL = """async ([frames, free, cross]) => {
    const { Declutter } = await import("/page/declutter.js");
    const declutter = new Declutter();
    return frames.map((labels) => { declutter.place(labels, free, cross); return labels; });
}"""


def _labels(rng: np.random.Generator, count: int) -> list[dict[str, Any]]:
    return [
        {
            "id": str(number),
            "priority": -number,
            "x": 0,
            "y": 0,
            "width": float(rng.uniform(60, 200)),
            "height": 22,
            "anchorX": float(rng.uniform(70, 1272)),
            "anchorY": float(rng.uniform(300, 500)),
            "hidden": False,
        }
        for number in range(count)
    ]


@pytest.mark.parametrize("count", [2, 12, 48])
def test_labels_do_not_overlap_each_other_nor_the_cross_and_stay_in_what_is_free(page: Page, count: int) -> None:
    rng = np.random.default_rng(count)
    for labels in page.evaluate(_PLACE_ALL, [[_labels(rng, count) for _ in range(5)], _FREE, _CROSS]):
        shown = [label for label in labels if not label["hidden"]]
        assert labels[0] in shown  # of the highest priority, and nothing is in its way
        for i, one in enumerate(shown):
            assert _FREE["left"] <= one["x"] <= _FREE["right"] - one["width"]
            assert _FREE["top"] <= one["y"] <= _FREE["bottom"] - one["height"]
            for other in [*shown[:i], _CROSS]:
                assert (
                    one["x"] + one["width"] <= other["x"]
                    or other["x"] + other["width"] <= one["x"]
                    or one["y"] + one["height"] <= other["y"]
                    or other["y"] + other["height"] <= one["y"]
                )


def test_labels_of_a_pose_that_trembles_neither_flicker_nor_hop(page: Page) -> None:
    rng = np.random.default_rng(1)
    still = _labels(rng, 30)
    frames = []
    for _ in range(60):
        dx, dy = rng.normal(0, 1.5, 2)
        frames.append(
            [{**label, "anchorX": label["anchorX"] + dx, "anchorY": label["anchorY"] + dy} for label in still]
        )
    found = page.evaluate(_PLACE_ALL, [frames, _FREE, {**_CROSS, "x": -500}])
    settled = found[10:]
    changes = 0
    for before, after in itertools.pairwise(settled):
        for one, other in zip(before, after, strict=True):
            hop = abs((one["y"] - one["anchorY"]) - (other["y"] - other["anchorY"])) > 1
            changes += one["hidden"] != other["hidden"] or (not one["hidden"] and hop)
    # Of 1,470 chances; what is at the edge of the free room may still come and go.
    assert changes <= 6


def _alignments(
    bearings_and_distances: list[tuple[float, float]], offset_deg: float = 0.0, heights: bool = True
) -> list[dict[str, Any]]:
    """Return places seen from HERE, level with the eye as good as, with the heading measured too small by an offset."""
    found = []
    for number, (bearing, distance) in enumerate(bearings_and_distances):
        longitude, latitude, _ = Geod(ellps="WGS84").fwd(HERE["longitude"], HERE["latitude"], bearing, distance)
        found.append(
            {
                "id": str(number),
                "name": f"Place {number}",
                "position": {
                    "latitude": latitude,
                    "longitude": longitude,
                    "height": HERE["height"] + 12.0 if heights else None,
                },
                "bearing": math.radians(bearing - offset_deg),
                "elevation": math.atan2(12.0, distance) if heights else 0.0,
            }
        )
    return found


def _solve(page: Page, how: str, alignments: list[dict[str, Any]], start: dict[str, float] | None = None) -> Any:
    return page.evaluate(
        """async ([how, alignments, start]) => {
            const solve = await import("/page/solve.js");
            try { return solve[how](alignments, start); } catch (error) {
                if (!(error instanceof solve.SolveError)) throw error;
                return error.message;
            }
        }""",
        [how, alignments, start or HERE],
    )


def test_the_heading_is_solved_across_north(page: Page) -> None:
    solution = _solve(page, "solveHeading", _alignments([(359.0, 300), (2.0, 500)], 7.3))
    assert math.degrees(solution["headingOffset"]) == pytest.approx(7.3, abs=0.01)
    assert solution["position"] is None
    assert solution["spare"] == 1


@pytest.mark.parametrize("heights", [True, False])
def test_position_and_heading_come_out_of_three_places_with_heights_or_without(page: Page, heights: bool) -> None:
    longitude, latitude, _ = Geod(ellps="WGS84").fwd(HERE["longitude"], HERE["latitude"], 215.0, 12.0)
    wrong = {"latitude": latitude, "longitude": longitude, "height": HERE["height"]}
    solution = _solve(page, "solveBoth", _alignments([(20, 150), (130, 90), (250, 200)], 7.3, heights), wrong)
    assert math.degrees(solution["headingOffset"]) == pytest.approx(7.3, abs=0.01)
    _, _, off = Geod(ellps="WGS84").inv(
        HERE["longitude"], HERE["latitude"], solution["position"]["longitude"], solution["position"]["latitude"]
    )
    assert off < 0.05
    assert math.hypot(*solution["moved"][:2]) == pytest.approx(12.0, abs=0.05)
    assert solution["rms"] < 1e-4


def test_residuals_show_the_place_that_was_aligned_wrongly(page: Page) -> None:
    alignments = _alignments([(20, 150), (80, 120), (130, 90), (250, 200), (310, 160)])
    alignments[2]["bearing"] += math.radians(3.0)
    residuals = _solve(page, "solveHeading", alignments)["residuals"]
    assert max(residuals, key=lambda residual: abs(residual["bearing"]))["id"] == "2"


@pytest.mark.parametrize(
    ("alignments", "words"),
    [
        ([(10, 100)], "need three aligned places, or two whose heights are known"),
        ([(10, 100), (12, 300), (191, 250)], "in one line with you"),
        ([(10, 30_000), (60, 40_000), (110, 35_000)], "tell your position"),
    ],
)
def test_what_cannot_tell_a_position_is_refused_in_words(
    page: Page, alignments: list[tuple[float, float]], words: str
) -> None:
    assert words in _solve(page, "solveBoth", _alignments(alignments))


def test_places_on_one_circle_with_the_eye_are_refused(page: Page) -> None:
    radius = 200.0
    on_circle = [(bearing, 2 * radius * math.cos(math.radians(bearing))) for bearing in (-50, 5, 55)]
    assert "on one circle" in _solve(page, "solveBoth", _alignments(on_circle, heights=False))


def test_a_place_overhead_tells_no_heading(page: Page) -> None:
    (alignment,) = _alignments([(10, 100)])
    alignment["elevation"] = math.radians(80)
    assert "too steeply" in _solve(page, "solveHeading", [alignment])


_SIGHTS: list[dict[str, Any]] = [
    {
        "time": "2026-05-01T10:00:00.000Z",
        "name": 'Tower "A", מגדל',
        "id": "7",
        "bearing": 12.34567,
        "elevation": -1.5,
        "distance": 1234.567,
        "place": {"latitude": 40.6, "longitude": 22.9, "height": None},
        "position": HERE,
        "cameraBearing": 12.0,
        "cameraElevation": -1.0,
        "headingAccuracy": 1.25,
        "declination": 5.5,
        "correction": "none",
        "mode": "GAME",
        "sequence": 42,
    },
    {
        "time": "2026-05-01T10:01:00.000Z",
        "name": "",
        "id": "",
        "bearing": 90.0,
        "elevation": 3.0,
        "distance": None,
        "place": None,
        "position": HERE,
        "cameraBearing": 90.0,
        "cameraElevation": 3.0,
        "headingAccuracy": 1.25,
        "declination": 5.5,
        "correction": "none",
        "mode": "GAME",
        "sequence": 43,
    },
]


def test_the_field_book_is_a_csv_that_readers_read(page: Page) -> None:
    text = page.evaluate('async (sights) => (await import("/page/book.js")).toCsv(sights)', _SIGHTS)
    tower, free = csv.DictReader(io.StringIO(text, newline=""))
    assert tower["name"] == 'Tower "A", מגדל'
    assert (tower["bearing_deg"], tower["distance_m"], tower["place_height_m"]) == ("12.346", "1234.57", "")
    assert (free["bearing_deg"], free["distance_m"], free["place_latitude"]) == ("90.000", "", "")
    assert tower["position_latitude"] == "40.62650000"


def test_the_field_book_is_geojson_with_its_places_and_no_invented_height(page: Page) -> None:
    text = page.evaluate('async (sights) => (await import("/page/book.js")).toGeoJson(sights)', _SIGHTS)
    tower, free = json.loads(text)["features"]
    assert tower["geometry"] == {"type": "Point", "coordinates": [22.9, 40.6]}
    assert tower["properties"]["place_id"] == "7"
    assert tower["properties"]["bearing_deg"] == 12.346
    assert free["geometry"]["coordinates"] == [HERE["longitude"], HERE["latitude"], HERE["height"]]
    assert free["properties"]["distance_m"] is None


def test_two_tabs_share_one_field_book(page: Page) -> None:
    found = page.evaluate(
        """async ([one, other]) => {
            const { Book } = await import("/page/book.js");
            const [a, b] = [0, 1].map(() => new Book(() => "deg", () => {}));
            const kept = () => JSON.parse(localStorage.getItem("posed-ar-book")).map(({ name }) => name);
            a.record(one);
            b.record(other);
            const both = kept();
            a.show();
            document.querySelector("#book-records button").click();
            const left = kept();
            localStorage.clear();
            return [both, left];
        }""",
        _SIGHTS,
    )
    assert found == [['Tower "A", מגדל', ""], [""]]


def test_a_field_book_that_the_browser_does_not_keep_stays_in_its_tab(page: Page) -> None:
    count = page.evaluate(
        """async (sights) => {
            const { Book } = await import("/page/book.js");
            const book = new Book(() => "deg", () => {});
            const { setItem } = Storage.prototype;
            Storage.prototype.setItem = () => { throw new DOMException("", "QuotaExceededError"); };
            for (const sight of sights) book.record(sight);
            Storage.prototype.setItem = setItem;
            return book.sights.length;
        }""",
        _SIGHTS,
    )
    assert count == len(_SIGHTS)


def test_names_run_in_the_direction_of_their_script(page: Page) -> None:
    found = page.evaluate(
        """async (names) => {
            const { directionOf } = await import("/page/draw.js");
            return names.map(directionOf);
        }""",
        ["Λευκός Πύργος", "מגדל", "  12 مسجد", "42", "東京"],
    )
    assert found == ["ltr", "rtl", "rtl", "ltr", "ltr"]
