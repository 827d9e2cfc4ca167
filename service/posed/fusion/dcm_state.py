"""What the DCM filter is told (DcmParams) and all that it remembers (DcmState)."""

from dataclasses import dataclass, field

from posed.events import STANDARD_GRAVITY, FilterStatus
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.event_arrays import HeldEvents
from posed.fusion.filter import SensorErrors, require_positive
from posed.fusion.gate import GateParams, GateState
from posed.fusion.rest import RestParams, RestState

_GAP = int(FilterStatus.GAP)
_BAD_SAMPLE = int(FilterStatus.BAD_SAMPLE)


@dataclass(frozen=True, slots=True)
class DcmParams:
    """Noise of the parts, and what motion adds to it.

    In motion, phone parts err by far less than what they cannot know: linear acceleration, local fields, scale errors
    of the rate. These last, so they are densities, and their ratios are the filter's time constants:
    tilt 0.6 / (9.81 * 0.02) = 3 s, heading 4.5 uT / (25 uT * 0.02) = 9 s. Their common scale moves no orientation, only
    the variance reported: with it the median heading error was 0.45 sigma over eight laboratory recordings and 1.3 over
    seven of a phone, with optical truth, where 0.67 would be exact. At rest the tilt is left to the noise
    of the parts alone.
    """

    noise: SensorErrors = field(default_factory=SensorErrors)
    """White noise of the parts."""
    rotation_density: float = 0.02
    """rad/s/sqrt(Hz), error of the measured rate in motion. Larger follows gravity and north faster."""
    acceleration_density: float = 0.6
    """m/s2/sqrt(Hz), linear acceleration. Larger makes the tilt smoother and slower."""
    field_density: float = 4.5
    """uT/sqrt(Hz), what differs from the earth's field and passes the gate. Larger makes the heading slower."""
    lost_rotation_density: float = 1.0
    """rad/s/sqrt(Hz), how a phone in the hand turns, which is all that is known while the gyroscope is lost."""
    rest: RestParams = field(default_factory=RestParams)
    """Detection of rest and the gyroscope bias learnt there."""
    gate: GateParams = field(default_factory=GateParams)
    """The gate on magnetic disturbance."""
    gravity: float = STANDARD_GRAVITY
    """m/s2, what the accelerometer reads at rest."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class DcmState:
    """All that the filter remembers; equal states continue alike, bit for bit.

    The matrix, one variance (rad2) for the three elements of row 3 and one
    for the two of the heading column, the times up to which things are known (ns, each valid only with its flag), the
    last rate (rad/s, bias removed), and the measurements (type, ns, x, y, z) that wait for the gyroscope.
    """

    matrix: DirectionCosines = field(default_factory=DirectionCosines)
    tilt_variance: float = 0.0
    heading_variance: float = 0.0
    started: bool = False
    has_up: bool = False
    has_north: bool = False
    has_time: bool = False
    time_ns: int = 0
    heading_ns: int = 0
    has_gyro: bool = False
    gyro_ns: int = 0
    has_acc: bool = False
    acc_ns: int = 0
    has_mag: bool = False
    mag_ns: int = 0
    rate_x: float = 0.0
    rate_y: float = 0.0
    rate_z: float = 0.0
    gyro_lost: bool = False
    free_fall: bool = False
    events: int = 0
    bad_samples: int = 0
    gaps: int = 0
    held: HeldEvents = field(default_factory=HeldEvents)
    rest: RestState = field(default_factory=RestState)
    gate: GateState = field(default_factory=GateState)

    @classmethod
    def fresh(cls, params: DcmParams) -> "DcmState":
        """Return the state before the first event."""
        return cls(rest=RestState(bias_variance=params.rest.bias_std**2))

    def flag_gap(self) -> None:
        """Count a gap or a sample out of order, and have the next pose say so."""
        self.gaps += 1
        self.events |= _GAP

    def flag_bad_sample(self) -> None:
        """Count a sample refused, and have the next pose say so."""
        self.bad_samples += 1
        self.events |= _BAD_SAMPLE
