"""Is the magnetic field the earth's: a gate on its norm and dip against a learnt reference."""

from dataclasses import dataclass
from math import radians

from posed.fusion.filter import require_positive


@dataclass(frozen=True, slots=True)
class GateParams:
    """When a magnetometer sample is believed, and how a wrong reference is got rid of."""

    enabled: bool = True
    """False believes every sample; the disturbance flag then never rises."""
    norm_tolerance: float = 0.15
    """Share of the reference norm; a sample further off is rejected. Smaller rejects the calibration's residue."""
    dip_tolerance: float = radians(15.0)
    """rad, the same for the dip angle. Smaller rejects what linear acceleration does to the fused tilt."""
    reference_s: float = 20.0
    """s, time constant with which the reference follows accepted samples."""
    candidate_s: float = 40.0
    """s in motion through one and the same rejected field until it becomes the reference.

    A field that stays the same while the phone moves is the surroundings', not that of a thing nearby. Longer than
    most disturbances last, short enough for a phone picked up from where its first reference was wrong.
    """
    patience_s: float = 60.0
    """s of unbroken rejection after which samples count again, with `late_weight`; ends any lock, also at rest.

    They stay flagged until the reference fits: whoever lies beside steel for long should know.
    """
    late_weight: float = 1.0 / 16.0
    """Weight of a sample believed only because patience ran out: one sixteenth is four times its sigma."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class GateState:
    """Reference and candidate field (uT, dip in rad, seconds each was learnt from), and how long rejection lasts."""

    reference_s: float = 0.0
    reference_norm: float = 0.0
    reference_dip: float = 0.0
    candidate_s: float = 0.0
    candidate_norm: float = 0.0
    candidate_dip: float = 0.0
    rejected_s: float = 0.0
    disturbed: bool = False


class MagneticGate:
    """Judges magnetometer samples by norm and dip, which a wrong heading leaves as they are."""

    def __init__(self, params: GateParams, state: GateState) -> None:
        self.state = state
        self._enabled = params.enabled
        self._norm_tolerance = params.norm_tolerance
        self._dip_tolerance = params.dip_tolerance
        self._reference_s = params.reference_s
        self._candidate_s = params.candidate_s
        self._patience_s = params.patience_s
        self._late_weight = params.late_weight

    def start(self, norm: float, dip: float, dt: float) -> None:
        """Take this field (uT, rad) as the reference: the first there is, or the first after a gap."""
        s = self.state
        s.reference_s = dt
        s.reference_norm = norm
        s.reference_dip = dip
        s.candidate_s = 0.0
        s.rejected_s = 0.0
        s.disturbed = False

    def weight(self, norm: float, dip: float, dt: float, at_rest: bool) -> float:
        """Return the weight of a sample (norm in uT, dip in rad, standing for `dt` s): 1 believed, 0 rejected."""
        s = self.state
        if not self._enabled:
            return 1.0
        if (
            abs(norm - s.reference_norm) <= self._norm_tolerance * s.reference_norm
            and abs(dip - s.reference_dip) <= self._dip_tolerance
        ):
            s.reference_s = min(s.reference_s + dt, self._reference_s)
            gain = dt / s.reference_s
            s.reference_norm += gain * (norm - s.reference_norm)
            s.reference_dip += gain * (dip - s.reference_dip)
            s.candidate_s = 0.0
            s.rejected_s = 0.0
            s.disturbed = False
            return 1.0
        s.disturbed = True
        s.rejected_s += dt
        if self._candidate_holds(norm, dip, dt, at_rest):
            self.start(s.candidate_norm, s.candidate_dip, self._reference_s)
            return 1.0
        return self._late_weight if s.rejected_s > self._patience_s else 0.0

    def _candidate_holds(self, norm: float, dip: float, dt: float, at_rest: bool) -> bool:
        s = self.state
        if (
            s.candidate_s > 0.0
            and abs(norm - s.candidate_norm) <= self._norm_tolerance * s.candidate_norm
            and abs(dip - s.candidate_dip) <= self._dip_tolerance
        ):
            gain = dt / min(s.candidate_s + dt, self._reference_s)
            s.candidate_norm += gain * (norm - s.candidate_norm)
            s.candidate_dip += gain * (dip - s.candidate_dip)
            if not at_rest:
                s.candidate_s += dt
            return s.candidate_s >= self._candidate_s
        s.candidate_s = dt
        s.candidate_norm = norm
        s.candidate_dip = dip
        return False
