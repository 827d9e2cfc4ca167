"""What an accelerometer and a magnetometer sample do to the adaptive filter: gravity levels C, the field finds north.

Each acts at its own time inside the newest gyroscope interval. Gravity corrects the tilt and shows the bias; the field,
freed of hard iron and let through by the gate, corrects the heading and nothing else.
"""

from math import sqrt

from posed.events import SensorType
from posed.fusion.adaptive_bias import GyroBias
from posed.fusion.adaptive_field import FieldGate
from posed.fusion.adaptive_heading import Heading
from posed.fusion.adaptive_interval import GyroInterval
from posed.fusion.adaptive_iron import HardIron
from posed.fusion.adaptive_state import AdaptiveParams, AdaptiveState
from posed.fusion.adaptive_tilt import Tilt
from posed.fusion.rest import RestBias

_ACCELEROMETER = int(SensorType.ACCELEROMETER)

_MAX_STEP_S = 0.5
_FIRST_STEP_S = 0.02
"""What the first sample of a sensor stands for: GAME's period, for want of a predecessor."""
_UNSTEADY = 0.1
"""Of the acceleration's squared norm, (m/s2)2: noise of 0.005 m/s2. A stream without any, as one writes it by hand, may
well hold the same rate for seconds."""
_MIN_ACCELERATION2 = 1.0**2
_MIN_HORIZONTAL2 = 0.01**2
"""Of the field's squared norm: within 0.6 degrees of the vertical it points nowhere."""


class Corrections:
    """The linear filters that samples go through, over one state."""

    def __init__(self, params: AdaptiveParams, state: AdaptiveState) -> None:
        self.state = state
        self.interval = GyroInterval(params.interval, state.interval)
        self.tilt = Tilt(params.tilt, state.tilt)
        self.rest = RestBias(params.rest, state.rest)
        self.bias = GyroBias(params.bias, state.bias)
        self.earth = FieldGate(params.earth, state.earth)
        self.iron = HardIron(params.iron, state.iron)
        self.heading = Heading(params.heading, state.heading)
        self._tilt_time_s = params.tilt.time_s
        self._two_damping = 2.0 * params.tilt.damping

    def measure(self, sensor_type: int, t: int, x: float, y: float, z: float, u: float) -> None:
        """Apply a measurement at the share `u` of the newest gyroscope interval."""
        if sensor_type == _ACCELEROMETER:
            self._gravity(t, x, y, z, u)
        else:
            self._north(t, x, y, z, u)

    def _gravity(self, t: int, x: float, y: float, z: float, u: float) -> None:
        s = self.state
        dt = _FIRST_STEP_S
        if s.has_acc:
            if t <= s.acc_ns:
                s.flag_gap()
                return
            dt = min((t - s.acc_ns) * 1e-9, _MAX_STEP_S)
        norm2 = x * x + y * y + z * z
        repeats = s.acc_repeats
        change = norm2 - (repeats.x * repeats.x + repeats.y * repeats.y + repeats.z * repeats.z)
        s.unsteady = s.has_acc and (change > _UNSTEADY or change < -_UNSTEADY)
        repeats.take(x, y, z, not s.has_acc)
        s.has_acc = True
        s.acc_ns = t
        s.free_fall = norm2 < _MIN_ACCELERATION2
        if s.free_fall:
            s.acc_used_ns = t
            self.rest.moved()
            return
        self.rest.take_acceleration(x, y, z, dt)
        rest = s.rest
        if repeats.stuck():
            s.flag_bad_sample()
            return
        s.acc_used_ns = t
        c = s.matrix
        tilt = s.tilt
        if not s.gyro_lost:
            interval = self.interval
            interval.carry(x, y, z, u)
            x = interval.x
            y = interval.y
            z = interval.z
        if not tilt.known:
            self.tilt.start(c, x, y, z, dt)
            self.bias.start_rows(c)
            return
        east_x = c.north_y * c.up_z - c.north_z * c.up_y
        east_y = c.north_z * c.up_x - c.north_x * c.up_z
        east_z = c.north_x * c.up_y - c.north_y * c.up_x
        levelled = self.tilt.level(
            c,
            east_x * x + east_y * y + east_z * z,
            c.north_x * x + c.north_y * y + c.north_z * z,
            c.up_x * x + c.up_y * y + c.up_z * z,
            dt,
            s.gyro_lost,
            s.interval.error_rate,
        )
        if not levelled:
            self.tilt.start(c, x, y, z, dt)
            self.bias.start_rows(c)
            s.heading.known = False
            return
        if s.gyro_lost or not self.bias.due(tilt.turn_x, tilt.turn_y, dt):
            return
        self.bias.follow(c, tilt.frequency, self._two_damping)
        if rest.at_rest:
            self.bias.observe_rest(rest.rate_x, rest.rate_y, rest.rate_z)
        elif tilt.age_s > self._tilt_time_s:
            self.bias.observe_motion()
        else:
            self.bias.skip()

    def _north(self, t: int, x: float, y: float, z: float, u: float) -> None:
        s = self.state
        dt = _FIRST_STEP_S
        if s.has_mag:
            if t <= s.mag_ns:
                s.flag_gap()
                return
            dt = min((t - s.mag_ns) * 1e-9, _MAX_STEP_S)
        repeats = s.mag_repeats
        if repeats.take(x, y, z, not s.has_mag) and s.gyro_lost and s.rest.shaken:
            repeats.moved_s += dt
        s.has_mag = True
        s.mag_ns = t
        if repeats.stuck():
            s.flag_bad_sample()
            return
        s.mag_used_ns = t
        if not s.tilt.known:
            return
        c = s.matrix
        interval = self.interval
        if self.iron.due(dt):
            # Hard iron lies in the device's axes at the time of the reading.
            interval.bring(c.up_x, c.up_y, c.up_z, 0.0 if s.gyro_lost else u)
            self.iron.learn(x, y, z, interval.x, interval.y, interval.z)
        iron = s.iron
        if iron.use > 0.0:
            b = iron.estimate
            x -= iron.use * b.x
            y -= iron.use * b.y
            z -= iron.use * b.z
        if not s.gyro_lost:
            interval.carry(x, y, z, u)
            x = interval.x
            y = interval.y
            z = interval.z
        vertical = c.up_x * x + c.up_y * y + c.up_z * z
        north = c.north_x * x + c.north_y * y + c.north_z * z
        norm2 = x * x + y * y + z * z
        horizontal2 = norm2 - vertical * vertical
        if not horizontal2 > _MIN_HORIZONTAL2 * norm2:
            s.flag_bad_sample()
            return
        horizontal = sqrt(horizontal2)
        east = (
            (c.north_y * c.up_z - c.north_z * c.up_y) * x
            + (c.north_z * c.up_x - c.north_x * c.up_z) * y
            + (c.north_x * c.up_y - c.north_y * c.up_x) * z
        )
        earth = self.earth
        if not s.earth.known:
            earth.start(horizontal, vertical)
        elif s.earth_gap:
            earth.resume(horizontal, vertical)
        s.earth_gap = False
        interval_state = s.interval
        rate2 = (
            interval_state.rate_x * interval_state.rate_x
            + interval_state.rate_y * interval_state.rate_y
            + interval_state.rate_z * interval_state.rate_z
        )
        weight = earth.weight(horizontal, vertical, dt, rate2)
        if not weight > 0.0:
            return
        if not s.heading.known:
            s.started = True
            self.heading.start(east / horizontal, north / horizontal, dt)
        else:
            self.heading.follow(east / horizontal, north / horizontal, dt, weight)
