"""SensorManager's static helpers: rotation matrices, angles and altitude (android.hardware.SensorManager).

Frames: device x right, y up, z out of the screen; world east, north, up. Matrices are row-major, map device to world,
and have 9 values (3 x 3) or 16 (4 x 4); angles are radians. Android writes into arrays it is given and returns False
where it cannot; here the result is returned, and None where Android returns False. The arithmetic is double precision,
where Android's is single: the results agree to 1e-6 of their size.
"""

import math
from collections.abc import Sequence

from posed.errors import InvalidArgumentError

_GRAVITY = 9.81
# |g| below a tenth of gravity is free fall (SensorManager.getRotationMatrix).
_FREE_FALL_SQUARED = 0.01 * _GRAVITY * _GRAVITY
# Nearer than that to a pole, or to a field along gravity, there is no east.
_SHORTEST_EAST = 0.1
_AXIS_BITS = 0x83
_NEGATIVE = 0x80


class SensorMaths:
    """Android's static helpers, which SensorManager inherits; constants are its own."""

    AXIS_X = 1
    AXIS_Y = 2
    AXIS_Z = 3
    AXIS_MINUS_X = _NEGATIVE | 1
    AXIS_MINUS_Y = _NEGATIVE | 2
    AXIS_MINUS_Z = _NEGATIVE | 3
    STANDARD_GRAVITY = 9.80665
    """m/s2."""
    PRESSURE_STANDARD_ATMOSPHERE = 1013.25
    """hPa."""
    MAGNETIC_FIELD_EARTH_MAX = 60.0
    """uT."""
    MAGNETIC_FIELD_EARTH_MIN = 30.0
    """uT."""

    @staticmethod
    def get_rotation_matrix(
        gravity: Sequence[float], geomagnetic: Sequence[float], size: int = 9
    ) -> tuple[list[float], list[float]] | None:
        """Return (R, I) from an accelerometer (m/s2) and a magnetometer reading (uT): device to world, inclination.

        I turns the field into the world's horizontal and vertical parts. size: 9 or 16 values each. None in free fall,
        and where the field is too weak or too steep to have a north. Raises InvalidArgumentError for other shapes.
        """
        ax, ay, az = _vector("gravity", gravity)
        ex, ey, ez = _vector("geomagnetic", geomagnetic)
        if ax * ax + ay * ay + az * az < _FREE_FALL_SQUARED:
            return None
        hx, hy, hz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
        length = math.sqrt(hx * hx + hy * hy + hz * hz)
        # Not `<`: a NaN reading has no direction either.
        if not length >= _SHORTEST_EAST:
            return None
        hx, hy, hz = hx / length, hy / length, hz / length
        length = math.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax / length, ay / length, az / length
        mx, my, mz = ay * hz - az * hy, az * hx - ax * hz, ax * hy - ay * hx
        strength = math.sqrt(ex * ex + ey * ey + ez * ez)
        c = (ex * mx + ey * my + ez * mz) / strength
        s = (ex * ax + ey * ay + ez * az) / strength
        rotation = [hx, hy, hz, mx, my, mz, ax, ay, az]
        return _sized(rotation, size), _sized([1.0, 0.0, 0.0, 0.0, c, s, 0.0, -s, c], size)

    @staticmethod
    def get_inclination(inclination: Sequence[float]) -> float:
        """Return the dip (rad) of get_rotation_matrix's I; negative where the field points down, as Android has it."""
        if len(inclination) == 9:
            return math.atan2(inclination[5], inclination[4])
        rows = _rows("inclination", inclination)
        return math.atan2(rows[1][2], rows[1][1])

    @staticmethod
    def get_orientation(rotation: Sequence[float]) -> tuple[float, float, float]:
        """Return (azimuth, pitch, roll): 0 to north and +-pi, +-pi/2, +-pi.

        Right edge lowered is a positive roll, top edge lowered a positive pitch, as Android's code has it.
        """
        (_, r01, _), (_, r11, _), (r20, r21, r22) = _rows("rotation", rotation)
        return math.atan2(r01, r11), _asin(-r21), math.atan2(-r20, r22)

    @staticmethod
    def get_rotation_matrix_from_vector(vector: Sequence[float], size: int = 9) -> list[float]:
        """Return the rotation matrix (9 or 16 values) of a rotation vector's x, y, z and, if it is there, w."""
        w, x, y, z = SensorMaths.get_quaternion_from_vector(vector)
        return _sized(
            [
                1 - 2 * (y * y + z * z),
                2 * (x * y - z * w),
                2 * (x * z + y * w),
                2 * (x * y + z * w),
                1 - 2 * (x * x + z * z),
                2 * (y * z - x * w),
                2 * (x * z - y * w),
                2 * (y * z + x * w),
                1 - 2 * (x * x + y * y),
            ],
            size,
        )

    @staticmethod
    def get_quaternion_from_vector(vector: Sequence[float]) -> tuple[float, float, float, float]:
        """Return (w, x, y, z), in Android's order, of a rotation vector; a w that is missing is taken as positive."""
        if len(vector) < 3:
            raise InvalidArgumentError(f"a rotation vector has 3 values or more, not {len(vector)}")
        x, y, z = vector[:3]
        w = vector[3] if len(vector) >= 4 else math.sqrt(max(0.0, 1 - x * x - y * y - z * z))
        return w, x, y, z

    @staticmethod
    def get_angle_change(rotation: Sequence[float], previous_rotation: Sequence[float]) -> tuple[float, float, float]:
        """Return the turn from one matrix to another about z, x and y of the earlier device frame (rad)."""
        now, before = _rows("rotation", rotation), _rows("previous_rotation", previous_rotation)

        def change(row: int, column: int) -> float:
            return sum(before[k][row] * now[k][column] for k in range(3))

        return math.atan2(change(0, 1), change(1, 1)), _asin(-change(2, 1)), math.atan2(-change(2, 0), change(2, 2))

    @staticmethod
    def get_altitude(sea_level_pressure: float, pressure: float) -> float:
        """Return metres above sea level from two pressures (hPa); NaN where their ratio is negative, as Android's."""
        if sea_level_pressure == 0.0:
            return -math.inf if pressure else math.nan
        ratio = pressure / sea_level_pressure
        return 44330.0 * (1.0 - ratio ** (1.0 / 5.255)) if ratio >= 0.0 else math.nan

    @staticmethod
    def remap_coordinate_system(rotation: Sequence[float], x: int, y: int) -> list[float] | None:
        """Return the matrix in other device axes: x and y say along which world-held axis the new ones lie.

        AXIS_X, AXIS_Z is for a camera's view; AXIS_Y, AXIS_MINUS_X for a phone turned to landscape. None for what are
        no two different axes.
        """
        if (x | y) & ~_AXIS_BITS or not x & 3 or not y & 3 or x & 3 == y & 3:
            return None
        rows = _rows("rotation", rotation)
        z = x ^ y
        # An axis that turns the wrong way round makes the third one negative.
        if ((x & 3) % 3, (y & 3) % 3) not in ((1, 2), (2, 0), (0, 1)):
            z ^= _NEGATIVE
        signed = [(axis & 3, -1.0 if axis & _NEGATIVE else 1.0) for axis in (x, y, z)]
        out = [0.0] * 9
        for row in range(3):
            for new, (axis, sign) in enumerate(signed):
                out[3 * row + axis - 1] = sign * rows[row][new]
        return _sized(out, len(rotation))


def _vector(name: str, values: Sequence[float]) -> tuple[float, float, float]:
    if len(values) < 3:
        raise InvalidArgumentError(f"{name} has 3 values, not {len(values)}")
    return values[0], values[1], values[2]


def _asin(value: float) -> float:
    # A product of two matrices read from float32 can lie a rounding step outside.
    return math.asin(max(-1.0, min(1.0, value)))


def _rows(name: str, matrix: Sequence[float]) -> tuple[tuple[float, float, float], ...]:
    if len(matrix) not in (9, 16):
        raise InvalidArgumentError(f"{name} has {len(matrix)} values; allowed: 9 (3 x 3) or 16 (4 x 4)")
    width = 3 if len(matrix) == 9 else 4
    return tuple((matrix[k], matrix[k + 1], matrix[k + 2]) for k in (0, width, 2 * width))


def _sized(matrix: list[float], size: int) -> list[float]:
    if size == 9:
        return matrix
    if size != 16:
        raise InvalidArgumentError(f"size = {size}; allowed: 9 (3 x 3) or 16 (4 x 4)")
    return [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0, 0.0, 0.0, 0.0, 1.0]
