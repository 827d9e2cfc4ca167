"""Patonis et al. 2018 (Sensors 18, 2616) to the letter, to compare `dcm` with.

First-order increments (Eq. 3), the process noise's diagonal (Eq. 9), the heading column by the axis that the raw
accelerometer finds upward (Fig. 1), rows made square after each gyroscope sample by Eq. 16-18, whose third row is the
product of the other two. No bias, no gate, no rest: calibration is left to others.

Read into the letter only where it cannot run:
- Eq. 1 prints element (2, 2) with a cosine of roll twice and its product in reverse: it is Rz(heading) Ry(pitch)
  Rx(roll), of world axes east, north, up, the only ones in which all matrices of Table 3 are rotations;
- Fig. 1 looks for the largest acceleration without its sign; an axis that points down would leave a vertical one to
  tell the heading: the largest magnitude counts;
- Fig. 1's roll, pitch and heading have no formulas: arctangents of two arguments, in the permuted axes;
- Eq. 7 equates m/s2 with cosines: the sample is divided by its norm ("normalized components"), and so is its noise;
- Eq. 11, 13, 15: the measured column is Eq. 1's first, whose tilt is that of row 3; the magnetometer's noise by the
  covariance law is that of a sample over the horizontal field;
- Eq. 16-18 throw away the third row, which alone the accelerometer corrects: with nothing else, little of a correction
  outlives the next gyroscope sample (65 deg over four of BROAD's recordings, with the parts' variances). The text has
  them for the process model and Eq. 1 for the measurement model, so a correction ends with Eq. 1: roll and pitch of
  row 3, heading of its column;
- the variances are those of `dcm`, so that the equations are compared. The parts' alone, of which the paper speaks,
  follow linear acceleration within a second (62 deg over the same four, Eq. 1 included);
- when the heading column changes, its variances stay;
- the start, and whatever happens while no gyroscope sample came for half a second, is Fig. 1's matrix.

The raw accelerometer costs most: linear acceleration makes it choose an axis that stands upright for the heading.
"""

from collections.abc import Iterable, Mapping, Sequence
from math import atan2, cos, nan, pi, sin, sqrt
from typing import Any

from posed.errors import InvalidArgumentError
from posed.events import STANDARD_GRAVITY, FilterStatus, FlatEvent, Orientation, SensorType
from posed.fusion.dcm_literal_state import LiteralParams, LiteralState
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.saved import filled, plain

__all__ = ["LiteralFilter", "LiteralParams"]

_ACCELEROMETER = int(SensorType.ACCELEROMETER)
_MAGNETIC_FIELD = int(SensorType.MAGNETIC_FIELD)
_GYROSCOPE = int(SensorType.GYROSCOPE)

_MAX_STEP_NS = 500_000_000
"""A longer step of time is a gap."""
_MAX_STEP_S = 0.5
_FIRST_STEP_S = 0.02
"""What the first sample of a sensor stands for: GAME's period, for want of a predecessor."""
_MAX_TIME_NS = 2**62
_UNKNOWN_HEADING = pi / sqrt(3.0)
"""rad, one sigma of a heading of which nothing is known (uniform over the circle)."""

# Squared norms beyond which a sample is no measurement; comparisons are written so that NaN fails them.
_MAX_MEASUREMENT2 = 10_000.0**2
_MAX_RATE2 = 100.0**2
_MIN_NORM2 = 1e-12

_Vector = tuple[float, float, float]


