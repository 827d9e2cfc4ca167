"""SensorManager's static helpers against golden vectors and Android's own properties."""

import math
import random
from collections.abc import Sequence

import pytest

from posed.client import SensorManager
from posed.errors import InvalidArgumentError

_TOLERANCE = 1e-4
_H = math.sqrt(0.5)
_S, _C = math.sin(math.radians(15)), math.cos(math.radians(15))

# Pose, quaternion (x, y, z, w) device to world, azimuth, pitch and roll in degrees. The field has 22 uT to the north
# and 42 uT down, gravity 9.81 m/s2.
_POSES = [
    ("flat, top to north", (0, 0, 0, 1), (0, 0, 0)),
    ("flat, top to east", (0, 0, -_H, _H), (90, 0, 0)),
    ("flat, top to south", (0, 0, 1, 0), (180, 0, 0)),
    ("flat, top to west", (0, 0, _H, _H), (-90, 0, 0)),
    ("upright, camera to north", (_H, 0, 0, _H), (0, -90, 0)),
    ("top edge raised", (_S, 0, 0, _C), (0, -30, 0)),
    ("top edge lowered", (-_S, 0, 0, _C), (0, 30, 0)),
    ("right edge lowered", (0, _S, 0, _C), (0, 0, 30)),
    ("left edge lowered", (0, -_S, 0, _C), (0, 0, -30)),
    ("face down", (0, 1, 0, 0), (0, 0, 180)),
    ("landscape, screen to south", (0.5, -0.5, 0.5, 0.5), (-90, 0, -90)),
]


