"""The adaptive DCM filter: the paper's low-cost building blocks with what the literature since has learnt.

As in Patonis et al. 2018 the matrix C is carried by the gyroscope and corrected by linear filters of two and three
states, observed one scalar at a time; from VQF (Laidig and Seel 2023) come the levelled frame with a second-order
low-pass of gravity, the gyroscope bias learnt at rest and in motion, and the gate on magnetic disturbance.

C is level at all times and keeps a heading of its own, which only the gyroscope turns; where north is in it is a
vector of two elements beside it. So the magnetometer can harm nothing but the heading, and tilt, bias and hard iron
never see a heading corrected.

Rates are what the filter adapts to. Each gyroscope interval is settled when the next sample shows how the rate ran
within it, measurements act at their own time inside it, and the rotation that slow samples lose shortens the time
constants of tilt and heading. The pose looks ahead over the newest interval and the sensors' delay.
"""

from collections.abc import Iterable, Mapping
from math import pi, sqrt
from typing import Any

from posed.errors import InvalidArgumentError
from posed.events import FilterStatus, FlatEvent, Orientation, SensorType
from posed.fusion.adaptive_bias import GyroBias
from posed.fusion.adaptive_field import FieldGate
from posed.fusion.adaptive_heading import Heading
from posed.fusion.adaptive_interval import GyroInterval
from posed.fusion.adaptive_iron import HardIron
from posed.fusion.adaptive_state import AdaptiveParams, AdaptiveState
from posed.fusion.adaptive_tilt import Tilt
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.event_arrays import MAX_HELD, EventArrays
from posed.fusion.rest import RestBias
from posed.fusion.saved import filled, plain

__all__ = ["AdaptiveFilter", "AdaptiveParams"]

_ACCELEROMETER = int(SensorType.ACCELEROMETER)
_MAGNETIC_FIELD = int(SensorType.MAGNETIC_FIELD)
_GYROSCOPE = int(SensorType.GYROSCOPE)
_INITIALISING = int(FilterStatus.INITIALISING)
_AT_REST = int(FilterStatus.AT_REST)
_MAGNETIC_DISTURBANCE = int(FilterStatus.MAGNETIC_DISTURBANCE)
_GYRO_LOST = int(FilterStatus.GYRO_LOST)
_FREE_FALL = int(FilterStatus.FREE_FALL)
_HEADING_FREE = int(FilterStatus.HEADING_FREE)
_GAP = int(FilterStatus.GAP)
_BAD_SAMPLE = int(FilterStatus.BAD_SAMPLE)
_ACCELEROMETER_LOST = int(FilterStatus.ACCELEROMETER_LOST)

_MAX_HELD = MAX_HELD
_MAX_STEP_NS = 500_000_000
"""A longer step of time is a gap, and a sensor without a sample for so long is lost."""
_MAX_STEP_S = 0.5
_STUCK_S = 0.5
_STUCK_SAMPLES = 8
"""Values that stay the same to the last bit for so long in motion, and so often, are those of a sensor that hangs. In
motion only: noise below the last bit repeats itself on a table, and at NORMAL half a second is two samples."""
_UNSTEADY = 0.1
"""Of the acceleration's squared norm, (m/s2)2: noise of 0.005 m/s2. A stream without any, as one writes it by hand, may
well hold the same rate for seconds."""
_MAX_LATE_NS = 100_000_000
"""Before the newest interval the rate is taken to run on as it begins, which holds no longer than this."""
_FREE_NS = 1_000_000_000
"""Without a magnetometer sample for so long the heading is free, and at the start no longer waited for."""
_MAX_TIME_NS = 2**62
"""A time further from zero (146 years) is none; the differences of all others fit 64 bits."""
_FIRST_STEP_S = 0.02
"""What the first sample of a sensor stands for: GAME's period, for want of a predecessor."""
_UNKNOWN_HEADING = pi / sqrt(3.0)
"""rad, one sigma of a heading of which nothing is known (uniform over the circle)."""

# Squared norms beyond which a sample is no measurement; comparisons are written so that NaN fails them.
_MIN_ACCELERATION2 = 1.0**2
_MAX_MEASUREMENT2 = 10_000.0**2
_MIN_HORIZONTAL2 = 0.01**2
"""Of the field's squared norm: within 0.6 degrees of the vertical it points nowhere."""


