"""Filters of other packages behind the one protocol."""

import json
import math
import sys
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_phone import FIELD, GAME, FlatEvents, between, matrix, rotation, rotation_vector, sense, without

from posed.errors import InvalidArgumentError, InvalidStateError, MissingExtraError
from posed.events import FilterStatus, Float64Array, Orientation, SensorType
from posed.fusion import PACKAGED, OrientationFilter, make_filter

NAMES = sorted(PACKAGED)


def attitude(t: float) -> Float64Array:
    """Return a phone that is held at a slant and swung about the vertical."""
    return rotation(0.0, 0.0, 0.7 * np.sin(1.2 * t)) @ rotation(0.5, 0.0, 0.0)


def made(name: str) -> OrientationFilter:
    pytest.importorskip(name)
    return make_filter(name)


def answer(orientation_filter: OrientationFilter) -> Orientation:
    found = orientation_filter.orientation()
    assert found is not None
    return found


def off_deg(found: Orientation, truth: Float64Array) -> float:
    return float(np.degrees(np.linalg.norm(rotation_vector(truth.T @ matrix(found.quaternion)))))


@pytest.fixture(scope="module")
def swung() -> FlatEvents:
    return sense(attitude, 30.0, GAME, start_ns=7_000_000_000, bias=(0.004, -0.003, 0.005))


@pytest.mark.parametrize("name", NAMES)
def test_it_finds_a_clean_phone(name: str, swung: FlatEvents) -> None:
    one = made(name)
    assert one.name == name
    one.update_batch(between(swung, 0.0, 0.9))
    assert one.orientation() is None
    one.update_batch(between(swung, 0.9, 40.0))
    found = answer(one)
    assert found.timestamp_ns == 37_000_000_000
    assert found.quaternion[3] >= 0.0
    assert off_deg(found, attitude(30.0)) < 3.0


@pytest.mark.parametrize("name", NAMES)
def test_it_says_what_it_takes_the_bias_for(name: str) -> None:
    bias = (0.004, -0.003, 0.005)
    one = made(name)
    values, deviations = one.gyro_bias()
    assert values == (0.0, 0.0, 0.0)
    assert np.isnan(deviations).all()
    one.update_batch(sense(lambda t: np.eye(3), 30.0, GAME, bias=bias))
    values, deviations = one.gyro_bias()
    assert values == pytest.approx(bias, abs=np.radians(0.05))
    if name == "vqf":
        assert 0.0 < deviations[0] < np.radians(0.1)
    else:
        assert np.isnan(deviations).all()


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=8)
@given(cuts=st.lists(st.integers(0, 4500), max_size=5))
def test_the_result_does_not_depend_on_how_the_events_were_cut(name: str, swung: FlatEvents, cuts: list[int]) -> None:
    at_once, in_parts = made(name), made(name)
    events = list(between(swung, 0.0, 6.0))
    at_once.update_batch(events)
    edges = [0, *sorted(cut % len(events) for cut in cuts), len(events)]
    for first, last in pairwise(edges):
        in_parts.update_batch(events[first:last])
        in_parts.orientation()
    assert in_parts.orientation() == at_once.orientation()
    one_by_one = made(name)
    for kind, time_ns, x, y, z in events:
        one_by_one.update(SensorType(kind), time_ns, x, y, z)
    assert one_by_one.orientation() == at_once.orientation()


@pytest.mark.parametrize("seconds", [0.5, 1.0, 4.01])
def test_vqf_continues_from_what_was_saved(swung: FlatEvents, seconds: float) -> None:
    through, first = made("vqf"), made("vqf")
    through.update_batch(swung)
    first.update_batch(between(swung, 0.0, seconds))
    saved = json.loads(json.dumps(first.save(), allow_nan=False))
    second = made("vqf")
    second.restore(saved)
    assert second.save() == first.save()
    second.update_batch(between(swung, seconds, 100.0))
    assert second.orientation() == through.orientation()


@pytest.mark.parametrize(
    "change",
    [
        lambda saved: {"filter": "dcm"},
        lambda saved: saved | {"vqf": {"gyrQuat": 3}},
        lambda saved: saved | {"state": None},
        lambda saved: saved | {"state": saved["state"] | {"held": 1}},
        lambda saved: saved | {"state": saved["state"] | {"held": [1]}},
        lambda saved: saved | {"state": saved["state"] | {"rate": [1.0]}},
        lambda saved: saved | {"state": {"held": []}},
    ],
)
def test_vqf_refuses_what_is_no_state_of_it(swung: FlatEvents, change: Any) -> None:
    one = made("vqf")
    one.update_batch(between(swung, 0.0, 3.0))
    before = one.orientation()
    with pytest.raises(InvalidArgumentError, match="saved state"):
        one.restore(change(one.save()))
    assert one.orientation() == before


