"""Where magnetic north is in the levelled frame: a unit vector of two elements, and one variance for its angle."""

from dataclasses import dataclass
from math import sqrt

from posed.fusion.filter import require_positive


@dataclass(frozen=True, slots=True)
class HeadingParams:
    """How fast north follows the magnetometer: a scalar Kalman filter, whose time constant is what its noise makes it.

    With the bias known it is `time_s`; while the bias is doubted by sigma, 1/T^2 = 1/time_s^2 + (sigma^2 bias_s +
    the variance per second of what slow gyroscope samples lose) / field_noise.
    """

    time_s: float = 20.0
    """s. Shorter follows local fields, longer the gyroscope's scale errors."""
    field_noise: float = 0.025
    """rad2/Hz, how far a believed field points from magnetic north. Larger trusts the gyroscope longer."""
    bias_s: float = 3.0
    """s for which an error of the bias counts as one and the same."""
    lost_density: float = 2.0
    """rad/s/sqrt(Hz), how the phone turns while there is no gyroscope. Larger follows faster."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class HeadingState:
    """North in the levelled frame (unit vector along its y and x) and the variance of its angle (rad2)."""

    known: bool = False
    north_x: float = 0.0
    north_y: float = 1.0
    variance: float = 0.0


class Heading:
    """Tracks north; see HeadingParams."""

    def __init__(self, params: HeadingParams, state: HeadingState) -> None:
        self.state = state
        self._field_noise = params.field_noise
        self._steady = params.field_noise / params.time_s**2
        self._bias_s = params.bias_s
        self._lost2 = params.lost_density**2

    def wander(self, dt: float, bias_variance: float, interval_variance: float) -> None:
        """Let `dt` s pass on the gyroscope.

        bias_variance: rad2/s2, of its bias about the vertical. interval_variance: rad2, lost between its samples.
        """
        self.state.variance += (self._steady + self._bias_s * bias_variance) * dt + interval_variance

    def wander_lost(self, dt: float) -> None:
        """Let `dt` s pass without a gyroscope."""
        self.state.variance += self._lost2 * dt

    def start(self, x: float, y: float, dt: float) -> None:
        """Take one horizontal field (levelled frame, unit vector) as north."""
        s = self.state
        s.known = True
        s.north_x = x
        s.north_y = y
        s.variance = self._field_noise / dt

    def follow(self, x: float, y: float, dt: float, weight: float) -> None:
        """Take a horizontal field (levelled frame, unit vector) that stands for `dt` s, with a weight above 0."""
        s = self.state
        gain = s.variance / (s.variance + self._field_noise / (dt * weight))
        s.variance -= gain * s.variance
        x = s.north_x + gain * (x - s.north_x)
        y = s.north_y + gain * (y - s.north_y)
        norm2 = x * x + y * y
        if norm2 > 1e-6:
            # Straight against the estimate there is no shorter way round: the next sample decides.
            norm = sqrt(norm2)
            s.north_x = x / norm
            s.north_y = y / norm
