"""Which way is up: a second-order low-pass of the acceleration in the levelled frame (VQF: Laidig and Seel 2023).

In a frame that does not turn, gravity stands still and linear acceleration, the derivative of a speed that stays
small, averages to zero: the smoother the average, the faster. A first-order low-pass of the same length lets 1.5 times
as much of it through.
"""

from dataclasses import dataclass
from math import sqrt

from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.filter import require_positive


@dataclass(frozen=True, slots=True)
class TiltParams:
    """How fast the tilt follows the accelerometer."""

    time_s: float = 3.5
    """s, time constant. Shorter follows linear acceleration, longer the gyroscope's errors."""
    damping: float = sqrt(0.5)
    """Of the low-pass; sqrt(1/2) is Butterworth's. Far above 1 it is a low-pass of the first order."""
    interval_noise: float = 0.0075
    """rad2/Hz, what the accelerometer's direction is worth against the rotation lost between slow gyroscope samples.

    The time constant T follows 1/T^2 = 1/time_s^2 + (that rotation's variance per second) / interval_noise.
    Smaller follows the accelerometer faster below 15 Hz, and nothing changes above.
    """
    lost_s: float = 0.1
    """s, time constant while there is no gyroscope. Longer smooths and lags."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class TiltState:
    """The low-passed acceleration (m/s2, levelled frame: along the vertical only) and its derivative, and its age."""

    known: bool = False
    age_s: float = 0.0
    length: float = 0.0
    slope_x: float = 0.0
    slope_y: float = 0.0
    slope_z: float = 0.0
    frequency: float = 0.0
    """rad/s, the low-pass's corner at the last sample."""
    turn_x: float = 0.0
    turn_y: float = 0.0
    """rad/s about the horizontal axes, the last correction over its time step."""


class Tilt:
    """Levels a matrix: after each sample its third row is the low-passed direction of the acceleration."""

    def __init__(self, params: TiltParams, state: TiltState) -> None:
        self.state = state
        self._time_s = params.time_s
        self._two_damping = 2.0 * params.damping
        self._interval_noise = params.interval_noise
        self._lost_s = params.lost_s

    def start(self, c: DirectionCosines, x: float, y: float, z: float, dt: float) -> None:
        """Take the direction of one acceleration (m/s2, device axes, not zero) as up, and any heading."""
        s = self.state
        norm = sqrt(x * x + y * y + z * z)
        c.face(x / norm, y / norm, z / norm)
        s.known = True
        s.age_s = dt
        s.length = norm
        s.slope_x = s.slope_y = s.slope_z = 0.0
        s.turn_x = s.turn_y = 0.0
        s.frequency = 0.0

    def resume(self) -> None:
        """Go on with a gyroscope that came back: what the fast average followed was the phone, not its errors."""
        s = self.state
        s.slope_x = s.slope_y = s.slope_z = 0.0
        s.age_s = min(s.age_s, self._lost_s)

    def level(
        self, c: DirectionCosines, x: float, y: float, z: float, dt: float, lost: bool, interval_error: float
    ) -> bool:
        """Take an acceleration (m/s2, in the levelled frame) that stands for `dt` s and level `c`.

        interval_error: rad2/s, variance per second of the rotation that slow gyroscope samples lose. Returns False,
        and levels nothing, when the average has no direction (free fall, or upside down at once).
        """
        s = self.state
        s.age_s += dt
        if lost:
            time_s = self._lost_s
        else:
            time_s = 1.0 / sqrt(1.0 / (self._time_s * self._time_s) + interval_error / self._interval_noise)
        if s.age_s < time_s:
            time_s = s.age_s
        w = self._two_damping / time_s
        s.frequency = w
        # y'' = w^2 (a - y) - 2 damping w y', with the new values on the right-hand side: stable at any step.
        wdt = w * dt
        share = 1.0 / (1.0 + wdt * (self._two_damping + wdt))
        pull = wdt * w
        s.slope_x = (s.slope_x + pull * x) * share
        s.slope_y = (s.slope_y + pull * y) * share
        s.slope_z = (s.slope_z + pull * (z - s.length)) * share
        x = dt * s.slope_x
        y = dt * s.slope_y
        z = s.length + dt * s.slope_z
        norm = sqrt(x * x + y * y + z * z)
        # Written so that NaN fails; from upside down no rotation is the smallest.
        if not z > 1e-3 * norm:
            return False
        inverse = 1.0 / norm
        x *= inverse
        y *= inverse
        z *= inverse
        c.tilt(x, y, z)
        s.length = norm
        # The slope's coordinates change with the frame: the smallest rotation that takes (x, y, z) to the vertical.
        along = x * s.slope_x + y * s.slope_y + z * s.slope_z
        fold = (along + s.slope_z) / (1.0 + z)
        s.slope_x -= fold * x
        s.slope_y -= fold * y
        s.slope_z = along
        s.turn_x = y / dt
        s.turn_y = -x / dt
        return True
