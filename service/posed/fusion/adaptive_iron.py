"""A magnet that moves with the phone: hard iron, learnt in motion from the field's vertical part.

The earth's vertical field V is the same at any attitude, and the tilt is known: the vertical part of a reading is
z = V + up . b. Less its own low-pass, z - LP(z) = (up - LP(up)) . b, without V and with no say of the heading. Three
states, one scalar observation a step.
"""

from dataclasses import dataclass, field
from math import sqrt

from posed.fusion.filter import require_positive
from posed.fusion.three_state import ThreeState


@dataclass(frozen=True, slots=True)
class IronParams:
    """How hard iron is learnt, and when it is used."""

    std: float = 100.0
    """uT, one sigma before anything is known: a loudspeaker's magnet a centimetre away."""
    walk: float = 0.1
    """uT/sqrt(s), how fast it is doubted again. Larger follows magnets that come and go, and noise."""
    mean_s: float = 1.5
    """s, time constant of the low-pass. Longer takes places with other fields for hard iron."""
    noise: float = 4.0
    """uT, one sigma of the vertical part about its low-pass; larger residuals count as outliers (Cauchy)."""
    trial_s: float = 20.0
    """s over which the estimate is tried out; a quarter of it must pass before it is used at all."""
    worse: float = 0.8
    """Used not at all while it leaves more than this share of the variance of the field's norm and vertical part."""
    better: float = 0.4
    """Used in full when it leaves less than this share."""
    step_s: float = 0.02
    """s between two steps of the filter: each costs, and attitudes that close say nothing new."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class IronState:
    """The estimate (uT, device axes), the low-passes, and the spread of norm and vertical part without and with it."""

    estimate: ThreeState = field(default_factory=ThreeState)
    known: bool = False
    waited_s: float = 0.0
    age_s: float = 0.0
    vertical: float = 0.0
    up_x: float = 0.0
    up_y: float = 0.0
    up_z: float = 0.0
    raw_norm: float = 0.0
    raw_vertical: float = 0.0
    raw_variance: float = 0.0
    corrected_norm: float = 0.0
    corrected_vertical: float = 0.0
    corrected_variance: float = 0.0
    use: float = 0.0
    """Share of the estimate that is used, 0 to 1."""


class HardIron:
    """Estimates hard iron and whether to believe it; see the module's words."""

    def __init__(self, params: IronParams, state: IronState) -> None:
        self.state = state
        self._variance = params.std**2
        self._walk2 = params.walk**2
        self._mean_s = params.mean_s
        self._noise2 = params.noise**2
        self._trial_s = params.trial_s
        self._worse = params.worse
        self._better = params.better
        self._step_s = params.step_s

    def due(self, dt: float) -> bool:
        """Let `dt` s pass and return whether a step is due."""
        self.state.waited_s += dt
        return self.state.waited_s >= self._step_s

    def learn(self, x: float, y: float, z: float, ux: float, uy: float, uz: float) -> None:
        """Take a reading (uT) and the up direction at its time, both in device axes."""
        s = self.state
        vertical = x * ux + y * uy + z * uz
        dt = s.waited_s
        s.waited_s = 0.0
        if not s.known:
            s.known = True
            s.vertical = s.raw_vertical = s.corrected_vertical = vertical
            s.up_x = ux
            s.up_y = uy
            s.up_z = uz
            s.raw_norm = s.corrected_norm = sqrt(x * x + y * y + z * z)
            return
        s.age_s += dt
        gain = dt / (self._mean_s + dt)
        s.vertical += gain * (vertical - s.vertical)
        s.up_x += gain * (ux - s.up_x)
        s.up_y += gain * (uy - s.up_y)
        s.up_z += gain * (uz - s.up_z)
        hx = ux - s.up_x
        hy = uy - s.up_y
        hz = uz - s.up_z
        turned2 = hx * hx + hy * hy + hz * hz
        b = s.estimate
        b.doubt(self._walk2 * dt, self._variance)
        if turned2 > 1e-3:
            residual = vertical - s.vertical - (hx * b.x + hy * b.y + hz * b.z)
            # What the low-pass holds is one observation, not one a step; little rotation is none at all.
            scarce = 1.0 + 1.0 / turned2
            noise = (self._noise2 + residual * residual) * scarce * scarce * 0.5 * self._mean_s / dt
            b.observe(hx, hy, hz, residual, noise)
        self._judge(x, y, z, vertical, ux, uy, uz, dt)

    def _judge(self, x: float, y: float, z: float, vertical: float, ux: float, uy: float, uz: float, dt: float) -> None:
        """Let `use` follow how much of the spread of norm and vertical part the estimate takes away."""
        s = self.state
        b = s.estimate
        gain = dt / min(s.age_s, self._trial_s)
        keep = 1.0 - gain
        norm = sqrt(x * x + y * y + z * z) - s.raw_norm
        rest = vertical - s.raw_vertical
        s.raw_norm += gain * norm
        s.raw_vertical += gain * rest
        s.raw_variance = keep * (s.raw_variance + gain * (norm * norm + rest * rest))
        x -= b.x
        y -= b.y
        z -= b.z
        norm = sqrt(x * x + y * y + z * z) - s.corrected_norm
        rest = vertical - (ux * b.x + uy * b.y + uz * b.z) - s.corrected_vertical
        s.corrected_norm += gain * norm
        s.corrected_vertical += gain * rest
        s.corrected_variance = keep * (s.corrected_variance + gain * (norm * norm + rest * rest))
        use = 0.0
        if 4.0 * s.age_s >= self._trial_s and s.raw_variance > 0.0:
            use = (self._worse - s.corrected_variance / s.raw_variance) / (self._worse - self._better)
            use = min(max(use, 0.0), 1.0)
        s.use += dt / (1.0 + dt) * (use - s.use)
