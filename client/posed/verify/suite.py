"""The whole suite as a list of steps, run one by one."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from posed.client.sensor import Sensor
from posed.verify.behaviour import Behaviour
from posed.verify.finding import Finding
from posed.verify.matrix import RATES_HZ, Conditions, points, run_point
from posed.verify.sensor_list import verify_sensor_list
from posed.verify.source import EventSource, SuiteClock
from posed.verify.truth import TruthStream, run_against_truth

_TRUTH_S = 10.0


@dataclass(frozen=True, slots=True)
class Step:
    """What takes a while, and what it is called meanwhile."""

    name: str
    run: Callable[[], Sequence[Finding]]
    group: str
    """What several steps in a row have in common, for who wants to be told less."""


def steps(
    source: EventSource,
    clock: SuiteClock,
    sensors: Sequence[Sensor],
    rates_hz: Sequence[float] = RATES_HZ,
    conditions: Conditions | None = None,
    listen: TruthStream | None = None,
) -> Iterator[Step]:
    """Yield the steps of the suite for these sensors: the list, the matrix, the truth, then the behaviours of each."""
    yield Step("sensor list", partial(verify_sensor_list, list(sensors)), "sensor list")
    for point in points(sensors, rates_hz):
        yield Step(point.name, partial(run_point, source, clock, point, conditions or Conditions()), point.name)
    if listen is not None:
        against_truth = partial(run_against_truth, source, clock, sensors, listen, _TRUTH_S)
        yield Step("against the truth", against_truth, "against the truth")
    for sensor in sensors:
        for name, verify in Behaviour(source, clock, sensor).verifications().items():
            subject = sensor.string_type.removeprefix("android.sensor.")
            yield Step(f"{name} {subject}", partial(_listed, verify), f"calls of {subject}")


def _listed(verify: Callable[[], Iterator[Finding]]) -> list[Finding]:
    return list(verify())