def test_imufusion_says_that_it_cannot_be_saved() -> None:
    one = made("imufusion")
    with pytest.raises(InvalidStateError, match="no access to its state"):
        one.save()
    with pytest.raises(InvalidStateError, match="no access to its state"):
        one.restore({})


@pytest.mark.parametrize("name", NAMES)
def test_a_package_that_is_not_installed_is_asked_for(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, PACKAGED[name][0], raising=False)
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtraError, match=rf"'{name}' needs .* pip install 'posed\[compare\]'"):
        make_filter(name)


def test_no_package_is_imported_before_it_is_wanted() -> None:
    assert import_module("posed.fusion").FILTERS.keys().isdisjoint(PACKAGED)
    with pytest.raises(InvalidArgumentError, match=r"choose one of .*imufusion.*vqf"):
        make_filter("nothing")


def test_a_measurement_acts_at_the_nearer_gyroscope_sample() -> None:
    """A millisecond this side or that of a slow gyroscope sample must not matter."""
    slow = (15.0, 15.0, 15.0)
    found = []
    for shift_ns in (-1_000_000, 1_000_000):
        events = sense(lambda t: rotation(0.0, 0.0, 2.0 * t) @ rotation(0.9, 0.0, 0.0), 20.0, slow, start_ns=10**9)
        moved = events.timestamp_ns + np.where(events.sensor_type == SensorType.GYROSCOPE, 0, shift_ns)
        order = np.argsort(moved, kind="stable")
        one = made("vqf")
        one.update_batch(FlatEvents(events.sensor_type[order], moved[order], events.values[order]))
        found.append(off_deg(answer(one), rotation(0.0, 0.0, 40.0) @ rotation(0.9, 0.0, 0.0)))
    assert max(found) < 1.5


def test_vqf_follows_a_change_of_rate() -> None:
    fast = sense(attitude, 10.0, (100.0, 200.0, 50.0))
    slow = between(sense(attitude, 25.0, (50.0, 50.0, 50.0)), 10.001, 26.0)
    one = made("vqf")
    one.update_batch(fast)
    one.update_batch(slow)
    assert off_deg(answer(one), attitude(25.0)) < 2.0


@pytest.mark.parametrize("name", NAMES)
def test_a_gyroscope_that_goes_is_flagged(name: str, swung: FlatEvents) -> None:
    one = made(name)
    one.update_batch(without(between(swung, 0.0, 12.0), SensorType.GYROSCOPE, 10.0, 12.0))
    lost = answer(one)
    assert lost.status & FilterStatus.GYRO_LOST
    assert lost.angular_rate == (0.0, 0.0, 0.0)
    assert lost.timestamp_ns > 7_000_000_000 + 11_900_000_000
    one.update_batch(between(swung, 12.0, 14.0))
    back = answer(one)
    assert not back.status & FilterStatus.GYRO_LOST
    assert back.status & FilterStatus.GAP
    one.clear_events()
    assert not answer(one).status & FilterStatus.GAP


@pytest.mark.parametrize("name", NAMES)
def test_bad_samples_are_flagged_and_left_out(name: str, swung: FlatEvents) -> None:
    one, clean = made(name), made(name)
    events = list(between(swung, 0.0, 5.0))
    clean.update_batch(events)
    spoilt = list(events)
    for kind in (1, 2, 4):
        spoilt.insert(400, (kind, events[400][1], float("nan"), 0.0, 0.0))
    one.update_batch([*spoilt, (8, events[-1][1] + 1, 1.0, 0.0, 0.0)])
    assert answer(one).status & FilterStatus.BAD_SAMPLE
    assert answer(one).quaternion == answer(clean).quaternion


def test_vqf_is_restored_in_one_process_after_a_bad_sample() -> None:
    one, other = made("vqf"), made("vqf")
    one.update(SensorType.GYROSCOPE, 1, math.nan, 0.0, 0.0)
    other.restore(one.save())
    assert other.save() == one.save()


def test_vqf_holds_no_more_than_it_must_without_a_gyroscope() -> None:
    one = made("vqf")
    one.update_batch((int(SensorType.ACCELEROMETER), k * 10_000_000, 0.0, 0.0, 9.81) for k in range(30_000))
    assert len(one.save()["state"]["held"]) <= 10_000


def test_vqf_tells_of_rest_and_disturbance() -> None:
    def swung_then_still(t: float) -> Float64Array:
        return attitude(min(t, 20.0))

    def magnet(t: float) -> Float64Array:
        return FIELD * (1.0 if t < 15.0 else 2.0)

    events = sense(swung_then_still, 30.0, GAME, field=magnet)
    one = made("vqf")
    one.update_batch(between(events, 0.0, 14.0))
    assert answer(one).status == FilterStatus.OK
    one.update_batch(between(events, 14.0, 18.0))
    assert answer(one).status == FilterStatus.MAGNETIC_DISTURBANCE
    one.update_batch(between(events, 18.0, 31.0))
    assert answer(one).status & FilterStatus.AT_REST