def _readings(q: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return what accelerometer and magnetometer read in a pose, by way of a rotation written differently."""
    x, y, z, w = q

    def to_device(v: tuple[float, float, float]) -> list[float]:
        # v + 2 u x (u x v - w v) is the inverse rotation.
        t = _cross((x, y, z), v)
        t = [a - w * b for a, b in zip(t, v, strict=True)]
        return [a + 2 * b for a, b in zip(v, _cross((x, y, z), t), strict=True)]

    return to_device((0.0, 0.0, 9.81)), to_device((0.0, 22.0, -42.0))


def _cross(a: Sequence[float], b: Sequence[float]) -> list[float]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _assert_angles(found: Sequence[float], expected_deg: Sequence[float]) -> None:
    # Looking straight up or down, heading and roll are one angle, which the last bit of a matrix splits at will.
    gimbal = abs(expected_deg[1]) == 90
    for angle, degrees in [(found[1], expected_deg[1])] if gimbal else zip(found, expected_deg, strict=True):
        assert math.remainder(angle - math.radians(degrees), 2 * math.pi) == pytest.approx(0, abs=_TOLERANCE)


@pytest.mark.parametrize(("q", "angles"), [pose[1:] for pose in _POSES], ids=[pose[0] for pose in _POSES])
@pytest.mark.parametrize("size", [9, 16])
def test_golden_poses(q: tuple[float, ...], angles: tuple[float, ...], size: int) -> None:
    accelerometer, field = _readings(q)
    found = SensorManager.get_rotation_matrix(accelerometer, field, size)
    assert found is not None
    rotation, inclination = found
    assert rotation == pytest.approx(SensorManager.get_rotation_matrix_from_vector(q, size), abs=_TOLERANCE)
    _assert_angles(SensorManager.get_orientation(rotation), angles)
    assert math.degrees(SensorManager.get_inclination(inclination)) == pytest.approx(-62.35, abs=0.01)


def test_the_landscape_readings_of_the_golden_table() -> None:
    assert _readings((0.5, -0.5, 0.5, 0.5)) == ([9.81, 0, 0], [-42, 0, -22])


@pytest.mark.parametrize(
    ("gravity", "field"),
    [
        ((0.0, 0.0, 0.5), (0.0, 22.0, -42.0)),
        ((0.0, 0.0, 9.81), (0.0, 0.0, -42.0)),
        ((0.0, 0.0, 9.81), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 9.81), (math.nan, 0.0, 0.0)),
    ],
    ids=["free fall", "field along gravity", "no field", "no number"],
)
def test_there_is_no_matrix_without_down_or_north(gravity: tuple[float, ...], field: tuple[float, ...]) -> None:
    assert SensorManager.get_rotation_matrix(gravity, field) is None


def test_a_rotation_vector_of_three_values_stands_for_one_of_four() -> None:
    for _, (x, y, z, w), _ in _POSES:
        assert SensorManager.get_quaternion_from_vector((x, y, z, w)) == (w, x, y, z)
        assert SensorManager.get_quaternion_from_vector((x, y, z)) == pytest.approx((w, x, y, z), abs=_TOLERANCE)
    assert SensorManager.get_quaternion_from_vector((1.1, 0, 0)) == (0, 1.1, 0, 0)


def test_angle_change_is_the_orientation_of_one_seen_from_the_other() -> None:
    level = SensorManager.get_rotation_matrix_from_vector((0, 0, 0, 1))
    for _, q, angles in _POSES:
        rotation = SensorManager.get_rotation_matrix_from_vector(q, 16)
        _assert_angles(SensorManager.get_angle_change(rotation, level), angles)
        _assert_angles(SensorManager.get_angle_change(rotation, rotation), (0, 0, 0))


def test_altitude() -> None:
    assert SensorManager.get_altitude(SensorManager.PRESSURE_STANDARD_ATMOSPHERE, 1000) == pytest.approx(110.9, abs=0.1)
    assert SensorManager.get_altitude(1013.25, 900) == pytest.approx(988.6, abs=0.1)
    assert SensorManager.get_altitude(1013.25, 1013.25) == 0
    assert math.isnan(SensorManager.get_altitude(1013.25, -1))


_AXES = [sign | axis for sign in (0, 0x80) for axis in (1, 2, 3)]


@pytest.mark.parametrize("x", _AXES)
@pytest.mark.parametrize("y", _AXES)
@pytest.mark.parametrize("size", [9, 16])
def test_remapping_puts_each_new_axis_where_it_was_asked(x: int, y: int, size: int) -> None:
    rng = random.Random(1)
    rotation = SensorManager.get_rotation_matrix_from_vector(_unit([rng.gauss(0, 1) for _ in range(4)]), size)
    out = SensorManager.remap_coordinate_system(rotation, x, y)
    if x & 3 == y & 3:
        assert out is None
        return
    assert out is not None
    assert len(out) == size
    for new, axis in enumerate((x, y)):
        sign = -1 if axis & 0x80 else 1
        assert _column(out, (axis & 3) - 1) == pytest.approx([sign * v for v in _column(rotation, new)])
    # Still a rotation: right-handed.
    assert _cross(_column(out, 0), _column(out, 1)) == pytest.approx(_column(out, 2), abs=1e-9)


def _unit(q: list[float]) -> list[float]:
    length = math.hypot(*q)
    return [v / length for v in q]


def _column(matrix: Sequence[float], column: int) -> list[float]:
    width = 3 if len(matrix) == 9 else 4
    return [matrix[row * width + column] for row in range(3)]


@pytest.mark.parametrize(("x", "y"), [(0, 2), (1, 0), (4, 1), (1, 0x42), (0x80, 1), (1, 1), (1, 0x81)])
def test_what_is_no_axis_cannot_be_remapped_to(x: int, y: int) -> None:
    assert SensorManager.remap_coordinate_system([1, 0, 0, 0, 1, 0, 0, 0, 1], x, y) is None


def test_the_camera_view_of_an_upright_phone_has_a_heading() -> None:
    east = SensorManager.get_rotation_matrix_from_vector((0.5, -0.5, -0.5, 0.5))
    camera = SensorManager.remap_coordinate_system(east, SensorManager.AXIS_X, SensorManager.AXIS_Z)
    assert camera is not None
    _assert_angles(SensorManager.get_orientation(camera), (90, 0, 0))


@pytest.mark.parametrize("size", [0, 4, 12])
def test_other_shapes_are_refused_with_the_remedy(size: int) -> None:
    for refused in (
        lambda: SensorManager.get_orientation([0.0] * size),
        lambda: SensorManager.get_rotation_matrix_from_vector((0, 0, 0, 1), size),
        lambda: SensorManager.remap_coordinate_system([0.0] * size, 1, 2),
        lambda: SensorManager.get_inclination([0.0] * size),
    ):
        with pytest.raises(InvalidArgumentError, match=r"allowed: 9 \(3 x 3\) or 16"):
            refused()
