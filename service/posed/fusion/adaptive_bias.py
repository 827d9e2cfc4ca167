"""The gyroscope's bias: a linear Kalman filter of three states, fed at rest and in motion (VQF: Laidig and Seel 2023).

At rest the gyroscope shows its bias. In motion, what levels the frame shows it: a bias b turns the levelled frame by
C b, and the accelerometer turns it back, low-passed: -turn = LP(C) (b - estimate), two scalars at a time, about the
horizontal axes only. Gravity says nothing about the vertical one, which motion carries round all axes of the device.
"""

from dataclasses import dataclass, field
from math import radians

from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.filter import require_positive
from posed.fusion.three_state import ThreeState


@dataclass(frozen=True, slots=True)
class BiasParams:
    """How far the bias is believed, and what shows it."""

    std: float = radians(0.5)
    """rad/s, one sigma before anything is known, and the most it grows back to."""
    walk: float = radians(0.01)
    """rad/s/sqrt(s), how fast it is doubted again. Larger follows warming up, and noise."""
    limit: float = radians(2.0)
    """rad/s; no bias is larger, and no single observation says so."""
    rest_std: float = radians(0.03)
    """rad/s, one sigma that rest ends at. Larger learns slower."""
    motion_std: float = radians(0.1)
    """rad/s, one sigma that motion alone ends at. Larger learns slower, and believes linear acceleration less."""
    step_s: float = 0.02
    """s between two steps of the filter; a bias does not change faster, and each costs."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class BiasState:
    """The bias (rad/s, device axes) with its covariance, the low-passed rows of C and their slopes, and what waits."""

    estimate: ThreeState = field(default_factory=ThreeState)
    east_x: float = 0.0
    east_y: float = 0.0
    east_z: float = 0.0
    north_x: float = 0.0
    north_y: float = 0.0
    north_z: float = 0.0
    east_slope_x: float = 0.0
    east_slope_y: float = 0.0
    east_slope_z: float = 0.0
    north_slope_x: float = 0.0
    north_slope_y: float = 0.0
    north_slope_z: float = 0.0
    waited_s: float = 0.0
    turned_x: float = 0.0
    turned_y: float = 0.0
    """rad, what the levelling turned the frame by since the last step."""


class GyroBias:
    """Estimates the bias; see the module's words."""

    def __init__(self, params: BiasParams, state: BiasState) -> None:
        self.state = state
        self._variance = params.std**2
        self._walk2 = params.walk**2
        self._limit = params.limit
        self._rest2 = params.rest_std**2
        self._motion2 = params.motion_std**2
        self._step_s = params.step_s

    def start_rows(self, c: DirectionCosines) -> None:
        """Begin the low-pass of the rows at this matrix."""
        s = self.state
        s.east_x = c.north_y * c.up_z - c.north_z * c.up_y
        s.east_y = c.north_z * c.up_x - c.north_x * c.up_z
        s.east_z = c.north_x * c.up_y - c.north_y * c.up_x
        s.north_x = c.north_x
        s.north_y = c.north_y
        s.north_z = c.north_z
        s.east_slope_x = s.east_slope_y = s.east_slope_z = 0.0
        s.north_slope_x = s.north_slope_y = s.north_slope_z = 0.0
        s.waited_s = s.turned_x = s.turned_y = 0.0

    def due(self, turn_x: float, turn_y: float, dt: float) -> bool:
        """Note what the levelling turned by (rad/s over `dt` s) and return whether a step is due."""
        s = self.state
        s.turned_x += turn_x * dt
        s.turned_y += turn_y * dt
        s.waited_s += dt
        return s.waited_s >= self._step_s

    def follow(self, c: DirectionCosines, w: float, two_damping: float) -> None:
        """Take the rows of C through the low-pass (corner `w` in rad/s) that the acceleration went through.

        Ends the step's wait; the observation, if there is to be one, comes after.
        """
        s = self.state
        dt = s.waited_s
        wdt = w * dt
        share = 1.0 / (1.0 + wdt * (two_damping + wdt))
        pull = wdt * w
        s.east_slope_x = share * (s.east_slope_x + pull * (c.north_y * c.up_z - c.north_z * c.up_y - s.east_x))
        s.east_slope_y = share * (s.east_slope_y + pull * (c.north_z * c.up_x - c.north_x * c.up_z - s.east_y))
        s.east_slope_z = share * (s.east_slope_z + pull * (c.north_x * c.up_y - c.north_y * c.up_x - s.east_z))
        s.north_slope_x = share * (s.north_slope_x + pull * (c.north_x - s.north_x))
        s.north_slope_y = share * (s.north_slope_y + pull * (c.north_y - s.north_y))
        s.north_slope_z = share * (s.north_slope_z + pull * (c.north_z - s.north_z))
        s.east_x += dt * s.east_slope_x
        s.east_y += dt * s.east_slope_y
        s.east_z += dt * s.east_slope_z
        s.north_x += dt * s.north_slope_x
        s.north_y += dt * s.north_slope_y
        s.north_z += dt * s.north_slope_z
        s.estimate.doubt(self._walk2 * dt, self._variance)

    def observe_rest(self, x: float, y: float, z: float) -> None:
        """Take the mean rate (rad/s) of a phone that lies still."""
        s = self.state
        b = s.estimate
        noise = self._noise(self._rest2, s.waited_s)
        b.observe(1.0, 0.0, 0.0, self._clipped(x - b.x), noise)
        b.observe(0.0, 1.0, 0.0, self._clipped(y - b.y), noise)
        b.observe(0.0, 0.0, 1.0, self._clipped(z - b.z), noise)
        self._end_step()

    def observe_motion(self) -> None:
        """Take what the levelling turned by since the last step."""
        s = self.state
        b = s.estimate
        noise = self._noise(self._motion2, s.waited_s)
        b.observe(s.east_x, s.east_y, s.east_z, self._clipped(-s.turned_x / s.waited_s), noise)
        b.observe(s.north_x, s.north_y, s.north_z, self._clipped(-s.turned_y / s.waited_s), noise)
        self._end_step()

    def skip(self) -> None:
        """End the step without an observation."""
        self._end_step()

    def _end_step(self) -> None:
        s = self.state
        b = s.estimate
        s.waited_s = s.turned_x = s.turned_y = 0.0
        b.x = self._clipped(b.x)
        b.y = self._clipped(b.y)
        b.z = self._clipped(b.z)

    def _noise(self, variance: float, dt: float) -> float:
        """Return the noise with which steps of `dt` s end at `variance`: the steady state of Riccati's equation."""
        return variance * variance / (self._walk2 * dt) + variance

    def _clipped(self, value: float) -> float:
        if value > self._limit:
            return self._limit
        if value < -self._limit:
            return -self._limit
        return value
