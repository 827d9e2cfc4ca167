"""Is the magnetic field the earth's: its norm and dip against a reference that is learnt.

Fields are pairs of their horizontal and vertical part (uT, the vertical one up): the dips of two of them differ by the
angle between the pairs, so their products say whether it is within tolerance, and no angle is ever formed.
"""

from dataclasses import dataclass
from math import cos, pi, radians, sqrt

from posed.fusion.filter import require_positive


@dataclass(frozen=True, slots=True)
class FieldParams:
    """When a field is believed, and how a wrong reference is got rid of."""

    norm_tolerance: float = 0.15
    """Share of the reference norm; a field further off is rejected. Smaller rejects the calibration's residue."""
    dip_tolerance: float = radians(15.0)
    """rad, the same for the dip angle. Smaller rejects what linear acceleration does to the tilt."""
    mean_s: float = 0.05
    """s, time constant of the mean that is judged: the noise of single samples is no disturbance."""
    settle_s: float = 0.5
    """s within tolerance before a field is believed again: the edge of a disturbance looks right for a moment."""
    reference_s: float = 20.0
    """s, time constant with which the reference follows the fields believed."""
    candidate_s: float = 20.0
    """s in motion through one and the same rejected field until it becomes the reference.

    A field that stays the same while the phone turns is the surroundings', not that of a thing nearby.
    """
    candidate_rate: float = radians(20.0)
    """rad/s; slower turns do not count as motion."""
    patience_s: float = 60.0
    """s of rejection after which samples count again, with `late_weight`; ends any lock, also at rest."""
    late_weight: float = 1.0 / 16.0
    """Weight of a sample believed only because patience ran out: one sixteenth is four times its sigma."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class FieldState:
    """Mean, reference and candidate field (uT; seconds each was learnt from), and how the mean was judged."""

    known: bool = False
    horizontal: float = 0.0
    vertical: float = 0.0
    reference_age_s: float = 0.0
    reference_horizontal: float = 0.0
    reference_vertical: float = 0.0
    candidate_age_s: float = 0.0
    candidate_horizontal: float = 0.0
    candidate_vertical: float = 0.0
    good_s: float = 0.0
    rejected_s: float = 0.0
    disturbed: bool = False


class FieldGate:
    """Judges the field by norm and dip, which a wrong heading leaves as they are."""

    def __init__(self, params: FieldParams, state: FieldState) -> None:
        self.state = state
        self._norm_tolerance = params.norm_tolerance
        self._dip_cosine = cos(min(params.dip_tolerance, pi))
        self._mean_s = params.mean_s
        self._settle_s = params.settle_s
        self._reference_s = params.reference_s
        self._candidate_s = params.candidate_s
        self._candidate_rate2 = params.candidate_rate**2
        self._patience_s = params.patience_s
        self._late_weight = params.late_weight

    def start(self, horizontal: float, vertical: float) -> None:
        """Take this field (uT) as the reference: the first there is."""
        s = self.state
        s.known = True
        s.horizontal = s.reference_horizontal = s.candidate_horizontal = horizontal
        s.vertical = s.reference_vertical = s.candidate_vertical = vertical
        s.reference_age_s = s.candidate_age_s = s.rejected_s = 0.0
        s.good_s = self._settle_s
        s.disturbed = False

    def resume(self, horizontal: float, vertical: float) -> None:
        """Begin the mean anew at this field (uT): the first after a gap is judged by itself."""
        s = self.state
        s.horizontal = horizontal
        s.vertical = vertical

    def weight(self, horizontal: float, vertical: float, dt: float, rate2: float) -> float:
        """Return the weight of a sample (uT) that stands for `dt` s: 1 believed, 0 rejected.

        rate2: rad2/s2, the square of the rate at which the phone turns.
        """
        s = self.state
        gain = dt / (self._mean_s + dt)
        s.horizontal += gain * (horizontal - s.horizontal)
        s.vertical += gain * (vertical - s.vertical)
        if self._alike(s.reference_horizontal, s.reference_vertical):
            s.good_s += dt
            if s.good_s >= self._settle_s:
                s.disturbed = False
                s.reference_age_s += dt
                gain = dt / min(s.reference_age_s, self._reference_s)
                s.reference_horizontal += gain * (s.horizontal - s.reference_horizontal)
                s.reference_vertical += gain * (s.vertical - s.reference_vertical)
        else:
            s.good_s = 0.0
            s.disturbed = True
        if s.disturbed:
            self._try_candidate(dt, rate2)
        if not s.disturbed:
            s.rejected_s = max(s.rejected_s - 2.0 * dt, 0.0)
            return 1.0
        if s.rejected_s < self._patience_s:
            s.rejected_s += dt
            return 0.0
        return self._late_weight

    def _alike(self, horizontal: float, vertical: float) -> bool:
        """Return whether the mean is within tolerance of this field (uT)."""
        s = self.state
        norm = sqrt(s.horizontal * s.horizontal + s.vertical * s.vertical)
        known = sqrt(horizontal * horizontal + vertical * vertical)
        along = s.horizontal * horizontal + s.vertical * vertical
        return abs(norm - known) <= self._norm_tolerance * known and along >= self._dip_cosine * (norm * known)

    def _try_candidate(self, dt: float, rate2: float) -> None:
        s = self.state
        if not self._alike(s.candidate_horizontal, s.candidate_vertical):
            s.candidate_age_s = 0.0
            s.candidate_horizontal = s.horizontal
            s.candidate_vertical = s.vertical
            return
        gain = dt / min(s.candidate_age_s + dt, self._reference_s)
        s.candidate_horizontal += gain * (s.horizontal - s.candidate_horizontal)
        s.candidate_vertical += gain * (s.vertical - s.candidate_vertical)
        if rate2 > self._candidate_rate2:
            s.candidate_age_s += dt
            if s.candidate_age_s >= self._candidate_s:
                s.reference_horizontal = s.candidate_horizontal
                s.reference_vertical = s.candidate_vertical
                s.reference_age_s = s.candidate_age_s
                s.candidate_age_s = 0.0
                s.good_s = self._settle_s
                s.disturbed = False
