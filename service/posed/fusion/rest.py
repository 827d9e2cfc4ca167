"""Is the phone lying still, and what does its gyroscope read then: the bias.

A steady turn slower than `bias_limit` cannot be told from a bias without a look at the heading; the limit keeps what
such a turn can do to the estimate small.
"""

from dataclasses import dataclass
from math import radians

from posed.fusion.filter import require_positive


@dataclass(frozen=True, slots=True)
class RestParams:
    """When the phone counts as lying still, and how far its gyroscope bias is believed.

    The thresholds are several times the noise of the noisiest phone parts and below the tremor of a hand.
    """

    learn_bias: bool = True
    """False leaves the bias at zero, for a gyroscope calibrated elsewhere; rest is still detected."""
    rate_deviation: float = radians(2.0)
    """rad/s; a sample further from the running mean is motion. Larger takes a held phone for a lying one."""
    acceleration_deviation: float = 0.5
    """m/s2; the same for the accelerometer."""
    mean_s: float = 0.5
    """s, time constant of the running means."""
    settle_s: float = 1.5
    """s without motion before the phone counts as at rest. Shorter takes the turning point of a swing for rest."""
    bias_limit: float = radians(2.0)
    """rad/s; a mean rate above it is a turn, not a bias."""
    bias_std: float = radians(0.3)
    """rad/s, one sigma of the bias before it is learnt, and the most it grows back to afterwards."""
    bias_walk: float = radians(0.01)
    """rad/s/sqrt(s), how fast a learnt bias is doubted again. Larger follows warming up, and noise."""
    rest_density: float = radians(0.05)
    """rad/s/sqrt(Hz), gyroscope noise at rest, the shake of the table included. Larger learns slower."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class RestState:
    """Running means (rad/s, m/s2), how long nothing moved, and the bias (rad/s, one variance for the three axes)."""

    at_rest: bool = False
    still_s: float = 0.0
    has_rate: bool = False
    rate_x: float = 0.0
    rate_y: float = 0.0
    rate_z: float = 0.0
    has_acceleration: bool = False
    acceleration_x: float = 0.0
    acceleration_y: float = 0.0
    acceleration_z: float = 0.0
    shaken: bool = False
    """The last accelerometer sample was motion."""
    bias_x: float = 0.0
    bias_y: float = 0.0
    bias_z: float = 0.0
    bias_variance: float = 0.0


class RestBias:
    """Detects rest and learns the gyroscope bias then: a scalar Kalman filter an axis, all with one variance."""

    def __init__(self, params: RestParams, state: RestState) -> None:
        self.state = state
        self._learn_bias = params.learn_bias
        self._rate_deviation2 = params.rate_deviation**2
        self._acceleration_deviation2 = params.acceleration_deviation**2
        self._mean_s = params.mean_s
        self._settle_s = params.settle_s
        self._bias_limit2 = params.bias_limit**2
        self._bias_max = params.bias_std**2
        self._bias_walk = params.bias_walk**2
        self._rest_noise = params.rest_density**2

    def take_rate(self, x: float, y: float, z: float, dt: float) -> None:
        """Take a gyroscope sample (rad/s, bias included) that stands for the last `dt` > 0 seconds."""
        s = self.state
        gain = dt / (self._mean_s + dt) if s.has_rate else 1.0
        s.has_rate = True
        dx = x - s.rate_x
        dy = y - s.rate_y
        dz = z - s.rate_z
        s.rate_x = mean_x = s.rate_x + gain * dx
        s.rate_y = mean_y = s.rate_y + gain * dy
        s.rate_z = mean_z = s.rate_z + gain * dz
        variance = s.bias_variance + self._bias_walk * dt
        if variance > self._bias_max:
            variance = self._bias_max
        if (
            dx * dx + dy * dy + dz * dz > self._rate_deviation2
            or mean_x * mean_x + mean_y * mean_y + mean_z * mean_z > self._bias_limit2
        ):
            s.still_s = 0.0
            s.at_rest = False
        else:
            s.still_s += dt
            if s.still_s >= self._settle_s:
                s.at_rest = True
                if self._learn_bias:
                    gain = variance / (variance + self._rest_noise / dt)
                    variance -= gain * variance
                    s.bias_x += gain * (x - s.bias_x)
                    s.bias_y += gain * (y - s.bias_y)
                    s.bias_z += gain * (z - s.bias_z)
        s.bias_variance = variance

    def take_acceleration(self, x: float, y: float, z: float, dt: float) -> None:
        """Take an accelerometer sample (m/s2) that stands for the last `dt` > 0 seconds."""
        s = self.state
        first = not s.has_acceleration
        gain = 1.0 if first else dt / (self._mean_s + dt)
        s.has_acceleration = True
        dx = x - s.acceleration_x
        dy = y - s.acceleration_y
        dz = z - s.acceleration_z
        s.acceleration_x += gain * dx
        s.acceleration_y += gain * dy
        s.acceleration_z += gain * dz
        s.shaken = False
        if dx * dx + dy * dy + dz * dz > self._acceleration_deviation2:
            s.shaken = not first
            self.moved()

    def moved(self) -> None:
        """Start the wait for rest anew."""
        self.state.still_s = 0.0
        self.state.at_rest = False
