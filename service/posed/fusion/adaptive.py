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
from posed.events import FilterStatus, FlatEvent, Orientation, SensorType, filter_status
from posed.fusion.adaptive_corrections import Corrections
from posed.fusion.adaptive_state import AdaptiveParams, AdaptiveState
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.event_arrays import MAX_HELD, EventArrays
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
_MAX_LATE_NS = 100_000_000
"""Before the newest interval the rate is taken to run on as it begins, which holds no longer than this."""
_FREE_NS = 1_000_000_000
"""Without a magnetometer sample for so long the heading is free, and at the start no longer waited for."""
_MAX_TIME_NS = 2**62
"""A time further from zero (146 years) is none; the differences of all others fit 64 bits."""
_UNKNOWN_HEADING = pi / sqrt(3.0)
"""rad, one sigma of a heading of which nothing is known (uniform over the circle)."""

_MAX_MEASUREMENT2 = 10_000.0**2
"""A squared norm beyond which a sample is no measurement; comparisons are written so that NaN fails them."""


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
        return Orientation(s.time_ns, c.quaternion(), rate, accuracy, filter_status(status))

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
        self.state = state
        self._corrections = Corrections(self.params, state)
        self._interval = self._corrections.interval
        self._rest = self._corrections.rest
        self._heading = self._corrections.heading

    def _take(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        norm2 = x * x + y * y + z * z
        if sensor_type == _GYROSCOPE:
            if not self._use_gyroscope:
                return
            largest = max(abs(x), abs(y), abs(z))
            # The largest of three is not NaN for certain, their squared norm is.
            if not (norm2 < _MAX_MEASUREMENT2 and largest <= self._max_rate and -_MAX_TIME_NS < t < _MAX_TIME_NS):
                s.flag_bad_sample()
                return
            if largest >= self._saturated_rate:
                # The turn was at least this one: better than none.
                s.flag_bad_sample()
            self._see(t)
            self._take_rate(t, x, y, z)
            return
        if sensor_type == _MAGNETIC_FIELD:
            if not self._use_magnetometer:
                return
        elif sensor_type != _ACCELEROMETER:
            return
        if not (norm2 < _MAX_MEASUREMENT2 and -_MAX_TIME_NS < t < _MAX_TIME_NS):
            s.flag_bad_sample()
            return
        self._see(t)
        if t - s.newest_ns > _MAX_STEP_NS and not s.ahead:
            # A wrong stamp, or the first sample after a gap: the next one tells.
            s.ahead = True
            return
        self._believe(t)
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

    def _believe(self, t: int) -> None:
        """Take a stamp for right; one far ahead that came just before it was wrong, unless this one is as far."""
        s = self.state
        if s.ahead and t - s.newest_ns <= _MAX_STEP_NS:
            s.flag_bad_sample()
        s.ahead = False
        if t > s.newest_ns:
            s.newest_ns = t

    def _take_rate(self, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        norm2 = x * x + y * y + z * z
        turning = norm2 > self._turning2
        dt = 0.0
        if s.has_gyro and t > s.gyro_ns:
            dt = min((t - s.gyro_ns) * 1e-9, _MAX_STEP_S)
        if s.gyro_repeats.take(x, y, z, not s.has_gyro):
            if s.gyro_repeats.stuck():
                s.flag_bad_sample()
                return
            # Exactly zero is what a simulated phone reads that is moved without being turned.
            if s.unsteady and (turning or (s.rest.shaken and norm2 > 0.0)):
                s.gyro_repeats.moved_s += dt
        if turning:
            c = s.matrix
            about_up = x * c.up_x + y * c.up_y + z * c.up_z
            if norm2 - about_up * about_up > self._turning2:
                # A turn about the vertical leaves the accelerometer as it is.
                s.acc_repeats.moved_s += dt
            s.mag_repeats.moved_s += dt
        self._believe(t)
        step = t - s.time_ns
        if step > _MAX_STEP_NS or step < -_MAX_STEP_NS:
            # Far back counts as a gap too: a source whose clock was set back must not lock the filter out.
            self._restart(t)
        elif s.has_gyro and not s.gyro_lost:
            if step <= 0:
                s.flag_gap()
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
            self._corrections.tilt.resume()
            self._corrections.bias.start_rows(s.matrix)
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
                s.flag_gap()
                continue
            u = 1.0
            if length > 0.0:
                u = (at_ns - s.start_ns) * 1e-9 / length
            self._corrections.measure(held.sensor_type[k], time_ns, held.x[k], held.y[k], held.z[k], u)
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
        self._corrections.measure(sensor_type, t, x, y, z, 0.0)

    def _restart(self, t: int) -> None:
        """Go on at time t after a gap: gravity and north are to be found anew; bias, iron and the earth's field stay.

        What is held was measured before the gap or in it, at an attitude nobody knows.
        """
        s = self.state
        s.flag_gap()
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
