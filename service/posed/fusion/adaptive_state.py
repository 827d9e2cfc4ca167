"""What the adaptive DCM filter is told (AdaptiveParams) and all that it remembers (AdaptiveState)."""

from dataclasses import dataclass, field

from posed.fusion.adaptive_bias import BiasParams, BiasState
from posed.fusion.adaptive_field import FieldParams, FieldState
from posed.fusion.adaptive_heading import HeadingParams, HeadingState
from posed.fusion.adaptive_interval import IntervalParams, IntervalState
from posed.fusion.adaptive_iron import IronParams, IronState
from posed.fusion.adaptive_tilt import TiltParams, TiltState
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.held import HeldEvents
from posed.fusion.rest import RestParams, RestState


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
    """s by which a gyroscope sample is older than its stamp: the group delay of the part's low-pass.

    The pose looks ahead by it. MPU-6500 at 184 Hz: 2.9 ms; its accelerometer 5.8 ms.
    """
    acc_delay_s: float = 0.006
    """s, the same for the accelerometer."""
    mag_delay_s: float = 0.008
    """s, the same for the magnetometer. AK8963: a conversion takes 7 ms."""
    use_gyroscope: bool = True
    """False takes none, as Android's geomagnetic rotation vector."""
    use_magnetometer: bool = True
    """False takes none, as Android's game rotation vector: north is where the phone faced at the start."""


@dataclass
class AdaptiveState:
    """All that the filter remembers; equal states continue alike, bit for bit.

    matrix turns device vectors into the levelled frame, which has a heading of its own, at start_ns: the start of the
    newest gyroscope interval. Times in ns, each valid only with its flag. held: measurements that wait for theirs.
    """

    matrix: DirectionCosines = field(default_factory=DirectionCosines)
    started: bool = False
    has_time: bool = False
    time_ns: int = 0
    """Newest gyroscope sample, or measurement while the gyroscope is lost."""
    start_ns: int = 0
    first_ns: int = 0
    has_gyro: bool = False
    gyro_ns: int = 0
    gyro_changed_ns: int = 0
    gyro_x: float = 0.0
    gyro_y: float = 0.0
    gyro_z: float = 0.0
    gyro_lost: bool = False
    has_acc: bool = False
    acc_ns: int = 0
    acc_changed_ns: int = 0
    acc_x: float = 0.0
    acc_y: float = 0.0
    acc_z: float = 0.0
    has_mag: bool = False
    mag_ns: int = 0
    mag_changed_ns: int = 0
    mag_x: float = 0.0
    mag_y: float = 0.0
    mag_z: float = 0.0
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
