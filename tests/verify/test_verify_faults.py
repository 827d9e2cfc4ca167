"""The suite's own test: each fault makes the verifications fail that are meant for it, and no other."""

from xml.etree import ElementTree

import pytest
from faulty_source import START_NS, Fault, FaultySource, VirtualClock, a_sensor

from posed.client import Sensor
from posed.verify.finding import Finding, Verdict
from posed.verify.junit import junit_xml
from posed.verify.matrix import Conditions, Point, points, run_point
from posed.verify.suite import steps

_CONDITIONS = Conditions(seconds=8.0, still=True, hifi=True)

_OF_EVENTS = {
    Fault.SLOW: {"Frequency"},
    Fault.FAST: {"Frequency"},
    Fault.GAPPY: {"EventGap"},
    Fault.JITTERY: {"Jitter"},
    Fault.REORDERED: {"EventOrdering"},
    Fault.STUCK_CLOCK: {"EventOrdering"},
    Fault.LATE: {"EventTimestampSynchronization"},
    Fault.FROM_THE_FUTURE: {"EventTimestampSynchronization"},
    Fault.OTHER_CLOCK: {"EventTimestampSynchronization", "TimestampClockSource"},
    Fault.DIES: {"EventBasic"},
    Fault.FOREIGN: {"EventBasic"},
    Fault.WRONG_UNIT: {"Magnitude"},
    Fault.NOISY: {"StandardDeviation"},
}
# What is withheld for 6 s is late and missing besides.
_OF_BATCHES = {Fault.BATCH_WITHHELD: {"BatchArrival", "EventBasic", "EventTimestampSynchronization"}}
_OF_CALLS = {
    Fault.REGISTERS_TWICE: {"RegisterTwice"},
    Fault.FIFO_HALVED: {"FifoLength"},
    Fault.TRIGGERS_ANYTHING: {"Trigger"},
    Fault.FLUSH_LOST: {"Flush"},
    Fault.FLUSH_TOLD_TO_ALL: {"Flush"},
    Fault.FLUSH_OF_NOBODY: {"FlushInactive"},
    Fault.STALE_EVENTS: {"NoStaleEvents"},
    Fault.CLIENT_STARVED: {"MultiClient"},
    Fault.SILENT_AFTER_MANY: {"Churn"},
    Fault.REFUSES_SOME: {"Churn"},
    Fault.TALKS_AFTER_UNREGISTERING: {"Churn"},
    Fault.STALLS_BY_MOVING: {"MovingRates"},
}


def _failed(findings: list[Finding]) -> set[str]:
    return {finding.verification for finding in findings if finding.verdict is Verdict.FAIL}


def _matrix(fault: Fault, latency_us: int = 0, seconds: float = 8.0) -> list[Finding]:
    clock = VirtualClock()
    source = FaultySource(clock, fault)
    conditions = Conditions(seconds=seconds, still=True, hifi=True)
    return run_point(source, clock, Point((a_sensor(),), 10_000, latency_us), conditions)


def _calls(fault: Fault) -> list[Finding]:
    clock = VirtualClock()
    todo = steps(FaultySource(clock, fault), clock, [a_sensor()], rates_hz=())
    return [finding for step in todo for finding in step.run()]


def test_a_faultless_source_passes_everything() -> None:
    clock = VirtualClock()
    sensors = (a_sensor(), a_sensor(Sensor.TYPE_GYROSCOPE_UNCALIBRATED), a_sensor(Sensor.TYPE_GRAVITY))
    source = FaultySource(clock, Fault.NONE, sensors)
    findings = [f for step in steps(source, clock, sensors, conditions=_CONDITIONS) for f in step.run()]
    assert [finding for finding in findings if finding.verdict is not Verdict.PASS] == []
    assert len(findings) > 400
    assert clock.now_ns() - START_NS < 600e9


@pytest.mark.parametrize("fault", list(_OF_EVENTS), ids=lambda fault: fault.name.lower())
def test_a_fault_of_events_fails_its_verification_alone(fault: Fault) -> None:
    assert _failed(_matrix(fault)) == _OF_EVENTS[fault]


@pytest.mark.parametrize("fault", list(_OF_BATCHES), ids=lambda fault: fault.name.lower())
def test_a_fault_of_batches_fails_its_verification_alone(fault: Fault) -> None:
    assert _failed(_matrix(fault, latency_us=1_000_000, seconds=12.0)) == _OF_BATCHES[fault]
    assert _failed(_matrix(Fault.NONE, latency_us=1_000_000, seconds=12.0)) == set()


@pytest.mark.parametrize("fault", list(_OF_CALLS), ids=lambda fault: fault.name.lower())
def test_a_fault_of_calls_fails_its_verification_alone(fault: Fault) -> None:
    assert _failed(_calls(fault)) == _OF_CALLS[fault]


