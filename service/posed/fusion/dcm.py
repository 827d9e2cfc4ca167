"""The direction-cosine-matrix Kalman filter of Patonis et al. 2018 (Sensors 18, 2616), low in cost by design.

The matrix C turns device vectors into the world (ENU): its rows are east, north and up in device axes. Gravity corrects
the third row (Eq. 6-9), the magnetic field the first two elements of one column (Eq. 10-15); with A = H = I and
isotropic noise each state is a scalar Kalman filter and no matrix is inverted. The gyroscope carries C in between.

Where the paper is silent or its letter costs accuracy:
- the increment is the exact rotation, not its first order (Eq. 3): at 50 Hz and below the difference is decisive;
- the process noise (Eq. 9) is taken with its full covariance sigma^2 dt^2 (I - r r'): in the tangent plane it is
  isotropic, so the three elements of row 3 share one variance, and so do the two of the column; the diagonal alone
  leaves an axis that stood upright deaf for seconds after a turn (2.9 -> 3.6 deg over BROAD's recordings);
- noise is a density: R and Q follow the time a sample stands for, so the time constants do not depend on the rates;
- after a correction C is built anew from row 3 and the column by Eq. 1, without its angles; Eq. 16-18 would throw
  away the corrected row 3.
"""

from collections.abc import Iterable, Mapping
from math import atan2, pi, sqrt
from typing import Any

from posed.errors import InvalidArgumentError
from posed.events import FilterStatus, FlatEvent, Orientation, SensorType, filter_status
from posed.fusion.dcm_state import DcmParams, DcmState
from posed.fusion.event_arrays import MAX_HELD, EventArrays
from posed.fusion.gate import MagneticGate
from posed.fusion.rest import RestBias
from posed.fusion.saved import filled, plain

__all__ = ["DcmFilter", "DcmParams"]

_ACCELEROMETER = int(SensorType.ACCELEROMETER)
_MAGNETIC_FIELD = int(SensorType.MAGNETIC_FIELD)
_GYROSCOPE = int(SensorType.GYROSCOPE)
_INITIALISING = int(FilterStatus.INITIALISING)
_AT_REST = int(FilterStatus.AT_REST)
_MAGNETIC_DISTURBANCE = int(FilterStatus.MAGNETIC_DISTURBANCE)
_GYRO_LOST = int(FilterStatus.GYRO_LOST)
_FREE_FALL = int(FilterStatus.FREE_FALL)

_MAX_STEP_NS = 500_000_000
"""A longer step of time is a gap, and a measurement is held no longer for its gyroscope sample."""
_MAX_STEP_S = 0.5
_FIRST_STEP_S = 0.02
"""What the first sample of a sensor stands for: GAME's period, for want of a predecessor."""
_MAX_HELD = MAX_HELD
_MAX_TIME_NS = 2**62
"""A time further from zero (146 years) is none; the differences of all others fit 64 bits."""
_UNKNOWN_HEADING = pi / sqrt(3.0)
"""rad, one sigma of a heading of which nothing is known (uniform over the circle)."""

# Squared norms beyond which a sample is no measurement; comparisons are written so that NaN fails them.
_MIN_ACCELERATION2 = 1.0**2
_MAX_MEASUREMENT2 = 10_000.0**2
_MAX_RATE2 = 100.0**2
_MIN_HORIZONTAL2 = 0.01**2
"""Of the field's squared norm: within 0.6 degrees of the vertical it points nowhere."""


