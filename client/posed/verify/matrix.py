"""The matrix: every sensor at every rate, streaming and batched, different sensors side by side."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from posed.client.sensor import Sensor
from posed.verify.calibration import UNCALIBRATED, verify_calibration
from posed.verify.collector import Collector
from posed.verify.delivery import verify_delivery
from posed.verify.finding import Finding, judged
from posed.verify.frequency import verify_frequency
from posed.verify.ordering import verify_ordering
from posed.verify.recording import Recording, is_fused
from posed.verify.source import EventSource, SuiteClock
from posed.verify.spacing import verify_gaps, verify_jitter
from posed.verify.synchronization import verify_clock_source, verify_synchronization
from posed.verify.values import verify_initial_value, verify_magnitude, verify_standard_deviation

RATES_HZ = (0.0, 200.0, 100.0, 50.0, 25.0, 15.0, 10.0, 5.0, 1.0)
"""Those of CTS; 0 is fastest."""
BATCH_LATENCY_US = 1_000_000


@dataclass(frozen=True)
class Conditions:
    """What the matrix is run under.

    seconds: length of a point. still: the phone is at rest, so its noise may be judged. hifi: judge as a Hi-Fi device.
    rates_hz_of: the rates that a sensor has, the accelerometer's for a fused one, () if unknown. fastest_asked_us: the
    shortest period that any client asks of a sensor, the suite included, None if unknown.
    """

    seconds: float = 5.0
    still: bool = False
    hifi: bool = False
    rates_hz_of: Callable[[Sensor], tuple[float, ...]] = lambda sensor: ()
    fastest_asked_us: Callable[[Sensor], int | None] = lambda sensor: None


@dataclass(frozen=True, slots=True)
class Point:
    """One point of the matrix: sensors side by side, period (us, 0 = fastest), latency (us, 0 = streaming)."""

    sensors: tuple[Sensor, ...]
    sampling_period_us: int
    max_report_latency_us: int

    @property
    def name(self) -> str:
        """Rate and mode, for people."""
        rate = f"{1e6 / self.sampling_period_us:.4g} Hz" if self.sampling_period_us else "fastest"
        return f"{rate} {'batched' if self.max_report_latency_us else 'streaming'}"


def points(sensors: Sequence[Sensor], rates_hz: Sequence[float] = RATES_HZ) -> list[Point]:
    """Return the points of the matrix: continuous sensors only, the phone's own apart from the fused."""
    continuous = [s for s in sensors if s.reporting_mode == Sensor.REPORTING_MODE_CONTINUOUS]
    # A fused sensor may ask the phone's own for more, so that these cannot be judged beside it.
    groups = [[s for s in continuous if not is_fused(s)], [s for s in continuous if is_fused(s)]]
    return [
        Point(tuple(group), round(1e6 / rate) if rate else 0, latency_us)
        for rate in rates_hz
        for latency_us in (0, BATCH_LATENCY_US)
        for group in groups
        if group
    ]


def run_point(source: EventSource, clock: SuiteClock, point: Point, conditions: Conditions) -> list[Finding]:
    """Record the sensors of a point side by side and judge each, and each beside its uncalibrated stream."""
    recordings = record(source, clock, point, conditions)
    findings = [finding for recording in recordings for finding in judge(recording, conditions)]
    of_type = {recording.sensor.type: recording for recording in recordings}
    pairs = [(of_type.get(kind), of_type.get(raw)) for kind, raw in UNCALIBRATED.items()]
    return findings + [verify_calibration(one, other) for one, other in pairs if one and other]


def record(source: EventSource, clock: SuiteClock, point: Point, conditions: Conditions) -> list[Recording]:
    """Return what each sensor of a point gave."""
    begun: list[tuple[Sensor, Collector, int]] = []
    for sensor in point.sensors:
        collector = Collector(clock)
        if source.register_listener(collector, sensor, point.sampling_period_us, point.max_report_latency_us):
            begun.append((sensor, collector, clock.now_ns()))
        else:
            begun.append((sensor, collector, 0))
    clock.wait(conditions.seconds)
    overloaded = {sensor: _is_overloaded(sensor, point, conditions) for sensor in point.sensors}
    ended_ns = clock.now_ns()
    # Nothing that comes later is counted.
    taken = {sensor: tuple(collector.received) for sensor, collector, _ in begun}
    for _, collector, _ in begun:
        source.unregister_listener(collector)
    return [
        Recording(
            subject=f"{sensor.string_type.removeprefix('android.sensor.')} {point.name}",
            sensor=sensor,
            sampling_period_us=point.sampling_period_us,
            max_report_latency_us=point.max_report_latency_us,
            begun_ns=begun_ns,
            ended_ns=ended_ns,
            received=taken[sensor],
            rates_hz=conditions.rates_hz_of(sensor),
            hifi=conditions.hifi,
            overloaded=overloaded[sensor],
        )
        for sensor, _, begun_ns in begun
    ]


def judge(recording: Recording, conditions: Conditions) -> Iterator[Finding]:
    """Yield what CTS's default verifications find of one sensor."""
    yield verify_delivery(recording)
    if not recording.received:
        return
    yield verify_frequency(recording)
    yield verify_gaps(recording)
    yield verify_jitter(recording)
    yield verify_ordering(recording)
    yield verify_synchronization(recording)
    yield verify_clock_source(recording)
    if recording.max_report_latency_us:
        yield verify_batch_arrival(recording)
    of_values = (verify_magnitude, verify_initial_value, *((verify_standard_deviation,) if conditions.still else ()))
    for verify in of_values:
        finding = verify(recording)
        if finding is not None:
            yield finding


def verify_batch_arrival(recording: Recording) -> Finding:
    """Judge the first batch (BatchArrivalVerification): within 5 s of registration + latency."""
    after = (recording.received[0].received_ns - recording.begun_ns) / 1e9
    expected = recording.max_report_latency_us / 1e6
    return judged(
        "BatchArrival", recording.subject, f"{after:.2f} s", f"{expected:g} +- 5 s", abs(after - expected) <= 5.0
    )


def _is_overloaded(sensor: Sensor, point: Point, conditions: Conditions) -> bool:
    asked_us = conditions.fastest_asked_us(sensor)
    own_us = max(point.sampling_period_us, sensor.min_delay)
    if sensor.max_delay:
        own_us = min(own_us, sensor.max_delay)
    return asked_us is not None and asked_us < own_us
