"""The paper to the letter: what its first order costs, and what it makes of samples that are none."""

import math
from dataclasses import fields

import numpy as np
import pytest
from synthetic_phone import FASTEST, FIELD, GAME, GRAVITY, between, error_deg, rotation, sense, without

from posed.errors import InvalidArgumentError
from posed.events import FilterStatus, Float64Array, SensorType
from posed.fusion import make_filter
from posed.fusion.dcm_literal import LiteralFilter, LiteralParams
from posed.fusion.dcm_state import DcmParams


def nodding(t: float) -> Float64Array:
    return rotation(0.0, 0.0, 0.5 * math.sin(0.7 * t)) @ rotation(0.6 * math.sin(1.1 * t), 0.4 * math.sin(0.9 * t), 0.0)


def test_a_phone_in_the_hand_is_followed() -> None:
    literal = LiteralFilter()
    worst = 0.0
    events = sense(nodding, 20.0)
    for k in range(0, len(events), 50):
        literal.update_batch(events[k : k + 50])
        answer = literal.orientation()
        if answer is not None:
            worst = max(worst, error_deg(literal, nodding(answer.timestamp_ns * 1e-9)))
    assert worst < 1.0


def test_the_first_order_costs_more_the_slower_the_gyroscope_is_sampled() -> None:
    def coning(t: float) -> Float64Array:
        return rotation(0.5 * math.cos(8.0 * t), 0.5 * math.sin(8.0 * t), 0.0)

    errors = {}
    for name in ("dcm", "dcm-literal"):
        for rates in (FASTEST, GAME):
            made = make_filter(name)
            made.update_batch(sense(coning, 10.0, rates))
            errors[name, rates] = error_deg(made, coning(10.0))
    assert errors["dcm-literal", GAME] > 2.0 * errors["dcm-literal", FASTEST]
    assert errors["dcm-literal", GAME] > 2.0 * errors["dcm", GAME]


def test_the_variances_are_those_of_dcm() -> None:
    dcm = DcmParams()
    for each in fields(LiteralParams):
        assert getattr(LiteralParams(), each.name) == getattr(dcm, each.name)
    with pytest.raises(InvalidArgumentError, match="field_density"):
        LiteralParams(field_density=0.0)


@pytest.mark.parametrize("kind", [SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD])
def test_bad_and_late_samples_are_skipped_counted_and_flagged(kind: SensorType) -> None:
    literal = LiteralFilter()
    literal.update_batch(sense(nodding, 2.0))
    before = literal.orientation()
    assert before is not None
    assert before.status == FilterStatus.OK
    literal.update(kind, 2_010_000_000, math.nan, 0.0, 0.0)
    literal.update(kind, 2**62, 0.0, 0.0, 1.0)
    literal.update(kind, 1_900_000_000, 0.0, 0.0, 1.0)
    after = literal.orientation()
    assert after is not None
    assert after.quaternion == before.quaternion
    assert after.status == FilterStatus.BAD_SAMPLE | FilterStatus.GAP
    assert (literal.state.bad_samples, literal.state.gaps) == (2, 1)
    literal.clear_events()
    cleared = literal.orientation()
    assert cleared is not None
    assert cleared.status == FilterStatus.OK


def test_nothing_to_normalise_is_no_sample() -> None:
    literal = LiteralFilter()
    literal.update(SensorType.ACCELEROMETER, 0, 0.0, 0.0, 0.0)
    literal.update(SensorType.MAGNETIC_FIELD, 0, *FIELD)
    assert literal.orientation() is None
    literal.update(SensorType.ACCELEROMETER, 10_000_000, 0.0, 0.0, GRAVITY)
    literal.update(SensorType.MAGNETIC_FIELD, 10_000_000, 0.0, 0.0, -42.0)
    assert literal.orientation() is None
    assert literal.state.bad_samples == 2


def test_after_a_gap_the_pose_is_found_anew() -> None:
    whole = sense(nodding, 6.0)
    literal = LiteralFilter()
    literal.update_batch(between(whole, 0.0, 2.0))
    literal.update_batch(between(whole, 4.0, 6.0))
    answer = literal.orientation()
    assert answer is not None
    assert answer.status == FilterStatus.GAP
    assert error_deg(literal, nodding(answer.timestamp_ns * 1e-9)) < 1.0


def test_without_a_gyroscope_the_pose_is_that_of_the_other_two() -> None:
    literal = LiteralFilter()
    events = without(sense(lambda t: rotation(0.2, 0.3, 0.4), 4.0), SensorType.GYROSCOPE, 1.0, 10.0)
    literal.update_batch(events)
    answer = literal.orientation()
    assert answer is not None
    assert FilterStatus.GYRO_LOST in answer.status
    assert answer.timestamp_ns == 4_000_000_000
    assert answer.angular_rate == (0.0, 0.0, 0.0)
    assert error_deg(literal, np.asarray(rotation(0.2, 0.3, 0.4))) < 1e-6
