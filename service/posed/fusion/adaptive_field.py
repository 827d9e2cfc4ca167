"""Is the magnetic field the earth's: its norm and dip against a reference that is learnt."""

from dataclasses import dataclass
from math import radians

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
    """Mean, reference and candidate field (uT; dip in rad; seconds each was learnt from), and how it was judged."""

    known: bool = False
    norm: float = 0.0
    dip: float = 0.0
    reference_age_s: float = 0.0
    reference_norm: float = 0.0
    reference_dip: float = 0.0
    candidate_age_s: float = 0.0
    candidate_norm: float = 0.0
    candidate_dip: float = 0.0
    good_s: float = 0.0
    rejected_s: float = 0.0
    disturbed: bool = False


class FieldGate:
    """Judges the field by norm and dip, which a wrong heading leaves as they are."""

    def __init__(self, params: FieldParams, state: FieldState) -> None:
        self.state = state
        self._norm_tolerance = params.norm_tolerance
        self._dip_tolerance = params.dip_tolerance
        self._mean_s = params.mean_s
        self._settle_s = params.settle_s
        self._reference_s = params.reference_s
        self._candidate_s = params.candidate_s
        self._candidate_rate2 = params.candidate_rate**2
        self._patience_s = params.patience_s
        self._late_weight = params.late_weight

    def start(self, norm: float, dip: float) -> None:
        """Take this field (uT, rad) as the reference: the first there is, or the first after a gap."""
        s = self.state
        s.known = True
        s.norm = s.reference_norm = s.candidate_norm = norm
        s.dip = s.reference_dip = s.candidate_dip = dip
        s.reference_age_s = s.candidate_age_s = s.rejected_s = 0.0
        s.good_s = self._settle_s
        s.disturbed = False

    def weight(self, norm: float, dip: float, dt: float, rate2: float) -> float:
        """Return the weight of a sample (uT, rad) that stands for `dt` s: 1 believed, 0 rejected.

        rate2: rad2/s2, the square of the rate at which the phone turns.
        """
        s = self.state
        gain = dt / (self._mean_s + dt)
        s.norm += gain * (norm - s.norm)
        s.dip += gain * (dip - s.dip)
        if (
            abs(s.norm - s.reference_norm) <= self._norm_tolerance * s.reference_norm
            and abs(s.dip - s.reference_dip) <= self._dip_tolerance
        ):
            s.good_s += dt
            if s.good_s >= self._settle_s:
                s.disturbed = False
                s.reference_age_s += dt
                gain = dt / min(s.reference_age_s, self._reference_s)
                s.reference_norm += gain * (s.norm - s.reference_norm)
                s.reference_dip += gain * (s.dip - s.reference_dip)
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

    def _try_candidate(self, dt: float, rate2: float) -> None:
        s = self.state
        if (
            abs(s.norm - s.candidate_norm) > self._norm_tolerance * s.candidate_norm
            or abs(s.dip - s.candidate_dip) > self._dip_tolerance
        ):
            s.candidate_age_s = 0.0
            s.candidate_norm = s.norm
            s.candidate_dip = s.dip
            return
        gain = dt / min(s.candidate_age_s + dt, self._reference_s)
        s.candidate_norm += gain * (s.norm - s.candidate_norm)
        s.candidate_dip += gain * (s.dip - s.candidate_dip)
        if rate2 > self._candidate_rate2:
            s.candidate_age_s += dt
            if s.candidate_age_s >= self._candidate_s:
                s.reference_norm = s.candidate_norm
                s.reference_dip = s.candidate_dip
                s.reference_age_s = s.candidate_age_s
                s.candidate_age_s = 0.0
                s.good_s = self._settle_s
                s.disturbed = False
