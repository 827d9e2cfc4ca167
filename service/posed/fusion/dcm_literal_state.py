"""What the literal DCM filter is told (LiteralParams) and all that it remembers (LiteralState)."""

from dataclasses import dataclass, field

from posed.events import FilterStatus
from posed.fusion.filter import SensorErrors, require_positive

_GAP = int(FilterStatus.GAP)
_BAD_SAMPLE = int(FilterStatus.BAD_SAMPLE)


@dataclass(frozen=True, slots=True)
class LiteralParams:
    """Sampling variances, those of DcmParams: what differs from `dcm` is the equations and not the tuning."""

    noise: SensorErrors = field(default_factory=SensorErrors)
    """White noise of the parts."""
    rotation_density: float = 0.02
    """rad/s/sqrt(Hz), error of the measured rate in motion."""
    acceleration_density: float = 0.6
    """m/s2/sqrt(Hz), linear acceleration."""
    field_density: float = 4.5
    """uT/sqrt(Hz), what differs from the earth's field."""

    def __post_init__(self) -> None:
        require_positive(self)


@dataclass
class LiteralState:
    """All that the filter remembers; equal states continue alike, bit for bit.

    The matrix by the paper's names, device to world (ENU); the variances of row 3 and of the heading column's first two
    elements; the column (0, 1, 2) and the normalised acceleration of the newest accelerometer sample; the newest rate
    (rad/s); times (ns), each valid only with its flag.
    """

    r11: float = 1.0
    r12: float = 0.0
    r13: float = 0.0
    r21: float = 0.0
    r22: float = 1.0
    r23: float = 0.0
    r31: float = 0.0
    r32: float = 0.0
    r33: float = 1.0
    p31: float = 0.0
    p32: float = 0.0
    p33: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    column: int = 0
    acc_x: float = 0.0
    acc_y: float = 0.0
    acc_z: float = 0.0
    rate_x: float = 0.0
    rate_y: float = 0.0
    rate_z: float = 0.0
    started: bool = False
    has_north: bool = False
    time_ns: int = 0
    has_gyro: bool = False
    gyro_lost: bool = False
    gyro_ns: int = 0
    has_acc: bool = False
    acc_ns: int = 0
    has_mag: bool = False
    mag_ns: int = 0
    events: int = 0
    bad_samples: int = 0
    gaps: int = 0

    def flag_gap(self) -> None:
        """Count a gap or a sample out of order, and have the next pose say so."""
        self.gaps += 1
        self.events |= _GAP

    def flag_bad_sample(self) -> None:
        """Count a sample refused, and have the next pose say so."""
        self.bad_samples += 1
        self.events |= _BAD_SAMPLE
