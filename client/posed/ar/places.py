"""Places from GeoJSON, as the page takes them: WGS 84 positions with ellipsoidal heights, one shape a place."""

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from posed.errors import InvalidArgumentError, MissingExtraError

SAMPLE = Path(__file__).with_name("thessaloniki.geojson")
"""Places in and around the city of the paper."""

_NAMES = ("name", "title", "Name", "NAME")
_NOTES = ("note", "description")
_COLORS = ("color", "marker-color", "stroke")
_MAX_HEIGHT_M = 100_000.0
_MAX_NUMBER = 1e300
_PARTS = {"MultiPoint": "Point", "MultiLineString": "LineString", "MultiPolygon": "Polygon"}
_TYPES = ("Point", "LineString", "Polygon", *_PARTS, "GeometryCollection")

ToWgs84 = Callable[[float, float], tuple[float, float]]
"""Takes the two coordinates of a file; returns longitude and latitude, degrees."""


def load_places(path: Path, *, crs: str | None = None, geoid_undulation_m: float | None = None) -> dict[str, Any]:
    """Return the places of a GeoJSON file (RFC 7946) and the viewpoint it names, as the page takes them.

    crs: coordinate reference system of the horizontal coordinates where it is not WGS 84. geoid_undulation_m: where
    heights are above the geoid, how far that lies above the ellipsoid; None where heights are ellipsoidal. Of a place
    the properties name, note, color, and ground (height of the ground under it, as the others) are used; positions
    without a height get None. A file may hold beside its features a `viewpoint`, a Point with a height.

    Raises InvalidArgumentError, naming the feature and the value, for a file that cannot be used.
    """
    content = _read(path)
    try:
        reader = _Reader(_to_wgs84(crs, content), geoid_undulation_m or 0.0)
        places = [
            place for number, feature in enumerate(_features(content), 1) for place in reader.read(feature, number)
        ]
        return {"viewpoint": reader.viewpoint(content.get("viewpoint")), "places": places}
    except InvalidArgumentError as error:
        raise InvalidArgumentError(f"{path}: {error}") from error


class _Reader:
    def __init__(self, to_wgs84: ToWgs84, undulation_m: float) -> None:
        self._to_wgs84 = to_wgs84
        self._undulation_m = undulation_m

    def read(self, feature: Any, number: int) -> Iterator[dict[str, Any]]:
        """Yield the places of a feature: one for each of its simple shapes."""
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            raise InvalidArgumentError(f"feature {number} is {_shown(feature)}; expected an object of type Feature")
        properties = feature.get("properties") or {}
        if not isinstance(properties, dict):
            raise InvalidArgumentError(f"feature {number}: properties = {_shown(properties)}; expected an object")
        name = _text(properties, _NAMES, f"feature {number}") or f"Place {number}"
        what = f"feature {number} ({name!r})"
        ground = properties.get("ground")
        if ground is not None:
            ground = _number(ground, f"{what}: ground", _MAX_HEIGHT_M) + self._undulation_m
        for part, (kind, coordinates) in enumerate(self._shapes(feature.get("geometry"), what)):
            yield {
                "id": f"{number}" if part == 0 else f"{number}.{part}",
                "name": name,
                "kind": kind,
                "note": _text(properties, _NOTES, what),
                "color": _text(properties, _COLORS, what) or None,
                "coordinates": coordinates,
                "ground": ground,
            }

    def viewpoint(self, point: Any) -> dict[str, float] | None:
        """Return where the file says to stand, if it does."""
        if point is None:
            return None
        kind, coordinates = next(self._shapes(point, "viewpoint"), ("nothing", []))
        position = coordinates[0] if kind == "point" else [None, None, None]
        if position[2] is None:
            raise InvalidArgumentError(f"viewpoint = {_shown(point)}; expected a Point with a height")
        return {"latitude": position[1], "longitude": position[0], "height": position[2]}

    def _shapes(self, geometry: Any, what: str) -> Iterator[tuple[str, list[Any]]]:
        """Yield kind and coordinates of each simple shape of a geometry; a feature without one has none."""
        if geometry is None:
            return
        if not isinstance(geometry, dict) or geometry.get("type") not in _TYPES:
            kind = geometry.get("type") if isinstance(geometry, dict) else geometry
            raise InvalidArgumentError(f"{what}: geometry {_shown(kind)}; allowed: {', '.join(_TYPES)}")
        kind = geometry["type"]
        if kind == "GeometryCollection":
            for member in _list(geometry.get("geometries"), f"{what}: geometries"):
                yield from self._shapes(member, what)
            return
        coordinates = geometry.get("coordinates")
        if kind in _PARTS:
            for part in _list(coordinates, f"{what}: coordinates"):
                yield self._shape(_PARTS[kind], part, what)
        else:
            yield self._shape(kind, coordinates, what)

    def _shape(self, kind: str, coordinates: Any, what: str) -> tuple[str, list[Any]]:
        if kind == "Point":
            return "point", [self._position(coordinates, what)]
        if kind == "LineString":
            return "line", self._positions(coordinates, what, 2)
        rings = [self._positions(ring, what, 4) for ring in _list(coordinates, f"{what}: coordinates")]
        if not rings:
            raise InvalidArgumentError(f"{what}: a Polygon without a ring")
        for ring in rings:
            if ring[0] != ring[-1]:
                raise InvalidArgumentError(
                    f"{what}: a ring begins at {ring[0]} and ends at {ring[-1]}; repeat its first position at its end"
                )
        return "polygon", rings

    def _positions(self, coordinates: Any, what: str, least: int) -> list[list[float | None]]:
        positions = [self._position(each, what) for each in _list(coordinates, f"{what}: coordinates")]
        if len(positions) < least:
            raise InvalidArgumentError(f"{what}: {len(positions)} positions; at least {least} are needed")
        return positions

    def _position(self, values: Any, what: str) -> list[float | None]:
        if not isinstance(values, list) or len(values) < 2:
            raise InvalidArgumentError(f"{what}: position {_shown(values)}; expected [longitude, latitude, height]")
        x, y = (_number(value, f"{what}: coordinate") for value in values[:2])
        longitude, latitude = self._to_wgs84(x, y)
        if not (abs(longitude) <= 180 and abs(latitude) <= 90):
            raise InvalidArgumentError(
                f"{what}: position [{x:g}, {y:g}] is no longitude and latitude in degrees; name the coordinate"
                " reference system of the file with --crs"
            )
        height = None
        if len(values) > 2 and values[2] is not None:
            height = round(_number(values[2], f"{what}: height", _MAX_HEIGHT_M) + self._undulation_m, 3)
        return [round(longitude, 9), round(latitude, 9), height]


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise InvalidArgumentError(f"cannot read {path}: {error.strerror}; name a GeoJSON file") from error
    except ValueError as error:
        raise InvalidArgumentError(f"{path} is not JSON ({error}); name a GeoJSON file") from error
    except RecursionError:
        raise InvalidArgumentError(f"{path} is nested too deep for GeoJSON; name a GeoJSON file") from None
    if not isinstance(content, dict) or "type" not in content:
        raise InvalidArgumentError(f"{path} is not GeoJSON: expected an object with a type, such as FeatureCollection")
    return content


