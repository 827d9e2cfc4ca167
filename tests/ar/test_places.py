"""GeoJSON as the page takes it."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from posed.ar.places import SAMPLE, load_places
from posed.errors import InvalidArgumentError

Write = Callable[[Any], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def write(content: Any) -> Path:
        path = tmp_path / "places.geojson"
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    return write


def _feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": {"type": kind, "coordinates": coordinates}}


def _collection(*features: Any, **members: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features), **members}


_RING = [[22, 40, 1], [23, 40, 1], [23, 41, 1], [22, 40, 1]]


def test_points_lines_and_polygons_become_places(write: Write) -> None:
    path = write(
        _collection(
            _feature("Point", [22.5, 40.5, 70], name="Tower", note="old", color="#abc", ground=30),
            _feature("LineString", [[22, 40], [23, 41, 5]], title="Wall"),
            _feature("Polygon", [_RING], description="level"),
        )
    )
    assert load_places(path) == {
        "viewpoint": None,
        "places": [
            {
                "id": "1",
                "name": "Tower",
                "kind": "point",
                "note": "old",
                "color": "#abc",
                "coordinates": [[22.5, 40.5, 70]],
                "ground": 30,
            },
            {
                "id": "2",
                "name": "Wall",
                "kind": "line",
                "note": "",
                "color": None,
                "coordinates": [[22, 40, None], [23, 41, 5]],
                "ground": None,
            },
            {
                "id": "3",
                "name": "Place 3",
                "kind": "polygon",
                "note": "level",
                "color": None,
                "coordinates": [_RING],
                "ground": None,
            },
        ],
    }


@pytest.mark.parametrize(
    ("geometry", "kinds"),
    [
        ({"type": "MultiPoint", "coordinates": [[1, 2], [3, 4]]}, ["point", "point"]),
        ({"type": "MultiLineString", "coordinates": [[[1, 2], [3, 4]]]}, ["line"]),
        ({"type": "MultiPolygon", "coordinates": [[_RING], [_RING]]}, ["polygon", "polygon"]),
        (
            {
                "type": "GeometryCollection",
                "geometries": [
                    {"type": "Point", "coordinates": [1, 2]},
                    {"type": "MultiLineString", "coordinates": [[[1, 2], [3, 4]]]},
                ],
            },
            ["point", "line"],
        ),
        (None, []),
    ],
    ids=lambda value: value["type"] if isinstance(value, dict) else "",
)
def test_what_has_several_parts_becomes_several_places_of_one_name(
    write: Write, geometry: Any, kinds: list[str]
) -> None:
    path = write(_collection({"type": "Feature", "properties": {"name": "Both"}, "geometry": geometry}))
    places = load_places(path)["places"]
    assert [place["kind"] for place in places] == kinds
    assert {place["name"] for place in places} <= {"Both"}
    assert len({place["id"] for place in places}) == len(kinds)


def test_a_single_feature_and_a_bare_geometry_are_files_too(write: Write) -> None:
    point = _feature("Point", [1, 2, 3], name="Alone")
    assert load_places(write(point))["places"][0]["name"] == "Alone"
    assert load_places(write(point["geometry"]))["places"][0]["coordinates"] == [[1, 2, 3]]


def test_heights_above_the_geoid_are_lifted_by_its_undulation(write: Write) -> None:
    path = write(
        _collection(
            _feature("Point", [22.5, 40.5, 34], ground=2),
            viewpoint={"type": "Point", "coordinates": [22.5, 40.4, 29.5]},
        )
    )
    loaded = load_places(path, geoid_undulation_m=43.0)
    (place,) = loaded["places"]
    assert (place["coordinates"][0][2], place["ground"]) == (77.0, 45.0)
    assert loaded["viewpoint"] == {"latitude": 40.4, "longitude": 22.5, "height": 72.5}


def test_another_coordinate_reference_system_gives_the_same_places(write: Write) -> None:
    # The Greek grid: another datum, so that a mix-up would be some 200 m.
    x, y = Transformer.from_crs(4326, 2100, always_xy=True).transform(22.9484, 40.6264)
    path = write(_collection(_feature("Point", [x, y, 79])))
    for crs in ("EPSG:2100", "2100", "EPSG:2100+5773"):
        ((longitude, latitude, height),) = load_places(path, crs=crs)["places"][0]["coordinates"]
        assert Geod(ellps="WGS84").inv(longitude, latitude, 22.9484, 40.6264)[2] < 0.01
        assert height == 79


_MENDED = {
    "no JSON": ("{", "is not JSON"),
    "no GeoJSON": ("[]", "is not GeoJSON"),
    "a type that is none": ({"type": "Topology"}, 'geometry "Topology"; allowed: Point,'),
    "features that are none": (_collection() | {"features": {}}, "features is {}; expected a list"),
    "a feature that is none": (_collection(7), "feature 1 is 7; expected an object of type Feature"),
    "properties that are none": (
        {"type": "Feature", "properties": [1], "geometry": None},
        "properties = [1]; expected an object",
    ),
    "half a character": ('{"type": "Feature", "properties": {"name": "\\ud800"}}', "feature 1: '\\ud800' holds half a"),
    "a geometry that is none": (_feature("Circle", [1, 2], name="Pond"), "feature 1 ('Pond'): geometry \"Circle\""),
    "one coordinate": (_feature("Point", [1]), "position [1]; expected [longitude, latitude, height]"),
    "a word": (_feature("Point", ["22°", 40]), 'coordinate "22\\u00b0"; expected a number'.replace("\\u00b0", "°")),
    "no number": ('{"type": "Point", "coordinates": [NaN, 1]}', "coordinate NaN; expected a number"),
    "metres": (_feature("Point", [410000, 4498000], name="Pole"), "name the coordinate reference system of the file"),
    "a height in space": (_feature("Point", [1, 2, 4e5]), "height 400000.0; expected a number within 100000 m"),
    "a ground that is none": (_feature("Point", [1, 2], ground="sea"), 'ground "sea"; expected a number'),
    "a line of one point": (_feature("LineString", [[1, 2]]), "1 positions; at least 2 are needed"),
    "a ring that is open": (
        _feature("Polygon", [[[1, 1], [2, 1], [2, 2], [1, 2]]]),
        "a ring begins at [1.0, 1.0, None] and ends at [1.0, 2.0, None]; repeat its first position at its end",
    ),
    "a polygon without a ring": (_feature("Polygon", []), "a Polygon without a ring"),
    "a viewpoint without height": (
        _collection(viewpoint={"type": "Point", "coordinates": [1, 2]}),
        "expected a Point with a height",
    ),
    "a viewpoint of nothing": (
        _collection(viewpoint={"type": "GeometryCollection", "geometries": []}),
        "expected a Point with a height",
    ),
    "more digits than a number has": (
        _feature("Point", [10**400, 2]),
        "expected a number",
    ),
    "a depth without end": ("[" * 100_000, "nested too deep"),
    "an old file of another system": (
        _collection(crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2100"}}),
        "its crs is 'urn:ogc:def:crs:EPSG::2100'; give it with --crs",
    ),
}


@pytest.mark.parametrize(("content", "said"), _MENDED.values(), ids=_MENDED)
def test_a_bad_file_is_refused_with_the_feature_the_value_and_the_remedy(write: Write, content: Any, said: str) -> None:
    path = write(content)
    with pytest.raises(InvalidArgumentError, match=re.escape(said)) as refused:
        load_places(path)
    assert str(path) in str(refused.value)


def test_a_file_that_is_not_there_and_a_system_that_is_none_are_refused(write: Write, tmp_path: Path) -> None:
    with pytest.raises(InvalidArgumentError, match=r"cannot read .*No such file"):
        load_places(tmp_path / "nowhere.geojson")
    path = write(_feature("Point", [1, 2]))
    with pytest.raises(InvalidArgumentError, match="'EPSG:0' is no coordinate reference system"):
        load_places(path, crs="EPSG:0")
    with pytest.raises(InvalidArgumentError, match=r"'IAU_2015:30100' is no .*celestial body"):
        load_places(path, crs="IAU_2015:30100")
    path = write(_feature("Point", [1e30, 2]))
    with pytest.raises(InvalidArgumentError, match=re.escape("lie outside EPSG:2100; check --crs")):
        load_places(path, crs="EPSG:2100")


@pytest.mark.parametrize(
    ("crs", "kind"), [("EPSG:5773", "Vertical CRS"), ("EPSG:3855", "Vertical CRS"), ("EPSG:4978", "Geocentric CRS")]
)
def test_a_system_without_horizontal_coordinates_is_refused(write: Write, crs: str, kind: str) -> None:
    path = write(_feature("Point", [22.9, 40.6]))
    with pytest.raises(InvalidArgumentError, match=f"'{crs}' is a {kind}; give the code of the horizontal system"):
        load_places(path, crs=crs)


_JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=8) | st.sampled_from(["Point", "Polygon", "Feature"]),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(
                ["type", "features", "geometry", "geometries", "coordinates", "properties", "crs", "viewpoint"]
            ),
            inner,
            max_size=5,
        )
    ),
    max_leaves=20,
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=_JSON)
def test_whatever_a_file_holds_it_is_read_or_refused(write: Write, content: Any) -> None:
    path = write(content)
    try:
        loaded = load_places(path)
    except InvalidArgumentError:
        return
    assert set(loaded) == {"viewpoint", "places"}


def test_the_sample_has_what_shows_the_page_off() -> None:
    loaded = load_places(SAMPLE)
    view = loaded["viewpoint"]
    places = loaded["places"]
    assert (view["latitude"], view["longitude"], view["height"]) == (40.6265, 22.9591, 72.5)
    assert {place["kind"] for place in places} == {"point", "line", "polygon"}
    names = " ".join(place["name"] for place in places)
    assert all(re.search(script, names) for script in ("[a-z]", "[α-ω]", "[א-ת]", "[ء-ي]"))
    azimuths = {}
    for place in places:
        position = place["coordinates"][0] if place["kind"] != "polygon" else place["coordinates"][0][0]
        azimuth, _, distance = Geod(ellps="WGS84").inv(view["longitude"], view["latitude"], *position[:2])
        azimuths[place["name"]] = azimuth % 360
        assert distance < 150_000
        if place["name"] == "Mount Olympus":
            assert 75_000 < distance < 82_000
    # One to look at in each quarter of the compass.
    assert {round(azimuth / 90) % 4 for azimuth in azimuths.values()} == {0, 1, 2, 3}
