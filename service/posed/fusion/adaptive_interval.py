"""How the phone turned between two gyroscope samples, of which each gives only the mean rate since the one before.

The samples on both sides give the rate's slope within the interval, so the rotation to any time in it, and that
rotations about different axes do not commute (coning): theta + T^2/12 w x slope, theta being the sum of the rates. Of
the newest interval only one side is known: the pose looks ahead over it, the filter itself stays one sample behind.
"""

from dataclasses import dataclass
from math import cos, sin, sqrt

from posed.fusion.filter import require_positive

_EVEN = 1.5
"""Neighbouring intervals longer or shorter by this share say nothing about the slope: samples are missing."""
_ERROR_MEAN_S = 2.0
"""s, over which the lost rotation's variance per second is averaged."""


@dataclass(frozen=True, slots=True)
class IntervalParams:
    """How the rotation within an interval is made up."""

    slope: bool = True
    """False takes the rate as the same all over an interval, for comparison."""
    own_time: bool = True
    """False lets measurements act at the end of the interval they fall in, for comparison."""
    loss: float = 0.5
    """One sigma of the rotation lost, as a share of the first term left out. Larger trusts slow gyroscopes less."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class IntervalState:
    """Rates (rad/s, bias included) of the newest interval and the one before, its length, and what such intervals lose.

    length_s is 0 for the first sample, whose interval is not known; has_before says whether the one before is as long.
    """

    length_s: float = 0.0
    rate_x: float = 0.0
    rate_y: float = 0.0
    rate_z: float = 0.0
    has_before: bool = False
    before_x: float = 0.0
    before_y: float = 0.0
    before_z: float = 0.0
    error_rate: float = 0.0
    """rad2/s, variance per second of the rotation lost."""


class GyroInterval:
    """The newest interval: its rotation (closed once the next sample is there) and its part up to any time."""

    def __init__(self, params: IntervalParams, state: IntervalState) -> None:
        self.state = state
        self._slope = params.slope
        self._own_time = params.own_time
        self._loss2 = params.loss**2
        self.error2 = 0.0
        """rad2, variance of the closed interval's rotation."""
        self.x = self.y = self.z = 0.0
        """The last answer: a rotation vector (rad) or a vector that was carried."""
        self._wx = self._wy = self._wz = 0.0
        self._slope_x = self._slope_y = self._slope_z = 0.0
        self._cone_x = self._cone_y = self._cone_z = 0.0

    def begin(self, x: float, y: float, z: float) -> None:
        """Take the first rate (rad/s) after a start or a loss."""
        s = self.state
        s.length_s = 0.0
        s.rate_x = x
        s.rate_y = y
        s.rate_z = z
        s.has_before = False

    def push(self, x: float, y: float, z: float, dt: float) -> None:
        """Take the rate (rad/s) of the next interval, `dt` s long."""
        s = self.state
        s.has_before = self._even(dt)
        s.before_x = s.rate_x
        s.before_y = s.rate_y
        s.before_z = s.rate_z
        s.rate_x = x
        s.rate_y = y
        s.rate_z = z
        s.length_s = dt

    def close(
        self, next_x: float, next_y: float, next_z: float, dt: float, bias_x: float, bias_y: float, bias_z: float
    ) -> None:
        """Settle how the rate ran within the interval, with the next one's rate and length (0 where there is none)."""
        s = self.state
        self._wx = wx = s.rate_x - bias_x
        self._wy = wy = s.rate_y - bias_y
        self._wz = wz = s.rate_z - bias_z
        self._slope_x = self._slope_y = self._slope_z = 0.0
        self._cone_x = self._cone_y = self._cone_z = 0.0
        self.error2 = 0.0
        if not (s.has_before and self._even(dt)):
            return
        share = s.length_s * s.length_s / 12.0
        if self._slope:
            self._slope_x = x = 0.5 * (next_x - s.before_x)
            self._slope_y = y = 0.5 * (next_y - s.before_y)
            self._slope_z = z = 0.5 * (next_z - s.before_z)
            self._cone_x = share * (wy * z - wz * y)
            self._cone_y = share * (wz * x - wx * z)
            self._cone_z = share * (wx * y - wy * x)
        x = next_x - 2.0 * s.rate_x + s.before_x
        y = next_y - 2.0 * s.rate_y + s.before_y
        z = next_z - 2.0 * s.rate_z + s.before_z
        next_x = share * (wy * z - wz * y)
        next_y = share * (wz * x - wx * z)
        next_z = share * (wx * y - wy * x)
        self.error2 = self._loss2 * (next_x * next_x + next_y * next_y + next_z * next_z)
        s.error_rate += (self.error2 - s.error_rate * s.length_s) / (_ERROR_MEAN_S + s.length_s)

    def turn(self, u: float) -> None:
        """Answer with the rotation from the interval's start to the share `u` of it; 1 is its end.

        Before the start (u < 0) the rate is taken to be what it begins with: a slope carried on over a sample that
        came many intervals late would be a turn nobody made.
        """
        if not self._own_time:
            u = 1.0
        inside = u if u > 0.0 else 0.0
        straight = self.state.length_s * u
        bent = 0.5 * straight * (inside - 1.0)
        cone = inside * inside * inside
        self.x = straight * self._wx + bent * self._slope_x + cone * self._cone_x
        self.y = straight * self._wy + bent * self._slope_y + cone * self._cone_y
        self.z = straight * self._wz + bent * self._slope_z + cone * self._cone_z

    def carry(self, x: float, y: float, z: float, u: float) -> None:
        """Answer with a vector read at the share `u` of the interval in the device axes of the interval's start."""
        self.turn(u)
        self._rotate(x, y, z, self.x, self.y, self.z)

    def bring(self, x: float, y: float, z: float, u: float) -> None:
        """Answer with a vector in the device axes of the interval's start as it is read at the share `u` of it."""
        self.turn(u)
        self._rotate(x, y, z, -self.x, -self.y, -self.z)

    def _rotate(self, x: float, y: float, z: float, tx: float, ty: float, tz: float) -> None:
        """Answer with (x, y, z) turned by the rotation vector t (rad): Rodrigues."""
        angle2 = tx * tx + ty * ty + tz * tz
        if angle2 < 1e-3:
            a = 1.0 - angle2 * (1.0 / 6.0 - angle2 * (1.0 / 120.0))
            b = 0.5 - angle2 * (1.0 / 24.0 - angle2 * (1.0 / 720.0))
        else:
            angle = sqrt(angle2)
            a = sin(angle) / angle
            b = (1.0 - cos(angle)) / angle2
        cx = ty * z - tz * y
        cy = tz * x - tx * z
        cz = tx * y - ty * x
        self.x = x + a * cx + b * (ty * cz - tz * cy)
        self.y = y + a * cy + b * (tz * cx - tx * cz)
        self.z = z + a * cz + b * (tx * cy - ty * cx)

    def look_ahead(self, bias_x: float, bias_y: float, bias_z: float, further_s: float) -> tuple[float, float, float]:
        """Return the rotation vector (rad) of the interval with no next sample, and `further_s` beyond its end."""
        s = self.state
        wx = s.rate_x - bias_x
        wy = s.rate_y - bias_y
        wz = s.rate_z - bias_z
        span = s.length_s + further_s
        if not (s.has_before and self._slope):
            return span * wx, span * wy, span * wz
        x = s.rate_x - s.before_x
        y = s.rate_y - s.before_y
        z = s.rate_z - s.before_z
        share = s.length_s * s.length_s / 12.0
        return (
            span * wx + share * (wy * z - wz * y),
            span * wy + share * (wz * x - wx * z),
            span * wz + share * (wx * y - wy * x),
        )

    def _even(self, dt: float) -> bool:
        length = self.state.length_s
        return dt < _EVEN * length and length < _EVEN * dt
