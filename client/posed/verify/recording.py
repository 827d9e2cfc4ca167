"""Events as they were received, with what was asked."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from posed.client.sensor import Sensor, SensorEvent

_MINIMUM_PERIOD_US = 1_000
_FUSED = frozenset(
    (
        Sensor.TYPE_ORIENTATION,
        Sensor.TYPE_GRAVITY,
        Sensor.TYPE_LINEAR_ACCELERATION,
        Sensor.TYPE_ROTATION_VECTOR,
        Sensor.TYPE_GAME_ROTATION_VECTOR,
        Sensor.TYPE_GEOMAGNETIC_ROTATION_VECTOR,
        Sensor.TYPE_POSE_6DOF,
        Sensor.TYPE_HEADING,
    )
)


def is_fused(sensor: Sensor) -> bool:
    """Return whether a sensor is computed from others, so that it may hurry them and follows the accelerometer."""
    return sensor.type in _FUSED


@dataclass(frozen=True, slots=True)
class Received:
    """One event and the instant it arrived, ns on the clock that live timestamps are on (CLOCK_BOOTTIME)."""

    event: SensorEvent
    received_ns: int


@dataclass(frozen=True)
class Recording:
    """What one registration of one sensor received; at least the events, in the order of their arrival.

    sampling_period_us: asked, 0 = fastest. begun_ns, ended_ns: registration and its end, on the clock of received_ns.
    rates_hz: the rates the sensor has, if they are known. hifi: judge as a device with Android's FEATURE_HIFI_SENSORS.
    overloaded: True if another client asks the sensor for more.
    """

    subject: str
    sensor: Sensor
    sampling_period_us: int
    max_report_latency_us: int
    begun_ns: int
    ended_ns: int
    received: tuple[Received, ...]
    rates_hz: tuple[float, ...] = ()
    hifi: bool = False
    overloaded: bool = False

    @property
    def shortest_expected_us(self) -> int:
        """The period asked, but no shorter than the sensor's: what the slowest acceptable rate is counted from."""
        return max(self.sampling_period_us, self.sensor.min_delay, _MINIMUM_PERIOD_US)

    @property
    def expected_us(self) -> int:
        """The period asked, within what the sensor has (TestSensorEnvironment.getExpectedSamplingPeriodUs)."""
        longest = self.sensor.max_delay or self.shortest_expected_us
        return max(min(self.sampling_period_us, longest), self.sensor.min_delay, _MINIMUM_PERIOD_US)

    @cached_property
    def timestamps(self) -> tuple[int, ...]:
        """Sample times (ns) of the sensor's own events, sorted."""
        return tuple(sorted(each.event.timestamp for each in self.received if each.event.sensor == self.sensor))

    @cached_property
    def spacings(self) -> tuple[int, ...]:
        """Differences of the sorted sample times, ns."""
        return tuple(b - a for a, b in pairwise(self.timestamps))

    @property
    def is_continuous(self) -> bool:
        """True for a sensor that samples at a rate of its own."""
        return self.sensor.reporting_mode == Sensor.REPORTING_MODE_CONTINUOUS
