"""What Android demands of every HAL (VTS), of each source."""

from collections.abc import Callable
from pathlib import Path

import pytest

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError
from posed.events import SensorType
from posed.hal import open_source
from posed.hal.profile import load_profile
from posed.hal.source import SensorSource

GYRO, ACC = SensorType.GYROSCOPE, SensorType.ACCELEROMETER


class Phone:
    """A source and the clock it runs on."""

    def __init__(self, spec: str) -> None:
        self.clock = VirtualClock(1_000_000_000)
        self.source: SensorSource = open_source(
            spec, load_profile("patonis2018"), self.clock, loop=spec.startswith("replay:")
        )

    def now_ns(self) -> int:
        return self.source.time_map.to_sample(self.clock.now_ns())

    def times(self, seconds: float, handle: int = GYRO) -> list[int]:
        """Let time pass and return the timestamps of a sensor's samples."""
        self.clock.advance_to(self.clock.now_ns() + int(seconds * 1e9))
        column = self.source.drain(self.now_ns()).columns.get(handle)
        times: list[int] = [] if column is None else column.timestamp_ns.tolist()
        return times


@pytest.fixture(params=["sim", "replay"])
def phone(request: pytest.FixtureRequest, tmp_path: Path) -> Phone:
    if request.param == "sim":
        return Phone("sim:pan")
    path = tmp_path / "walk.csv"
    rows = [f"{kind},{k * 5_000_000},0.1,0.2,9.8" for k in range(4000) for kind in ("gyroscope", "accelerometer")]
    path.write_text("\n".join(("sensor,timestamp_ns,x,y,z", *rows)) + "\n")
    return Phone(f"replay:{path}")


def test_activation_is_idempotent(phone: Phone) -> None:
    phone.source.batch(GYRO, 20_000_000, 0)
    for _ in range(2):
        phone.source.activate(GYRO, True)
    times = phone.times(1.0)
    assert 45 <= len(times) == len(set(times)) <= 55
    for _ in range(2):
        phone.source.activate(GYRO, False)
    assert phone.times(1.0) == []


def test_no_sample_of_before_comes_after_reactivation(phone: Phone) -> None:
    phone.source.activate(ACC, True)
    phone.source.activate(GYRO, True)
    phone.times(1.0)
    phone.clock.advance_to(phone.clock.now_ns() + 500_000_000)
    phone.source.activate(GYRO, False)
    phone.clock.advance_to(phone.clock.now_ns() + 500_000_000)
    on_at = phone.now_ns()
    phone.source.activate(GYRO, True)
    times = phone.times(1.0)
    assert times
    assert times[0] > on_at


@pytest.mark.parametrize("count", [1, 5])
def test_each_flush_completes_once_behind_the_samples(phone: Phone, count: int) -> None:
    phone.source.activate(GYRO, True)
    phone.clock.advance_to(phone.clock.now_ns() + 1_000_000_000)
    for _ in range(count):
        phone.source.flush(GYRO)
    batch = phone.source.drain(phone.now_ns())
    assert list(batch.flush_completes) == [GYRO] * count
    assert len(batch.columns[GYRO]) > 100
    assert not phone.source.drain(phone.now_ns()).flush_completes


def test_a_flush_of_an_inactive_sensor_is_refused_and_completes_nothing(phone: Phone) -> None:
    phone.source.activate(ACC, True)
    with pytest.raises(InvalidArgumentError, match="not active"):
        phone.source.flush(GYRO)
    assert not phone.source.drain(phone.now_ns()).flush_completes


def test_a_sensor_can_be_batched_active_or_not(phone: Phone) -> None:
    phone.source.batch(GYRO, 20_000_000, 0)
    phone.source.activate(GYRO, True)
    assert 45 <= len(phone.times(1.0)) <= 55
    phone.source.batch(GYRO, 5_000_000, 0)
    assert 190 <= len(phone.times(1.0)) <= 210


@pytest.mark.parametrize(
    "call",
    [
        lambda source: source.activate(999, True),
        lambda source: source.batch(999, 20_000_000, 0),
        lambda source: source.flush(999),
    ],
    ids=["activate", "batch", "flush"],
)
def test_an_unknown_handle_is_refused_by_name(phone: Phone, call: Callable[[SensorSource], None]) -> None:
    with pytest.raises(InvalidArgumentError, match="999"):
        call(phone.source)


def test_one_sensors_rate_changes_no_other(phone: Phone) -> None:
    for handle in (GYRO, ACC):
        phone.source.batch(handle, 20_000_000, 0)
        phone.source.activate(handle, True)
    before = len(phone.times(1.0, ACC))
    phone.source.batch(GYRO, 5_000_000, 0)
    assert abs(len(phone.times(1.0, ACC)) - before) <= 1