def _features(content: dict[str, Any]) -> list[Any]:
    if content["type"] == "FeatureCollection":
        return _list(content.get("features"), "features")
    if content["type"] == "Feature":
        return [content]
    return [{"type": "Feature", "geometry": content}]


def _to_wgs84(crs: str | None, content: dict[str, Any]) -> ToWgs84:
    """Return the way from the file's horizontal coordinates to WGS 84."""
    if crs is None:
        _refuse_another_crs(content)
        return lambda x, y: (x, y)
    try:
        from pyproj import CRS, Transformer
        from pyproj.exceptions import ProjError
    except ImportError as error:
        raise MissingExtraError("--crs needs pyproj; install it with: pip install 'posed[web]'") from error
    try:
        # Of a compound system the first part is the horizontal one: heights are as the user states them.
        named = CRS.from_user_input(crs)
        horizontal = named.sub_crs_list[0] if named.is_compound else named.to_2d()
        if not (horizontal.is_geographic or horizontal.is_projected):
            raise InvalidArgumentError(
                f"--crs {crs!r} is a {horizontal.type_name}; give the code of the horizontal system, such as EPSG:2100"
            )
        transformer = Transformer.from_crs(horizontal, CRS.from_epsg(4326), always_xy=True)
    except ProjError as error:
        raise InvalidArgumentError(
            f"--crs {crs!r} is no coordinate reference system ({error}); give its code, such as EPSG:2100"
        ) from error

    def transform(x: float, y: float) -> tuple[float, float]:
        longitude, latitude = transformer.transform(x, y)
        if not (math.isfinite(longitude) and math.isfinite(latitude)):
            raise InvalidArgumentError(f"coordinates [{x:g}, {y:g}] lie outside {crs}; check --crs")
        return longitude, latitude

    return transform


def _refuse_another_crs(content: dict[str, Any]) -> None:
    """Files made before RFC 7946 may name a system of their own, which would go unheeded."""
    try:
        named = str(content["crs"]["properties"]["name"])
    except (KeyError, TypeError):
        return
    if not named.endswith(("CRS84", ":4326", ":4979")):
        raise InvalidArgumentError(f"its crs is {named!r}; give it with --crs")


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidArgumentError(f"{what} is {_shown(value)}; expected a list")
    return value


def _number(value: Any, what: str, limit: float = math.inf) -> float:
    # Compared, not converted: JSON has whole numbers that no float can hold.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= min(limit, _MAX_NUMBER):
        within = "" if math.isinf(limit) else f" within {limit:g} m of the ellipsoid"
        raise InvalidArgumentError(f"{what} {_shown(value)}; expected a number{within}")
    return float(value)


def _text(properties: dict[str, Any], keys: tuple[str, ...], what: str) -> str:
    """Return the first of the properties that is there, as text."""
    text = next((str(properties[key]) for key in keys if properties.get(key) not in (None, "")), "")
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InvalidArgumentError(f"{what}: {text!r} holds half a character; write it as UTF-8") from None
    return text


def _shown(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else f"{text[:57]}..."
