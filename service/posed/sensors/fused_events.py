"""The events of the fused sensors: one an accelerometer event, of its timestamp, from the filter's orientation."""

import math
from collections.abc import Callable, Collection

from posed.events import STANDARD_GRAVITY, EventColumn, Orientation, SensorType

_Vector = tuple[float, float, float]
_Row = tuple[float, ...]
_FULL_TURN = 360.0 - 2.0**-16
"""Degrees that the single precision of an event's values shows as 360."""


class FusedEvents:
    """Fused events of one stretch of accelerometer events, gathered one by one."""

    def __init__(self, wanted: Collection[SensorType], declination: float, motion: "PoseMotion") -> None:
        """wanted: the sensors to make events of. declination: rad, east positive. motion: of the pose 6DoF so far."""
        self._timestamps: list[int] = []
        formulas: dict[SensorType, Callable[[Orientation, _Vector], _Row]] = {
            SensorType.GRAVITY: lambda orientation, _: gravity(orientation.quaternion),
            SensorType.LINEAR_ACCELERATION: _linear_acceleration,
            SensorType.ROTATION_VECTOR: lambda orientation, _: (*orientation.quaternion, orientation.heading_accuracy),
            SensorType.ORIENTATION: lambda orientation, _: orientation_angles(orientation.quaternion),
            SensorType.HEADING: lambda orientation, _: heading(orientation, declination),
            SensorType.POSE_6DOF: lambda orientation, _: motion.row(orientation.quaternion),
        }
        self._makers = [(kind, formulas[kind]) for kind in sorted(wanted)]
        self._rows: dict[SensorType, list[_Row]] = {kind: [] for kind, _ in self._makers}

    def add(self, timestamp_ns: int, acceleration: _Vector, orientation: Orientation) -> None:
        """Compute the fused events of one accelerometer event (m/s2, device frame)."""
        self._timestamps.append(timestamp_ns)
        for kind, make in self._makers:
            self._rows[kind].append(make(orientation, acceleration))

    def columns(self) -> dict[int, EventColumn]:
        """Return one column a fused sensor, by handle; none if nothing was added."""
        if not self._timestamps:
            return {}
        return {int(kind): EventColumn.of_rows(self._timestamps, rows) for kind, rows in self._rows.items()}


class PoseMotion:
    """The pose 6DoF (TYPE_POSE_6DOF) from one event to the next.

    The world frame is east, magnetic north, up, with its origin where the phone is: nothing here measures how the phone
    moves along, so that translation and its change are zero.
    """

    def __init__(self) -> None:
        self._before: tuple[float, float, float, float] | None = None
        self._sequence = 0

    def row(self, quaternion: tuple[float, float, float, float]) -> _Row:
        """Return rotation, translation, rotation since the event before, translation since then, and number."""
        delta = (0.0, 0.0, 0.0, 1.0) if self._before is None else _between(self._before, quaternion)
        self._before = quaternion
        self._sequence += 1
        return (*quaternion, 0.0, 0.0, 0.0, *delta, 0.0, 0.0, 0.0, float(self._sequence - 1))


def gravity(quaternion: tuple[float, float, float, float]) -> _Vector:
    """Return gravity in device axes, m/s2, as an accelerometer at rest reads it."""
    x, y, z, w = quaternion
    return (
        STANDARD_GRAVITY * 2 * (x * z - w * y),
        STANDARD_GRAVITY * 2 * (y * z + w * x),
        STANDARD_GRAVITY * (1 - 2 * (x * x + y * y)),
    )


def orientation_angles(quaternion: tuple[float, float, float, float]) -> _Vector:
    """Return azimuth (0 to 360), pitch (-180 to 180) and roll (-90 to 90), degrees (AOSP OrientationSensor.cpp).

    Its roll has the other sign than getOrientation's, and its pitch another range.
    """
    x, y, z, w = quaternion
    east_x, north_x = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z)
    up_x, up_y, up_z = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    azimuth = _from_north(math.atan2(-north_x, east_x))
    return azimuth, math.degrees(math.atan2(-up_y, up_z)), math.degrees(math.asin(max(-1.0, min(1.0, up_x))))


def heading(orientation: Orientation, declination: float) -> _Row:
    """Return where the device's y axis points from true north, 0 to 360 degrees, and its accuracy (68 %), degrees."""
    x, y, z, w = orientation.quaternion
    azimuth = math.atan2(2 * (x * y - w * z), 1 - 2 * (x * x + z * z))
    return _from_north(azimuth + declination), math.degrees(orientation.heading_accuracy)


def _from_north(angle: float) -> float:
    """Return an angle (rad) in degrees, 0 or more and below 360."""
    degrees = math.degrees(angle) % 360.0
    return degrees if degrees < _FULL_TURN else 0.0


def _linear_acceleration(orientation: Orientation, acceleration: _Vector) -> _Row:
    gx, gy, gz = gravity(orientation.quaternion)
    ax, ay, az = acceleration
    return ax - gx, ay - gy, az - gz


def _between(before: tuple[float, float, float, float], after: tuple[float, float, float, float]) -> _Row:
    """Return the rotation in device axes that leads from one orientation to another, w >= 0."""
    ax, ay, az, aw = before
    bx, by, bz, bw = after
    q = (
        aw * bx - ax * bw - ay * bz + az * by,
        aw * by + ax * bz - ay * bw - az * bx,
        aw * bz - ax * by + ay * bx - az * bw,
        aw * bw + ax * bx + ay * by + az * bz,
    )
    return q if q[3] >= 0.0 else tuple(-each for each in q)
