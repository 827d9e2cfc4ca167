"""The ambient sensors of the simulated phone: what is set is what they tell."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError, ProfileError
from posed.events import EventBatch, ReportingMode, SensorType
from posed.hal import open_source
from posed.hal.profile import load_profile, profile_names
from posed.hal.source import SensorSource

MS = 1_000_000
START = 5_000_000_000
LIGHT, PRESSURE, PROXIMITY = SensorType.LIGHT, SensorType.PRESSURE, SensorType.PROXIMITY


def a_phone(*on: SensorType, period_ms: int = 0, profile: str = "patonis2018") -> tuple[SensorSource, VirtualClock]:
    clock = VirtualClock(START)
    source = open_source("sim:still", load_profile(profile), clock)
    for kind in on:
        source.batch(int(kind), period_ms * MS, 0)
        source.activate(int(kind), True)
    return source, clock


def drained(source: SensorSource, clock: VirtualClock, at_ms: float) -> EventBatch:
    clock.advance_to(START + round(at_ms * MS))
    return source.drain(clock.now_ns())


def told(batch: EventBatch, kind: SensorType) -> list[tuple[float, float]]:
    """Return (ms since the start, value) of each event, the time to a tenth of a millisecond."""
    column = batch.columns.get(int(kind))
    if column is None:
        return []
    assert column.values.shape[1] == 1
    times = ((column.timestamp_ns - START) / MS).round(1)
    return list(zip(times.tolist(), column.values[:, 0].tolist(), strict=True))


def test_light_is_told_when_it_is_switched_on_and_when_it_changes() -> None:
    source, clock = a_phone(LIGHT)
    assert source.next_sample_ns(int(LIGHT)) == START + 1
    assert told(drained(source, clock, 10), LIGHT) == [(0, 300)]
    assert source.next_sample_ns(int(LIGHT)) is None
    clock.advance_to(START + 20 * MS)
    source.set_environment(LIGHT, 12)
    assert told(drained(source, clock, 30), LIGHT) == [(20, 12)]
    source.set_environment(LIGHT, 12)
    assert told(drained(source, clock, 40), LIGHT) == []
    source.activate(int(LIGHT), False)
    source.set_environment(LIGHT, 7)
    assert told(drained(source, clock, 50), LIGHT) == []
    source.activate(int(LIGHT), True)
    assert told(drained(source, clock, 60), LIGHT) == [(50, 7)]


def test_changes_come_no_faster_than_the_period_and_the_newest_wins() -> None:
    source, clock = a_phone(PROXIMITY, period_ms=100)
    assert told(drained(source, clock, 1), PROXIMITY) == [(0, 5)]
    for at_ms, value in ((10, 0), (20, 5), (30, 0)):
        clock.advance_to(START + at_ms * MS)
        source.set_environment(PROXIMITY, value)
    assert source.next_sample_ns(int(PROXIMITY)) == START + 100 * MS + 1
    assert told(drained(source, clock, 300), PROXIMITY) == [(100, 0)]


def test_pressure_is_sampled_with_noise_and_follows_what_is_set_from_that_instant_on() -> None:
    source, clock = a_phone(PRESSURE)
    first = told(drained(source, clock, 10_000), PRESSURE)
    assert len(first) == pytest.approx(150, abs=1)
    values = np.array([value for _, value in first])
    assert values.mean() == pytest.approx(1013.25, abs=0.02)
    assert values.std() == pytest.approx(0.008 * 15**0.5, rel=0.3)
    assert np.allclose(values / 0.01, np.round(values / 0.01), atol=1e-6)
    clock.advance_to(START + 10_500 * MS)
    source.set_environment(PRESSURE, 990)
    after = told(drained(source, clock, 11_000), PRESSURE)
    assert {at_ms > 10_500: round(value, -1) for at_ms, value in after} == {False: 1010, True: 990}


def test_how_often_it_is_drained_changes_nothing() -> None:
    (often, clock), (once, other) = a_phone(PRESSURE, period_ms=200), a_phone(PRESSURE, period_ms=200)
    pieces = [each for at_ms in range(37, 2001, 37) for each in told(drained(often, clock, at_ms), PRESSURE)]
    whole = told(drained(once, other, 1998), PRESSURE)
    assert pieces == whole
    assert np.diff([at_ms for at_ms, _ in whole]) == pytest.approx(200)


@pytest.mark.parametrize(
    ("kind", "value", "said"),
    [
        (LIGHT, -1.0, "light = -1 is not what its sensor can read; allowed: 0 to 10000"),
        (PROXIMITY, 6.0, "proximity = 6 .*allowed: 0 to 5"),
        (PRESSURE, float("nan"), "pressure = nan"),
        (SensorType.GYROSCOPE, 1.0, "gyroscope cannot be set here; this phone lets one set"),
    ],
)
def test_what_cannot_be_read_cannot_be_set(kind: SensorType, value: float, said: str) -> None:
    source, _ = a_phone()
    with pytest.raises(InvalidArgumentError, match=said):
        source.set_environment(kind, value)


def test_a_recordings_surroundings_are_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("sensor,timestamp_ns,x,y,z\naccelerometer,0,0,0,9.81\n")
    source = open_source(f"replay:{tmp_path}/a.csv", load_profile("modern"), VirtualClock(START))
    with pytest.raises(InvalidArgumentError, match="light cannot be set: this is a recording"):
        source.set_environment(LIGHT, 1.0)


@pytest.mark.parametrize("name", profile_names())
def test_every_phone_has_the_three_as_android_lists_them(name: str) -> None:
    source, _ = a_phone(profile=name)
    infos = {sensor.type: sensor for sensor in source.sensors}
    assert [sensor.handle for sensor in source.sensors] == sorted(sensor.handle for sensor in source.sensors)
    assert infos[PRESSURE].reporting_mode is ReportingMode.CONTINUOUS
    assert (infos[LIGHT].reporting_mode, infos[LIGHT].min_delay_us) == (ReportingMode.ON_CHANGE, 0)
    assert infos[PROXIMITY].wake_up
    assert not infos[LIGHT].wake_up


def test_a_phone_without_them_lists_none_and_a_bad_one_is_named(tmp_path: Path) -> None:
    profile = dataclasses.replace(load_profile("modern"), ambient=())
    bare = open_source("sim", profile, VirtualClock(START))
    assert LIGHT not in {sensor.type for sensor in bare.sensors}
    with pytest.raises(InvalidArgumentError, match="this phone lets one set nothing"):
        bare.set_environment(LIGHT, 1.0)
    shipped = load_profile.__globals__["_SHIPPED"].joinpath("modern.toml").read_text()
    (tmp_path / "mine.toml").write_text(shipped.replace("rates_hz = [1, 10, 25]", "rates_hz = [2000]"))
    with pytest.raises(ProfileError, match=r"pressure\.rates_hz"):
        load_profile(str(tmp_path / "mine.toml"))


def test_changes_are_the_same_however_seldom_they_are_drained() -> None:
    batches = []
    for drains in ((15, 25, 28, 40, 60), (60,)):
        source, clock = a_phone(LIGHT, period_ms=10)
        events: list[tuple[float, float]] = []
        for at_ms, value in ((20, 10.0), (23, 15.0), (26, 20.0), (50, 30.0)):
            events += [each for t in drains if t <= at_ms for each in told(drained(source, clock, t), LIGHT)]
            drains = tuple(t for t in drains if t > at_ms)
            clock.advance_to(START + at_ms * MS)
            source.set_environment(LIGHT, value)
        assert source.next_sample_ns(int(LIGHT)) is not None
        for t in drains:
            events += told(drained(source, clock, t), LIGHT)
        batches.append(events)
    assert batches[0] == [(0, 300), (20, 10), (30, 20), (50, 30)]
    assert batches[1] == batches[0]


def test_what_is_set_while_nothing_runs_is_kept_once() -> None:
    source, clock = a_phone()
    for k in range(1000):
        clock.advance_to(START + k * MS)
        source.set_environment(PRESSURE, 900.0 + k % 7)
    surroundings: Any = source._surroundings  # type: ignore[attr-defined]
    assert len(surroundings._values[int(PRESSURE)]._since) == 1
    source.batch(int(PRESSURE), 0, 0)
    source.activate(int(PRESSURE), True)
    (_, first), *_ = told(drained(source, clock, 1200), PRESSURE)
    assert first == pytest.approx(900.0 + 999 % 7, abs=0.5)