class LiteralFilter:
    """The filter: `params` it was made with, `state` all that changes."""

    name = "dcm-literal"

    def __init__(self, params: LiteralParams | None = None, state: LiteralState | None = None) -> None:
        self.params = params if params is not None else LiteralParams()
        self.state = state if state is not None else LiteralState()
        p = self.params
        self._gyro_density2 = p.noise.gyro_density**2 + p.rotation_density**2

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        """Take one event: m/s2, rad/s or uT in device axes; other sensor types are ignored.

        A gyroscope sample stands for the mean rate since the one before it. Accelerometer and magnetometer samples
        correct the matrix as it stands when they come (Fig. 4).
        """
        self._take(int(sensor_type), int(timestamp_ns), float(x), float(y), float(z))

    def update_batch(self, events: Iterable[FlatEvent]) -> None:
        """Take events in the order given, each as by `update`."""
        for sensor_type, timestamp_ns, x, y, z in events:
            self._take(sensor_type, timestamp_ns, x, y, z)

    def orientation(self) -> Orientation | None:
        """Return the orientation of the matrix, None until gravity and north have been seen."""
        s = self.state
        if not s.started:
            return None
        status = s.events
        # The column is as long as its axis is level; both its elements are as uncertain as its direction.
        length2 = sum(each * each for each in _column(s, s.column)[:2])
        accuracy = min(sqrt((s.p1 + s.p2) / (2.0 * max(length2, _MIN_NORM2))), _UNKNOWN_HEADING)
        if not s.has_north:
            status |= FilterStatus.INITIALISING
            accuracy = _UNKNOWN_HEADING
        if s.gyro_lost:
            status |= FilterStatus.GYRO_LOST
        rate = (s.rate_x, s.rate_y, s.rate_z)
        return Orientation(s.time_ns, _quaternion(s), rate, accuracy, FilterStatus(status))

    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return zeros: the paper leaves the bias to calibration, and how well that was done is not known (NaN)."""
        return (0.0, 0.0, 0.0), (nan, nan, nan)

    def clear_events(self) -> None:
        """Forget GAP and BAD_SAMPLE; their counts stay."""
        self.state.events = 0

    def save(self) -> dict[str, Any]:
        """Return the state as values that JSON can hold."""
        return {"filter": self.name, "state": plain(self.state)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue from what `save` returned; raises InvalidArgumentError for anything else."""
        if saved.get("filter") != self.name:
            raise InvalidArgumentError(
                f"the saved state is of filter {saved.get('filter')!r}; restore it into that one, not {self.name!r}"
            )
        self.state = filled(LiteralState, saved.get("state"), "state")

    def _take(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        if sensor_type not in (_ACCELEROMETER, _MAGNETIC_FIELD, _GYROSCOPE):
            return
        limit2 = _MAX_RATE2 if sensor_type == _GYROSCOPE else _MAX_MEASUREMENT2
        if not (x * x + y * y + z * z < limit2 and -_MAX_TIME_NS < t < _MAX_TIME_NS):
            self.state.flag_bad_sample()
        elif sensor_type == _GYROSCOPE:
            self._take_rate(t, x, y, z)
        else:
            self._measure(sensor_type, t, x, y, z)

    def _take_rate(self, t: int, x: float, y: float, z: float) -> None:
        """Procedure 1 of Fig. 4: turn the matrix by a gyroscope sample."""
        s = self.state
        step_ns = t - s.gyro_ns if s.has_gyro else 0
        if s.has_gyro and -_MAX_STEP_NS <= step_ns <= 0:
            s.flag_gap()
            return
        if abs(step_ns) > _MAX_STEP_NS:
            # Far back counts as a gap too: a source whose clock was set back must not lock the filter out.
            s.flag_gap()
            s.has_north = s.has_acc = s.has_mag = False
            step_ns = 0
        s.has_gyro = True
        s.gyro_lost = False
        s.gyro_ns = s.time_ns = t
        s.rate_x, s.rate_y, s.rate_z = x, y, z
        dt = step_ns * 1e-9
        self._grow_variances(self._gyro_density2 * dt)
        self._turn(x * dt, y * dt, z * dt)
        self._make_orthonormal()

    def _grow_variances(self, q: float) -> None:
        """Add the process noise (Eq. 9), q = sigma^2(G) dt^2, to row 3 and, alike, to the heading column."""
        s = self.state
        s.p31 += q * (s.r33 * s.r33 + s.r32 * s.r32)
        s.p32 += q * (s.r33 * s.r33 + s.r31 * s.r31)
        s.p33 += q * (s.r32 * s.r32 + s.r31 * s.r31)
        q1, q2, _ = _column(s, (s.column + 1) % 3)
        r1, r2, _ = _column(s, (s.column + 2) % 3)
        s.p1 += q * (q1 * q1 + r1 * r1)
        s.p2 += q * (q2 * q2 + r2 * r2)

    def _turn(self, x: float, y: float, z: float) -> None:
        """Multiply by I + [x y z]x, angles in rad (Eq. 3, of which Eq. 6, 8, 10, 12 and 14 are parts)."""
        s = self.state
        s.r11, s.r12, s.r13 = (
            s.r11 + s.r12 * z - s.r13 * y,
            s.r12 - s.r11 * z + s.r13 * x,
            s.r13 + s.r11 * y - s.r12 * x,
        )
        s.r21, s.r22, s.r23 = (
            s.r21 + s.r22 * z - s.r23 * y,
            s.r22 - s.r21 * z + s.r23 * x,
            s.r23 + s.r21 * y - s.r22 * x,
        )
        s.r31, s.r32, s.r33 = (
            s.r31 + s.r32 * z - s.r33 * y,
            s.r32 - s.r31 * z + s.r33 * x,
            s.r33 + s.r31 * y - s.r32 * x,
        )

    def _make_orthonormal(self) -> None:
        """Share the error of rows 1 and 2, make row 3 their product, and all of length 1 (Eq. 16-18)."""
        s = self.state
        rows = _orthonormal(s)
        if rows is None:
            s.flag_bad_sample()
            s.started = s.has_north = False
            return
        (s.r11, s.r12, s.r13), (s.r21, s.r22, s.r23), (s.r31, s.r32, s.r33) = rows

    def _measure(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        known, last = (s.has_acc, s.acc_ns) if sensor_type == _ACCELEROMETER else (s.has_mag, s.mag_ns)
        if (known and 0 <= last - t <= _MAX_STEP_NS) or (s.has_gyro and s.gyro_ns - t > _MAX_STEP_NS):
            s.flag_gap()
            return
        if s.has_gyro and t - s.gyro_ns > _MAX_STEP_NS:
            s.flag_gap()
            s.has_gyro = s.has_north = s.has_acc = s.has_mag = False
            s.gyro_lost = True
            s.rate_x = s.rate_y = s.rate_z = 0.0
        dt = min((t - last) * 1e-9, _MAX_STEP_S) if known and t > last else _FIRST_STEP_S
        norm = sqrt(x * x + y * y + z * z)
        if sensor_type == _ACCELEROMETER:
            s.has_acc = norm * norm > _MIN_NORM2
            s.acc_ns = t
            if s.has_acc:
                self._correct_tilt(dt, norm, x / norm, y / norm, z / norm)
            else:
                s.flag_bad_sample()
        else:
            s.has_mag = True
            s.mag_ns = t
            if s.has_acc:
                self._correct_heading(t, dt, x, y, z)

    def _correct_tilt(self, dt: float, norm: float, x: float, y: float, z: float) -> None:
        """Procedure 2 of Fig. 4: correct row 3 by a normalised accelerometer sample (Eq. 7)."""
        s = self.state
        s.acc_x, s.acc_y, s.acc_z = x, y, z
        s.column = _heading_column(x, y, z)
        if not (s.has_north and s.has_gyro):
            return
        noise = self._acc_variance(dt) / (norm * norm)
        s.r31, s.p31 = _corrected(s.r31, s.p31, x, noise)
        s.r32, s.p32 = _corrected(s.r32, s.p32, y, noise)
        s.r33, s.p33 = _corrected(s.r33, s.p33, z, noise)
        east, north, _ = _column(s, s.column)
        self._set(_equation_1(s.column, (s.r31, s.r32, s.r33), atan2(north, east)))

    def _correct_heading(self, t: int, dt: float, x: float, y: float, z: float) -> None:
        """Procedure 3 of Fig. 4: correct the heading column by a magnetometer sample (Eq. 11, 13, 15)."""
        s = self.state
        goes_on = s.has_north and s.has_gyro
        up = (s.r31, s.r32, s.r33) if goes_on else (s.acc_x, s.acc_y, s.acc_z)
        along, across = _level(s.column, up, (x, y, z))
        horizontal2 = along * along + across * across
        if not horizontal2 > _MIN_NORM2:
            s.flag_bad_sample()
            return
        noise = (self.params.noise.mag_std**2 + self.params.field_density**2 / dt) / horizontal2
        # Counted from east: the level axes see a field that points north.
        heading = atan2(along, across)
        if goes_on:
            east, north, _ = _column(s, s.column)
            measured_east, measured_north, _ = _equation_1(s.column, up, heading)[s.column]
            east, s.p1 = _corrected(east, s.p1, measured_east, noise)
            north, s.p2 = _corrected(north, s.p2, measured_north, noise)
            heading = atan2(north, east)
        else:
            s.p31 = s.p32 = s.p33 = self._acc_variance(_FIRST_STEP_S) / STANDARD_GRAVITY**2
            s.p1 = s.p2 = noise
            s.started = s.has_north = True
            if not s.has_gyro:
                s.time_ns = t
        self._set(_equation_1(s.column, up, heading))

    def _acc_variance(self, dt: float) -> float:
        return self.params.noise.acc_std**2 + self.params.acceleration_density**2 / dt

    def _set(self, columns: Sequence[_Vector]) -> None:
        s = self.state
        (s.r11, s.r21, s.r31), (s.r12, s.r22, s.r32), (s.r13, s.r23, s.r33) = columns


def _corrected(value: float, variance: float, measured: float, noise: float) -> tuple[float, float]:
    """Return a state and its variance after a measurement: the scalar Kalman filter, H = 1."""
    gain = variance / (variance + noise)
    return value + gain * (measured - value), variance - gain * variance


def _heading_column(x: float, y: float, z: float) -> int:
    """Return whose column tells the heading: z up takes x, x up takes y, y up takes z (Fig. 1)."""
    if abs(z) >= abs(x) and abs(z) >= abs(y):
        return 0
    return 1 if abs(x) >= abs(y) else 2


def _order(column: int) -> tuple[int, int, int]:
    """Return the axes as Fig. 1 permutes them: the heading's first, the upward one last."""
    return column, (column + 1) % 3, (column + 2) % 3


def _roll_and_pitch(column: int, up: _Vector) -> tuple[float, float]:
    a1, a2, a3 = (up[axis] for axis in _order(column))
    return atan2(a2, a3), atan2(-a1, sqrt(a2 * a2 + a3 * a3))


def _level(column: int, up: _Vector, field: _Vector) -> tuple[float, float]:
    """Return the field (uT) along the heading axis laid level, and square to that in the horizontal plane (Fig. 1)."""
    roll, pitch = _roll_and_pitch(column, up)
    m1, m2, m3 = (field[axis] for axis in _order(column))
    along = m1 * cos(pitch) + (m2 * sin(roll) + m3 * cos(roll)) * sin(pitch)
    return along, m2 * cos(roll) - m3 * sin(roll)


def _equation_1(column: int, up: _Vector, heading: float) -> Sequence[_Vector]:
    """Return the columns of the matrix by Eq. 1, in the order of the device's axes again (Eq. 2)."""
    roll, pitch = _roll_and_pitch(column, up)
    sf, cf, st, ct, sh, ch = sin(roll), cos(roll), sin(pitch), cos(pitch), sin(heading), cos(heading)
    first = (ct * ch, ct * sh, -st)
    second = (sf * st * ch - cf * sh, sf * st * sh + cf * ch, sf * ct)
    third = (cf * st * ch + sf * sh, cf * st * sh - sf * ch, cf * ct)
    return ((first, second, third), (third, first, second), (second, third, first))[column]


def _orthonormal(s: LiteralState) -> tuple[_Vector, _Vector, _Vector] | None:
    """Return the rows by Eq. 16-18 and the division by their lengths; None if two rows have become parallel."""
    error = s.r11 * s.r21 + s.r12 * s.r22 + s.r13 * s.r23
    half = 0.5 * error
    x1, x2, x3 = s.r11 - half * s.r21, s.r12 - half * s.r22, s.r13 - half * s.r23
    y1, y2, y3 = s.r21 - half * s.r11, s.r22 - half * s.r12, s.r23 - half * s.r13
    x, y = _unit(x1, x2, x3), _unit(y1, y2, y3)
    z = _unit(x2 * y3 - x3 * y2, x3 * y1 - x1 * y3, x1 * y2 - x2 * y1)
    return None if x is None or y is None or z is None else (x, y, z)


def _unit(x: float, y: float, z: float) -> _Vector | None:
    norm2 = x * x + y * y + z * z
    if not norm2 > _MIN_NORM2:
        return None
    norm = sqrt(norm2)
    return x / norm, y / norm, z / norm


def _quaternion(s: LiteralState) -> tuple[float, float, float, float]:
    rows = _orthonormal(s)
    (_, north, up) = rows if rows is not None else ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return DirectionCosines(*north, *up).quaternion()


def _column(s: LiteralState, column: int) -> _Vector:
    return ((s.r11, s.r21, s.r31), (s.r12, s.r22, s.r32), (s.r13, s.r23, s.r33))[column]