@pytest.mark.parametrize(("fault", "failed"), [(Fault.NONE, set()), (Fault.CANCELS_TWICE, {"OneShot"})])
def test_a_one_shot_sensor_is_waited_for_once(fault: Fault, failed: set[str]) -> None:
    clock = VirtualClock()
    sensor = a_sensor(Sensor.TYPE_SIGNIFICANT_MOTION, Sensor.REPORTING_MODE_ONE_SHOT)
    findings = [f for step in steps(FaultySource(clock, fault, (sensor,)), clock, [sensor]) for f in step.run()]
    assert {f.verification for f in findings} == {"SensorList", "OneShot"}
    assert _failed(findings) == failed


@pytest.mark.parametrize(
    ("fault", "failed"),
    [(Fault.NONE, set()), (Fault.TELLS_NO_VALUE, {"OnChange"}), (Fault.FORGETS_JOINERS, {"OnChange"})],
)
def test_the_value_of_an_on_change_sensor_is_told_to_all_who_register(fault: Fault, failed: set[str]) -> None:
    clock = VirtualClock()
    sensor = a_sensor(Sensor.TYPE_LIGHT, Sensor.REPORTING_MODE_ON_CHANGE)
    findings = [f for step in steps(FaultySource(clock, fault, (sensor,)), clock, [sensor]) for f in step.run()]
    assert {f.verification for f in findings} == {"SensorList", "RegisterTwice", "Trigger", "Flush", "OnChange"}
    assert _failed(findings) == failed


def test_every_fault_is_tried() -> None:
    elsewhere = {
        Fault.NONE,
        Fault.CANCELS_TWICE,
        Fault.TELLS_NO_VALUE,
        Fault.FORGETS_JOINERS,
        Fault.MISCALIBRATED,
        Fault.FIVE_TIMES_TOO_FAST,
        Fault.SETTLES,
    }
    tried = {*_OF_EVENTS, *_OF_BATCHES, *_OF_CALLS, *elsewhere}
    assert tried == set(Fault)


@pytest.mark.parametrize(("fault", "failed"), [(Fault.NONE, set()), (Fault.MISCALIBRATED, {"CalibratedUncalibrated"})])
def test_a_gyroscope_is_its_uncalibrated_stream_without_the_bias(fault: Fault, failed: set[str]) -> None:
    clock = VirtualClock()
    sensors = (a_sensor(Sensor.TYPE_GYROSCOPE), a_sensor(Sensor.TYPE_GYROSCOPE_UNCALIBRATED))
    findings = run_point(FaultySource(clock, fault, sensors), clock, Point(sensors, 10_000, 0), _CONDITIONS)
    assert "CalibratedUncalibrated" in {finding.verification for finding in findings}
    assert _failed(findings) == failed


def test_the_profiles_own_rate_binds_where_androids_band_has_none_and_the_report_says_so() -> None:
    clock = VirtualClock()
    conditions = Conditions(seconds=8.0, rates_hz_of=lambda sensor: (50.0,))
    point = Point((a_sensor(),), 100_000, 0)
    source = FaultySource(clock, Fault.FIVE_TIMES_TOO_FAST)
    frequency = next(f for f in run_point(source, clock, point, conditions) if f.verification == "Frequency")
    assert (frequency.verdict, frequency.threshold) == (Verdict.PASS, "9.00 to 55.00 Hz")
    assert "50 Hz" in frequency.note
    assert "Frequency" in _failed(run_point(source, clock, point, Conditions(seconds=8.0)))


def test_a_fused_sensor_may_run_as_fast_as_the_accelerometer_is_asked_for_it() -> None:
    clock = VirtualClock()
    point = Point((a_sensor(Sensor.TYPE_ROTATION_VECTOR),), 200_000, 0)
    source = FaultySource(clock, Fault.FIVE_TIMES_TOO_FAST, point.sensors)
    assert _failed(run_point(source, clock, point, Conditions(seconds=8.0))) == set()


def test_a_sensor_that_another_client_hurries_is_not_judged_by_its_rate() -> None:
    clock = VirtualClock()
    conditions = Conditions(seconds=8.0, fastest_asked_us=lambda sensor: 5_000)
    source = FaultySource(clock, Fault.FIVE_TIMES_TOO_FAST)
    findings = run_point(source, clock, Point((a_sensor(),), 100_000, 0), conditions)
    assert [f.verification for f in findings if f.verdict is Verdict.SKIP] == ["Frequency"]


def test_junit_has_a_case_a_finding_with_what_was_measured() -> None:
    findings = _matrix(Fault.SLOW)
    root = ElementTree.fromstring(junit_xml(findings, 8.0).split("?>", 1)[1])
    assert (root.get("tests"), root.get("failures")) == (str(len(findings)), "1")
    failure = root.find("testsuite[@name='Frequency']/testcase/failure")
    assert failure is not None
    assert "measured 80.00 Hz, threshold 90.00 to 220.00 Hz" in failure.get("message", "")


def test_fused_sensors_are_not_judged_beside_those_they_hurry() -> None:
    sensors = [a_sensor(), a_sensor(Sensor.TYPE_GYROSCOPE), a_sensor(Sensor.TYPE_ROTATION_VECTOR)]
    assert [len(point.sensors) for point in points(sensors, (50.0,))] == [2, 1, 2, 1]
