"""What the adaptive DCM filter is told (AdaptiveParams) and all that it remembers (AdaptiveState)."""

from dataclasses import dataclass, field

from posed.events import FilterStatus
from posed.fusion.adaptive_bias import BiasParams, BiasState
from posed.fusion.adaptive_field import FieldParams, FieldState
from posed.fusion.adaptive_heading import HeadingParams, HeadingState
from posed.fusion.adaptive_interval import IntervalParams, IntervalState
from posed.fusion.adaptive_iron import IronParams, IronState
from posed.fusion.adaptive_repeats import Repeats
from posed.fusion.adaptive_tilt import TiltParams, TiltState
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.event_arrays import HeldEvents
from posed.fusion.filter import require_delays, require_positive
from posed.fusion.rest import RestParams, RestState

_GAP = int(FilterStatus.GAP)
_BAD_SAMPLE = int(FilterStatus.BAD_SAMPLE)


@dataclass(frozen=True, slots=True)
class AdaptiveParams:
    """One set for all phones and rates.

    The noise of the parts is not among it: it is far below what motion and surroundings do, and what a slow rate loses
    is measured as it happens.
    """

    interval: IntervalParams = field(default_factory=IntervalParams)
    tilt: TiltParams = field(default_factory=TiltParams)
    bias: BiasParams = field(default_factory=BiasParams)
    rest: RestParams = field(default_factory=lambda: RestParams(learn_bias=False))
    earth: FieldParams = field(default_factory=FieldParams)
    iron: IronParams = field(default_factory=IronParams)
    heading: HeadingParams = field(default_factory=HeadingParams)
    gyro_delay_s: float = 0.003
    """s by which a gyroscope sample is older than its stamp (see SensorErrors). The pose looks ahead by it."""
    acc_delay_s: float = 0.006
    """s, the same for the accelerometer."""
    mag_delay_s: float = 0.008
    """s, the same for the magnetometer."""
    gyro_range: float = 35.0
    """rad/s a component can reach: beyond is a spike, at it the part is saturated. 2000 degrees/s, the widest of phone
    parts, is 34.9."""
    use_gyroscope: bool = True
    """False takes none, as Android's geomagnetic rotation vector."""
    use_magnetometer: bool = True
    """False takes none, as Android's game rotation vector: north is where the phone faced at the start."""

    def __post_init__(self) -> None:
        require_positive(self, "gyro_range")
        require_delays(self)


@dataclass
class AdaptiveState:
    """All that the filter remembers; equal states continue alike, bit for bit.

    matrix turns device vectors into the levelled frame, which has a heading of its own, at start_ns: the start of the
    newest gyroscope interval. Times in ns, each valid only with its flag; of `acc_ns` and `mag_ns` the newest sample,
    of `acc_used_ns` and `mag_used_ns` the newest not refused. held: measurements that wait for theirs.
    """

    matrix: DirectionCosines = field(default_factory=DirectionCosines)
    started: bool = False
    has_time: bool = False
    time_ns: int = 0
    """Newest gyroscope sample, or measurement while the gyroscope is lost."""
    start_ns: int = 0
    first_ns: int = 0
    """First event, or first after a gap."""
    newest_ns: int = 0
    """Newest stamp of all sensors that was believed; `ahead` while one far beyond it waits for a second to agree."""
    ahead: bool = False
    has_gyro: bool = False
    gyro_ns: int = 0
    gyro_repeats: Repeats = field(default_factory=Repeats)
    unsteady: bool = False
    """The newest acceleration differs from the one before by more than rounding: the stream has noise, or shakes."""
    gyro_lost: bool = False
    has_acc: bool = False
    acc_ns: int = 0
    acc_used_ns: int = 0
    acc_repeats: Repeats = field(default_factory=Repeats)
    has_mag: bool = False
    mag_ns: int = 0
    mag_used_ns: int = 0
    mag_repeats: Repeats = field(default_factory=Repeats)
    earth_gap: bool = False
    """No field has been judged since a gap."""
    free_fall: bool = False
    events: int = 0
    bad_samples: int = 0
    gaps: int = 0
    held: HeldEvents = field(default_factory=HeldEvents)
    interval: IntervalState = field(default_factory=IntervalState)
    tilt: TiltState = field(default_factory=TiltState)
    rest: RestState = field(default_factory=RestState)
    bias: BiasState = field(default_factory=BiasState)
    earth: FieldState = field(default_factory=FieldState)
    iron: IronState = field(default_factory=IronState)
    heading: HeadingState = field(default_factory=HeadingState)

    @classmethod
    def fresh(cls, params: AdaptiveParams) -> "AdaptiveState":
        """Return the state before the first event."""
        state = cls()
        state.bias.estimate.start(params.bias.std**2)
        state.iron.estimate.start(params.iron.std**2)
        return state

    def flag_gap(self) -> None:
        """Count a gap or a sample out of order, and have the next pose say so."""
        self.gaps += 1
        self.events |= _GAP

    def flag_bad_sample(self) -> None:
        """Count a sample refused, and have the next pose say so."""
        self.bad_samples += 1
        self.events |= _BAD_SAMPLE