class DcmFilter:
    """The filter: `params` it was made with, `state` all that changes. See DcmParams for what to tune."""

    name = "dcm"

    def __init__(self, params: DcmParams | None = None, state: DcmState | None = None) -> None:
        p = params if params is not None else DcmParams()
        self.params = p
        self._gravity = p.gravity
        self._gyro_white = p.noise.gyro_density**2
        self._gyro_moving = p.noise.gyro_density**2 + p.rotation_density**2
        self._gyro_lost = p.lost_rotation_density**2
        self._acc_white = (p.noise.acc_std / p.gravity) ** 2
        self._acc_moving = (p.acceleration_density / p.gravity) ** 2
        self._mag_white = p.noise.mag_std**2
        self._mag_moving = p.field_density**2
        self._use(state if state is not None else DcmState.fresh(p))

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        """Take one event: m/s2, rad/s or uT in device axes; other sensor types are ignored.

        A gyroscope sample stands for the mean rate since the one before it. Accelerometer and magnetometer samples
        wait for the gyroscope sample that covers them and act on C at their own time.
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
        """Return the orientation C stands for, None until gravity and north have been seen."""
        s = self.state
        if not s.started:
            return None
        # Plain integers: an IntFlag's operators cost a hundred times theirs.
        status = s.events
        accuracy = min(sqrt(self._heading_variance()), _UNKNOWN_HEADING)
        if not (s.has_up and s.has_north):
            status |= _INITIALISING
            accuracy = _UNKNOWN_HEADING
        if s.rest.at_rest:
            status |= _AT_REST
        if s.gate.disturbed:
            status |= _MAGNETIC_DISTURBANCE
        if s.gyro_lost:
            status |= _GYRO_LOST
        if s.free_fall:
            status |= _FREE_FALL
        rate = (s.rate_x, s.rate_y, s.rate_z)
        return Orientation(s.time_ns, s.matrix.quaternion(), rate, accuracy, filter_status(status))

    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the bias learnt at rest and its standard deviations, rad/s in device axes."""
        rest = self.state.rest
        std = sqrt(rest.bias_variance)
        return (rest.bias_x, rest.bias_y, rest.bias_z), (std, std, std)

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
        self._use(filled(DcmState, saved.get("state"), "state"))

    def _use(self, state: DcmState) -> None:
        self.state = state
        self._rest = RestBias(self.params.rest, state.rest)
        self._gate = MagneticGate(self.params.gate, state.gate)

    def _take(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        if sensor_type == _GYROSCOPE:
            self._take_rate(t, x, y, z)
        elif sensor_type != _ACCELEROMETER and sensor_type != _MAGNETIC_FIELD:
            return
        elif not (x * x + y * y + z * z < _MAX_MEASUREMENT2 and -_MAX_TIME_NS < t < _MAX_TIME_NS):
            s.flag_bad_sample()
        elif s.gyro_lost:
            self._measure_alone(sensor_type, t, x, y, z)
        elif not s.has_gyro or t > s.gyro_ns:
            s.held.add(sensor_type, t, x, y, z)
            if t - s.held.timestamp_ns[0] > _MAX_STEP_NS or s.held.count == _MAX_HELD:
                self._lose_gyro()
        elif s.gyro_ns - t <= _MAX_STEP_NS:
            self._measure(sensor_type, t, x, y, z)
        else:
            s.flag_gap()

    def _take_rate(self, t: int, x: float, y: float, z: float) -> None:
        s = self.state
        if not (x * x + y * y + z * z < _MAX_RATE2 and -_MAX_TIME_NS < t < _MAX_TIME_NS):
            s.flag_bad_sample()
            return
        came_back = s.gyro_lost
        s.gyro_lost = False
        if not s.has_time:
            s.has_time = True
            s.time_ns = t
        elif t - s.time_ns > _MAX_STEP_NS or s.time_ns - t > _MAX_STEP_NS:
            # Far back counts as a gap too: a source whose clock was set back must not lock the filter out.
            self._restart(t)
        elif t <= s.time_ns:
            # Measurements that went on alone may have passed the first sample of a gyroscope that came back.
            if not came_back:
                s.flag_gap()
            return
        dt = (t - s.time_ns) * 1e-9
        s.has_gyro = True
        s.gyro_ns = t
        rest = s.rest
        s.rate_x = x - rest.bias_x
        s.rate_y = y - rest.bias_y
        s.rate_z = z - rest.bias_z
        held = s.held
        count = held.count
        held.count = 0
        for k in range(count):
            time_ns = held.timestamp_ns[k]
            if time_ns <= t:
                self._propagate_to(time_ns)
                self._measure(held.sensor_type[k], time_ns, held.x[k], held.y[k], held.z[k])
            elif time_ns - t <= _MAX_STEP_NS:
                # Still ahead: it moves up, never past a row not yet looked at.
                held.add(held.sensor_type[k], time_ns, held.x[k], held.y[k], held.z[k])
            else:
                s.flag_gap()
        self._propagate_to(t)
        if dt > 0.0:
            self._rest.take_rate(x, y, z, dt)

    def _lose_gyro(self) -> None:
        s = self.state
        s.gyro_lost = True
        s.rate_x = s.rate_y = s.rate_z = 0.0
        self._rest.moved()
        held = s.held
        count = held.count
        held.count = 0
        for k in range(count):
            self._measure_alone(held.sensor_type[k], held.timestamp_ns[k], held.x[k], held.y[k], held.z[k])

    def _measure_alone(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        """Correct C without a gyroscope: the rotation nobody measured is noise."""
        s = self.state
        if not s.has_time:
            s.has_time = True
            s.time_ns = t
        elif t - s.time_ns > _MAX_STEP_NS or s.time_ns - t > _MAX_STEP_NS:
            self._restart(t)
        elif t > s.time_ns:
            noise = self._gyro_lost * ((t - s.time_ns) * 1e-9)
            s.tilt_variance += noise
            s.heading_variance += noise
            s.time_ns = t
        self._measure(sensor_type, t, x, y, z)

    def _measure(self, sensor_type: int, t: int, x: float, y: float, z: float) -> None:
        if sensor_type == _ACCELEROMETER:
            self._correct_tilt(t, x, y, z)
        else:
            self._correct_heading(t, x, y, z)

    def _propagate_to(self, t: int) -> None:
        """Turn C by the present rate up to time t, and let the variances grow (Eq. 3, 6, 9)."""
        s = self.state
        if t <= s.time_ns:
            return
        dt = (t - s.time_ns) * 1e-9
        s.time_ns = t
        s.heading_variance += self._gyro_moving * dt
        s.tilt_variance += (self._gyro_white if s.rest.at_rest else self._gyro_moving) * dt
        s.matrix.rotate(s.rate_x * dt, s.rate_y * dt, s.rate_z * dt)

    def _correct_tilt(self, t: int, x: float, y: float, z: float) -> None:
        """Correct row 3 by an accelerometer sample (Eq. 7): observe a / g with R = (sigma_a / g)^2.

        Dividing by g, not by the sample's own norm, gives a push along the vertical no say in the tilt.
        """
        s = self.state
        c = s.matrix
        dt = _FIRST_STEP_S
        if s.has_acc:
            if t <= s.acc_ns:
                s.flag_gap()
                return
            dt = min((t - s.acc_ns) * 1e-9, _MAX_STEP_S)
        s.has_acc = True
        s.acc_ns = t
        norm2 = x * x + y * y + z * z
        s.free_fall = norm2 < _MIN_ACCELERATION2
        if s.free_fall:
            self._rest.moved()
            return
        self._rest.take_acceleration(x, y, z, dt)
        # White noise averages out with more samples, linear acceleration only with more time.
        noise = self._acc_white if s.rest.at_rest else self._acc_white + self._acc_moving / dt
        if s.has_up:
            gain = s.tilt_variance / (s.tilt_variance + noise)
            s.tilt_variance -= gain * s.tilt_variance
            share = gain / self._gravity
            x = c.up_x - gain * c.up_x + share * x
            y = c.up_y - gain * c.up_y + share * y
            z = c.up_z - gain * c.up_z + share * z
            norm2 = x * x + y * y + z * z
            if norm2 < 1e-6:
                return
        else:
            s.has_up = True
            s.tilt_variance = noise
        norm = sqrt(norm2)
        c.rebuild(x / norm, y / norm, z / norm, 0.0, 0.0, 0.0, 0.0)

    def _correct_heading(self, t: int, x: float, y: float, z: float) -> None:
        """Correct the heading column by a magnetometer sample (Eq. 11, 13, 15), levelled by the fused row 3.

        R = sigma_m^2 / |horizontal field|^2, by the covariance law.
        """
        s = self.state
        c = s.matrix
        dt = _FIRST_STEP_S
        if s.has_mag:
            if t <= s.mag_ns:
                s.flag_gap()
                return
            dt = min((t - s.mag_ns) * 1e-9, _MAX_STEP_S)
        s.has_mag = True
        s.mag_ns = t
        if not s.has_up:
            return
        norm2 = x * x + y * y + z * z
        ux = c.up_x
        uy = c.up_y
        uz = c.up_z
        vertical = x * ux + y * uy + z * uz
        horizontal2 = norm2 - vertical * vertical
        if not horizontal2 > _MIN_HORIZONTAL2 * norm2:
            s.flag_bad_sample()
            return
        horizontal = sqrt(horizontal2)
        noise = (self._mag_white + self._mag_moving / dt) / horizontal2
        norm = sqrt(norm2)
        dip = atan2(-vertical, horizontal)
        if s.has_north:
            weight = self._gate.weight(norm, dip, dt, s.rest.at_rest)
            if weight == 0.0:
                return
            variance = self._heading_variance()
            gain = variance / (variance + noise / weight)
            s.heading_variance = variance - gain * variance
        else:
            self._gate.start(norm, dip, dt)
            s.has_north = True
            s.started = True
            gain = 1.0
            # A tilt error e turns the levelled field by e tan(dip).
            s.heading_variance = noise + s.tilt_variance * vertical * vertical / horizontal2
        s.heading_ns = s.time_ns
        x = (x - vertical * ux) / horizontal
        y = (y - vertical * uy) / horizontal
        z = (z - vertical * uz) / horizontal
        c.rebuild(ux, uy, uz, gain, x, y, z)

    def _heading_variance(self) -> float:
        """Return the heading's variance now (rad2): what the bias adds grows with the square of time."""
        s = self.state
        dt = (s.time_ns - s.heading_ns) * 1e-9
        return s.heading_variance + s.rest.bias_variance * dt * dt

    def _restart(self, t: int) -> None:
        """Go on at time t after a gap: gravity and north are to be found anew, the bias stays.

        What is held was measured before the gap or in it, at an attitude nobody knows.
        """
        s = self.state
        s.flag_gap()
        s.held.count = 0
        s.time_ns = t
        s.has_up = False
        s.has_north = False
        s.has_acc = False
        s.has_mag = False
        s.has_gyro = False
        self._rest.moved()