class AdaptiveFilter:
    """The filter: `params` it was made with, `state` all that changes. See AdaptiveParams for what to tune."""

    def __init__(
        self, params: AdaptiveParams | None = None, state: AdaptiveState | None = None, name: str = "dcm-adaptive"
    ) -> None:
        p = params if params is not None else AdaptiveParams()
        self.name = name
        self.params = p
        self._use_gyroscope = p.use_gyroscope
        self._use_magnetometer = p.use_magnetometer
        self._gyro_delay_s = p.gyro_delay_s
        # A part's range and the largest value it gives differ in the last digits.
        self._saturated_rate = 0.99 * p.gyro_range
        self._max_rate = 1.01 * p.gyro_range
        self._turning2 = p.rest.bias_limit**2
        # The matrix lags its stamp as the gyroscope does: relative to it, measurements are this much late.
        self._acc_late_ns = round((p.acc_delay_s - p.gyro_delay_s) * 1e9)
        self._mag_late_ns = round((p.mag_delay_s - p.gyro_delay_s) * 1e9)
        self._tilt_time_s = p.tilt.time_s
        self._two_damping = 2.0 * p.tilt.damping
        self._use(state if state is not None else AdaptiveState.fresh(p))

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        """Take one event: m/s2, rad/s or uT in device axes; other sensor types are ignored.

        A gyroscope sample stands for the mean rate since the one before it. Accelerometer and magnetometer samples
        wait until the rate in their interval is settled: for the gyroscope sample after the one that covers them.
        """
        self._take(int(sensor_type), int(timestamp_ns), float(x), float(y), float(z))

    def update_batch(self, events: Iterable[FlatEvent]) -> None:
        """Take events in the order given, each as by `update`; EventArrays are taken fastest."""
        if isinstance(events, EventArrays):
            rows = events
            for k in range(rows.count):
                self._take(rows.sensor_type[k], rows.timestamp_ns[k], rows.x[k], rows.y[k], rows.z[k])
            return
        for sensor_type, timestamp_ns, x, y, z in events:
            self._take(sensor_type, timestamp_ns, x, y, z)

    def orientation(self) -> Orientation | None:
        """Return the orientation at the newest gyroscope sample, None until gravity and north have been seen.

        Where no magnetometer comes within a second of the first event, gravity will do: HEADING_FREE.
        """
        s = self.state
        free = not self._use_magnetometer or (s.time_ns - (s.mag_used_ns if s.has_mag else s.first_ns) > _FREE_NS)
        if not (s.started or (free and s.tilt.known)):
            return None
        heading = s.heading
        status = s.events
        accuracy = min(sqrt(heading.variance), _UNKNOWN_HEADING)
        if free:
            status |= _HEADING_FREE
        if not heading.known:
            accuracy = _UNKNOWN_HEADING
        if not (s.tilt.known and (heading.known or free)):
            status |= _INITIALISING
        if s.rest.at_rest:
            status |= _AT_REST
        if s.earth.disturbed:
            status |= _MAGNETIC_DISTURBANCE
        if s.gyro_lost:
            status |= _GYRO_LOST
        if s.free_fall:
            status |= _FREE_FALL
        # With a gyroscope, measurements are taken up to the start of its newest interval.
        taken_ns = s.time_ns if s.gyro_lost else s.start_ns
        if taken_ns - (s.acc_used_ns if s.has_acc else s.first_ns) > _MAX_STEP_NS:
            status |= _ACCELEROMETER_LOST
        level = s.matrix
        c = DirectionCosines(level.north_x, level.north_y, level.north_z, level.up_x, level.up_y, level.up_z)
        bias = s.bias.estimate
        rate = (0.0, 0.0, 0.0)
        if not s.gyro_lost:
            interval = s.interval
            rate = (interval.rate_x - bias.x, interval.rate_y - bias.y, interval.rate_z - bias.z)
            x, y, z = self._interval.look_ahead(bias.x, bias.y, bias.z, self._gyro_delay_s)
            c.rotate(x, y, z)
        east_x = c.north_y * c.up_z - c.north_z * c.up_y
        east_y = c.north_z * c.up_x - c.north_x * c.up_z
        east_z = c.north_x * c.up_y - c.north_y * c.up_x
        c.north_x = heading.north_x * east_x + heading.north_y * c.north_x
        c.north_y = heading.north_x * east_y + heading.north_y * c.north_y
        c.north_z = heading.north_x * east_z + heading.north_y * c.north_z
        return Orientation(s.time_ns, c.quaternion(), rate, accuracy, FilterStatus(status))

    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the gyroscope's bias and its standard deviations, rad/s in device axes."""
        b = self.state.bias.estimate
        return (b.x, b.y, b.z), (sqrt(max(b.xx, 0.0)), sqrt(max(b.yy, 0.0)), sqrt(max(b.zz, 0.0)))

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
        self._use(filled(AdaptiveState, saved.get("state"), "state"))

    def _use(self, state: AdaptiveState) -> None:
        p = self.params
        self.state = state
        self._interval = GyroInterval(p.interval, state.interval)
        self._tilt = Tilt(p.tilt, state.tilt)
        self._rest = RestBias(p.rest, state.rest)
        self._bias = GyroBias(p.bias, state.bias)
        self._earth = FieldGate(p.earth, state.earth)
        self._iron = HardIron(p.iron, state.iron)
        self._heading = Heading(p.heading, state.heading)

    def _take(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        norm2 = x * x + y * y + z * z
        if sensor_type == _GYROSCOPE:
            if not self._use_gyroscope:
                return
            largest = max(abs(x), abs(y), abs(z))
            # The largest of three is not NaN for certain, their squared norm is.
            if not (norm2 < _MAX_MEASUREMENT2 and largest <= self._max_rate and -_MAX_TIME_NS < t < _MAX_TIME_NS):
                self._flag_bad_sample()
                return
            if largest >= self._saturated_rate:
                # The turn was at least this one: better than none.
                self._flag_bad_sample()
            self._see(t)
            self._take_rate(t, x, y, z)
            return
        if sensor_type == _MAGNETIC_FIELD:
            if not self._use_magnetometer:
                return
        elif sensor_type != _ACCELEROMETER:
            return
        if not (norm2 < _MAX_MEASUREMENT2 and -_MAX_TIME_NS < t < _MAX_TIME_NS):
            self._flag_bad_sample()
            return
        self._see(t)
        if t - s.newest_ns > _MAX_STEP_NS and not s.ahead:
            # A wrong stamp, or the first sample after a gap: the next one tells.
            s.ahead = True
            self._flag_bad_sample()
            return
        s.ahead = False
        if t > s.newest_ns:
            s.newest_ns = t
        if s.gyro_lost:
            self._measure_alone(sensor_type, t, x, y, z)
        else:
            held = s.held
            held.add(sensor_type, t, x, y, z)
            newest = s.gyro_ns if s.has_gyro else held.timestamp_ns[0]
            if t - newest > _MAX_STEP_NS or held.count == _MAX_HELD:
                self._lose_gyro()

    def _see(self, t: int) -> None:
        s = self.state
        if not s.has_time:
            s.has_time = True
            s.time_ns = s.start_ns = s.first_ns = s.newest_ns = t
            s.gyro_lost = not self._use_gyroscope

    def _take_rate(self, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        norm2 = x * x + y * y + z * z
        turning = norm2 > self._turning2
        dt = 0.0
        if s.has_gyro and t > s.gyro_ns:
            dt = min((t - s.gyro_ns) * 1e-9, _MAX_STEP_S)
        if x != s.gyro_x or y != s.gyro_y or z != s.gyro_z or not s.has_gyro:
            s.gyro_same = 0
            s.gyro_same_s = 0.0
            s.gyro_x = x
            s.gyro_y = y
            s.gyro_z = z
        else:
            s.gyro_same += 1
            if s.gyro_same_s > _STUCK_S and s.gyro_same >= _STUCK_SAMPLES:
                self._flag_bad_sample()
                return
            # Exactly zero is what a simulated phone reads that is moved without being turned.
            if s.unsteady and (turning or (s.rest.shaken and norm2 > 0.0)):
                s.gyro_same_s += dt
        if turning:
            c = s.matrix
            about_up = x * c.up_x + y * c.up_y + z * c.up_z
            if norm2 - about_up * about_up > self._turning2:
                # A turn about the vertical leaves the accelerometer as it is.
                s.acc_same_s += dt
            s.mag_same_s += dt
        s.ahead = False
        if t > s.newest_ns:
            s.newest_ns = t
        step = t - s.time_ns
        if step > _MAX_STEP_NS or step < -_MAX_STEP_NS:
            # Far back counts as a gap too: a source whose clock was set back must not lock the filter out.
            self._restart(t)
        elif s.has_gyro and not s.gyro_lost:
            if step <= 0:
                self._flag_gap()
                return
            dt = step * 1e-9
            self._close(x, y, z, dt)
            self._interval.push(x, y, z, dt)
            s.start_ns = s.gyro_ns
            s.gyro_ns = s.time_ns = t
            self._rest.take_rate(x, y, z, dt)
            return
        elif s.gyro_lost:
            # Measurements that went on alone may have passed the first sample of a gyroscope that came back.
            s.gyro_lost = False
            self._tilt.resume()
            self._bias.start_rows(s.matrix)
        s.has_gyro = True
        self._interval.begin(x, y, z)
        s.start_ns = s.gyro_ns = s.time_ns = t

    def _close(self, next_x: float, next_y: float, next_z: float, dt: float) -> None:
        """Settle the newest interval: apply what was measured up to its end, then turn C through it."""
        s = self.state
        interval = self._interval
        bias = s.bias.estimate
        interval.close(next_x, next_y, next_z, dt, bias.x, bias.y, bias.z)
        length = s.interval.length_s
        held = s.held
        count = held.count
        held.count = 0
        for k in range(count):
            time_ns = held.timestamp_ns[k]
            at_ns = time_ns - (self._acc_late_ns if held.sensor_type[k] == _ACCELEROMETER else self._mag_late_ns)
            if at_ns > s.gyro_ns:
                # Still ahead: it moves up, never past a row not yet looked at.
                held.add(held.sensor_type[k], time_ns, held.x[k], held.y[k], held.z[k])
                continue
            if s.start_ns - at_ns > _MAX_LATE_NS:
                self._flag_gap()
                continue
            u = 1.0
            if length > 0.0:
                u = (at_ns - s.start_ns) * 1e-9 / length
            self._measure(held.sensor_type[k], time_ns, held.x[k], held.y[k], held.z[k], u)
        if length > 0.0:
            c = s.matrix
            interval.turn(1.0)
            c.rotate(interval.x, interval.y, interval.z)
            if s.heading.known:
                doubt = s.bias.estimate.variance_along(c.up_x, c.up_y, c.up_z)
                self._heading.wander(length, doubt, interval.error2)

    def _lose_gyro(self) -> None:
        s = self.state
        if s.has_gyro:
            self._close(0.0, 0.0, 0.0, 0.0)
        s.gyro_lost = True
        self._interval.begin(0.0, 0.0, 0.0)
        self._rest.moved()
        held = s.held
        count = held.count
        held.count = 0
        for k in range(count):
            self._measure_alone(held.sensor_type[k], held.timestamp_ns[k], held.x[k], held.y[k], held.z[k])

    def _measure_alone(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        """Measure without a gyroscope: how the phone turned meanwhile is anyone's guess."""
        s = self.state
        step = t - s.time_ns
        if step > _MAX_STEP_NS or step < -_MAX_STEP_NS:
            self._restart(t)
            s.gyro_lost = True
        elif step > 0:
            self._heading.wander_lost(step * 1e-9)
            s.time_ns = t
        self._measure(sensor_type, t, x, y, z, 0.0)

    def _measure(self, sensor_type: int, t: int, x: float, y: float, z: float, u: float) -> None:
        """Apply a measurement at the share `u` of the newest gyroscope interval."""
        if sensor_type == _ACCELEROMETER:
            self._measure_gravity(t, x, y, z, u)
        else:
            self._measure_north(t, x, y, z, u)

    def _measure_gravity(self, t: int, x: float, y: float, z: float, u: float) -> None:
        s = self.state
        dt = _FIRST_STEP_S
        if s.has_acc:
            if t <= s.acc_ns:
                self._flag_gap()
                return
            dt = min((t - s.acc_ns) * 1e-9, _MAX_STEP_S)
        norm2 = x * x + y * y + z * z
        change = norm2 - (s.acc_x * s.acc_x + s.acc_y * s.acc_y + s.acc_z * s.acc_z)
        s.unsteady = s.has_acc and (change > _UNSTEADY or change < -_UNSTEADY)
        if x != s.acc_x or y != s.acc_y or z != s.acc_z or not s.has_acc:
            s.acc_same = 0
            s.acc_same_s = 0.0
            s.acc_x = x
            s.acc_y = y
            s.acc_z = z
        else:
            s.acc_same += 1
        s.has_acc = True
        s.acc_ns = t
        s.free_fall = norm2 < _MIN_ACCELERATION2
        if s.free_fall:
            s.acc_used_ns = t
            self._rest.moved()
            return
        self._rest.take_acceleration(x, y, z, dt)
        rest = s.rest
        if s.acc_same_s > _STUCK_S and s.acc_same >= _STUCK_SAMPLES:
            self._flag_bad_sample()
            return
        s.acc_used_ns = t
        c = s.matrix
        tilt = s.tilt
        if not s.gyro_lost:
            interval = self._interval
            interval.carry(x, y, z, u)
            x = interval.x
            y = interval.y
            z = interval.z
        if not tilt.known:
            self._tilt.start(c, x, y, z, dt)
            self._bias.start_rows(c)
            return
        east_x = c.north_y * c.up_z - c.north_z * c.up_y
        east_y = c.north_z * c.up_x - c.north_x * c.up_z
        east_z = c.north_x * c.up_y - c.north_y * c.up_x
        levelled = self._tilt.level(
            c,
            east_x * x + east_y * y + east_z * z,
            c.north_x * x + c.north_y * y + c.north_z * z,
            c.up_x * x + c.up_y * y + c.up_z * z,
            dt,
            s.gyro_lost,
            s.interval.error_rate,
        )
        if not levelled:
            self._tilt.start(c, x, y, z, dt)
            self._bias.start_rows(c)
            s.heading.known = False
            return
        if s.gyro_lost or not self._bias.due(tilt.turn_x, tilt.turn_y, dt):
            return
        self._bias.follow(c, tilt.frequency, self._two_damping)
        if rest.at_rest:
            self._bias.observe_rest(rest.rate_x, rest.rate_y, rest.rate_z)
        elif tilt.age_s > self._tilt_time_s:
            self._bias.observe_motion()
        else:
            self._bias.skip()

    def _measure_north(self, t: int, x: float, y: float, z: float, u: float) -> None:
        s = self.state
        dt = _FIRST_STEP_S
        if s.has_mag:
            if t <= s.mag_ns:
                self._flag_gap()
                return
            dt = min((t - s.mag_ns) * 1e-9, _MAX_STEP_S)
        if x != s.mag_x or y != s.mag_y or z != s.mag_z or not s.has_mag:
            s.mag_same = 0
            s.mag_same_s = 0.0
            s.mag_x = x
            s.mag_y = y
            s.mag_z = z
        else:
            s.mag_same += 1
            if s.gyro_lost and s.rest.shaken:
                s.mag_same_s += dt
        s.has_mag = True
        s.mag_ns = t
        if s.mag_same_s > _STUCK_S and s.mag_same >= _STUCK_SAMPLES:
            self._flag_bad_sample()
            return
        s.mag_used_ns = t
        if not s.tilt.known:
            return
        c = s.matrix
        interval = self._interval
        if self._iron.due(dt):
            # Hard iron lies in the device's axes at the time of the reading.
            interval.bring(c.up_x, c.up_y, c.up_z, 0.0 if s.gyro_lost else u)
            self._iron.learn(x, y, z, interval.x, interval.y, interval.z)
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
            self._flag_bad_sample()
            return
        horizontal = sqrt(horizontal2)
        east = (
            (c.north_y * c.up_z - c.north_z * c.up_y) * x
            + (c.north_z * c.up_x - c.north_x * c.up_z) * y
            + (c.north_x * c.up_y - c.north_y * c.up_x) * z
        )
        earth = self._earth
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
            self._heading.start(east / horizontal, north / horizontal, dt)
        else:
            self._heading.follow(east / horizontal, north / horizontal, dt, weight)

    def _restart(self, t: int) -> None:
        """Go on at time t after a gap: gravity and north are to be found anew; bias, iron and the earth's field stay.

        What is held was measured before the gap or in it, at an attitude nobody knows.
        """
        s = self.state
        self._flag_gap()
        s.held.count = 0
        s.time_ns = s.start_ns = s.first_ns = s.newest_ns = t
        s.ahead = False
        s.earth_gap = True
        s.tilt.known = False
        s.heading.known = False
        s.has_acc = False
        s.has_mag = False
        s.has_gyro = False
        s.gyro_lost = not self._use_gyroscope
        self._rest.moved()

    def _flag_gap(self) -> None:
        self.state.gaps += 1
        self.state.events |= _GAP

    def _flag_bad_sample(self) -> None:
        self.state.bad_samples += 1
        self.state.events |= _BAD_SAMPLE
