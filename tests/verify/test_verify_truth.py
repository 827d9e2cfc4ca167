"""The verifications that need to know how the phone was held: each fault fails its own, and no other."""

import contextlib
import math
from collections.abc import Callable, Iterator

import pytest
from faulty_source import START_NS, Fault, FaultySource, VirtualClock, a_sensor

from posed.client import Sensor
from posed.verify.finding import Finding, Verdict
from posed.verify.matrix import Conditions, Point, run_point
from posed.verify.suite import steps
from posed.verify.truth import (
    Attitude,
    Event,
    Held,
    Quaternion,
    verify_gyroscope_integration,
    verify_mean,
    verify_rotation_vector,
)

_RATE = math.radians(40.0)
_TILT = 0.5


def _attitude(seconds: float, heading_off: float = 0.0, tilt_off: float = 0.0) -> Quaternion:
    """Return a phone whose top is raised by _TILT and that turns left about the vertical."""
    turn, tilt = (_RATE * seconds + heading_off) / 2, (_TILT + tilt_off) / 2
    return (
        math.cos(turn) * math.sin(tilt),
        math.sin(turn) * math.sin(tilt),
        math.sin(turn) * math.cos(tilt),
        math.cos(turn) * math.cos(tilt),
    )


HELD = Held([Attitude(START_NS + 20_000_000 * k, _attitude(0.02 * k)) for k in range(501)])


def _findings(
    gravity: Callable[[float], tuple[float, float, float]] = lambda _: (
        0.0,
        9.81 * math.sin(_TILT),
        9.81 * math.cos(_TILT),
    ),
    rate: float = _RATE,
    heading_off: float = 0.0,
    tilt_off: float = 0.0,
    held: Held = HELD,
) -> list[Finding]:
    times = [0.003 + 0.01 * k for k in range(990)]
    stamps = [START_NS + round(1e9 * t) for t in times]
    of_gyroscope = (0.0, rate * math.sin(_TILT), rate * math.cos(_TILT))
    accelerations: list[Event] = [(at, gravity(t)) for at, t in zip(stamps, times, strict=True)]
    rates: list[Event] = [(at, of_gyroscope) for at in stamps]
    vectors: list[Event] = [(at, _attitude(t, heading_off, tilt_off)) for at, t in zip(stamps, times, strict=True)]
    return [
        verify_mean(a_sensor(), accelerations, held),
        verify_gyroscope_integration(a_sensor(Sensor.TYPE_GYROSCOPE), rates, held),
        verify_rotation_vector(a_sensor(Sensor.TYPE_ROTATION_VECTOR), vectors, held),
    ]


def _failed(findings: list[Finding]) -> set[str]:
    return {finding.verification for finding in findings if finding.verdict is Verdict.FAIL}


def test_a_phone_as_it_was_held_passes_all() -> None:
    findings = _findings()
    assert [finding.verdict for finding in findings] == [Verdict.PASS] * 3
    assert "after 396 deg" in findings[1].measured


@pytest.mark.parametrize(
    ("fault", "failed"),
    [
        ({"gravity": lambda _: (0.0, -9.81 * math.sin(_TILT), 9.81 * math.cos(_TILT))}, "Mean"),
        ({"rate": 1.04 * _RATE}, "GyroscopeIntegration"),
        ({"heading_off": 0.26}, "RotationVector"),
        ({"heading_off": -0.5}, "RotationVector"),
        ({"tilt_off": 0.16}, "RotationVector"),
    ],
)
def test_each_fault_fails_its_verification_alone(fault: dict[str, object], failed: str) -> None:
    assert _failed(_findings(**fault)) == {failed}  # type: ignore[arg-type]


def test_what_has_no_truth_or_hardly_turns_is_not_judged() -> None:
    assert [finding.verdict for finding in _findings(held=Held([]))] == [Verdict.SKIP] * 3
    slow = _findings(rate=math.radians(5.0))[1]
    assert (slow.verdict, slow.note) == (Verdict.SKIP, "the phone turned by 49 degrees only")


def test_truth_with_holes_is_no_truth_beside_the_events() -> None:
    halved = Held([each for each in HELD.attitudes if (each.timestamp_ns - START_NS) % 1_000_000_000 < 500_000_000])
    finding = _findings(held=halved)[2]
    assert finding.verdict is Verdict.FAIL
    assert "% of the events only" in finding.note


def test_the_suite_asks_for_the_truth_while_it_listens() -> None:
    clock = VirtualClock()
    sensors = (a_sensor(), a_sensor(Sensor.TYPE_GYROSCOPE), a_sensor(Sensor.TYPE_ROTATION_VECTOR))

    @contextlib.contextmanager
    def listen(take: Callable[[Attitude], None]) -> Iterator[None]:
        for k in range(600):
            instant_ns = clock.now_ns() + 20_000_000 * k
            clock.at(instant_ns, lambda at=instant_ns: take(Attitude(at, (0.0, 0.0, 0.0, 1.0))))
        yield

    todo = steps(FaultySource(clock, Fault.NONE, sensors), clock, sensors, rates_hz=(), listen=listen)
    (step,) = [step for step in todo if step.name == "against the truth"]
    found = {finding.verification: finding.verdict for finding in step.run()}
    assert found == {"Mean": Verdict.PASS, "GyroscopeIntegration": Verdict.SKIP, "RotationVector": Verdict.PASS}


@pytest.mark.parametrize(("fault", "failed"), [(Fault.NONE, set()), (Fault.SETTLES, {"InitialValue"})])
def test_a_pressure_that_settles_late_fails_its_initial_value(fault: Fault, failed: set[str]) -> None:
    clock = VirtualClock()
    source = FaultySource(clock, fault)
    point = Point((a_sensor(Sensor.TYPE_PRESSURE),), 10_000, 0)
    findings = run_point(source, clock, point, Conditions(seconds=8.0, hifi=True))
    assert "InitialValue" in {finding.verification for finding in findings}
    assert _failed(findings) == failed
