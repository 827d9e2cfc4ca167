"""What the filter does when samples lie, come late, or do not come."""

import numpy as np
import pytest
from synthetic_phone import (
    FASTEST,
    FIELD,
    GAME,
    Attitude,
    FlatEvents,
    between,
    error_deg,
    heading_deg,
    rotation,
    sense,
    without,
)

from posed.events import FilterStatus, Float64Array, Orientation, SensorType
from posed.fusion.dcm import DcmFilter, DcmParams
from posed.fusion.gate import GateParams

LYING: Attitude = lambda t: np.eye(3)  # noqa: E731
MAGNET = np.array([60.0, 0.0, 0.0])
ACC, GYRO, MAG = SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD


def handled(t: float) -> Float64Array:
    """A phone in the hand: never still, never far from portrait."""
    return rotation(0, 0, 0.8 * np.sin(0.5 * t)) @ rotation(0.6 + 0.3 * np.sin(1.3 * t), 0.2 * np.sin(0.9 * t), 0)


def answer(dcm: DcmFilter) -> Orientation:
    orientation = dcm.orientation()
    assert orientation is not None
    return orientation


def test_a_disturbance_is_gated_flagged_and_left_behind() -> None:
    events = sense(
        LYING,
        70.0,
        bias=(0.003, -0.002, 0.004),
        field=lambda t: FIELD + MAGNET * (20.0 <= t < 50.0),
        noise=np.random.default_rng(3),
    )
    dcm = DcmFilter()
    dcm.update_batch(between(events, 0.0, 20.0))
    calm = answer(dcm)
    assert not calm.status & FilterStatus.MAGNETIC_DISTURBANCE
    dcm.update_batch(between(events, 20.0, 21.0))
    assert answer(dcm).status & FilterStatus.MAGNETIC_DISTURBANCE
    dcm.update_batch(between(events, 21.0, 50.0))
    disturbed = answer(dcm)
    assert disturbed.status & FilterStatus.MAGNETIC_DISTURBANCE
    assert abs(heading_deg(dcm)) < 1.0
    assert disturbed.heading_accuracy > calm.heading_accuracy
    dcm.update_batch(between(events, 50.0, 70.0))
    assert not answer(dcm).status & FilterStatus.MAGNETIC_DISTURBANCE
    assert abs(heading_deg(dcm)) < 0.5


def test_a_handled_phone_keeps_its_heading_through_a_disturbance() -> None:
    events = sense(handled, 60.0, bias=(0.001, -0.001, 0.001), field=lambda t: FIELD + MAGNET * (20.0 <= t < 50.0))
    dcm = DcmFilter()
    dcm.update_batch(between(events, 0.0, 50.0))
    assert answer(dcm).status & FilterStatus.MAGNETIC_DISTURBANCE
    assert error_deg(dcm, handled(answer(dcm).timestamp_ns * 1e-9)) < 5.0
    dcm.update_batch(between(events, 50.0, 61.0))
    assert answer(dcm).status == FilterStatus.OK


def test_without_the_gate_the_magnet_turns_the_heading() -> None:
    events = sense(LYING, 40.0, GAME, field=lambda t: FIELD + MAGNET * (t >= 10.0))
    dcm = DcmFilter(DcmParams(gate=GateParams(enabled=False)))
    dcm.update_batch(events)
    assert abs(heading_deg(dcm)) > 45.0
    assert not answer(dcm).status & FilterStatus.MAGNETIC_DISTURBANCE


@pytest.mark.parametrize(("attitude", "within_s"), [(handled, 80.0), (LYING, 240.0)])
def test_a_wrong_first_reference_does_not_lock_the_heading(attitude: Attitude, within_s: float) -> None:
    """Started beside a magnet that is then gone: in motion the true field is taken up, at rest patience ends it."""
    events = sense(attitude, within_s, GAME, field=lambda t: FIELD + MAGNET * (t < 5.0))
    dcm = DcmFilter()
    dcm.update_batch(between(events, 0.0, 10.0))
    assert answer(dcm).status & FilterStatus.MAGNETIC_DISTURBANCE
    assert error_deg(dcm, attitude(10.0)) > 45.0
    dcm.update_batch(between(events, 10.0, within_s + 1.0))
    assert error_deg(dcm, attitude(within_s)) < 3.0
    assert bool(answer(dcm).status & FilterStatus.MAGNETIC_DISTURBANCE) is (attitude is LYING)


def test_a_gap_of_all_sensors_starts_anew_and_is_flagged() -> None:
    before = sense(LYING, 5.0, FASTEST)
    turned = rotation(0.5, 1.2, 2.0)
    after = sense(lambda t: turned, 4.0, FASTEST, start_ns=65_000_000_000)
    dcm = DcmFilter()
    dcm.update_batch(before)
    dcm.clear_events()
    gyro = np.flatnonzero(after.sensor_type == GYRO)[0]
    dcm.update(GYRO, int(after.timestamp_ns[gyro]), 0.0, 0.0, 0.0)
    first = answer(dcm)
    assert first.status & FilterStatus.GAP
    assert first.status & FilterStatus.INITIALISING
    assert first.heading_accuracy == pytest.approx(np.pi / np.sqrt(3))
    dcm.update_batch(after)
    assert error_deg(dcm, turned) < 1e-6
    assert not answer(dcm).status & FilterStatus.INITIALISING
    assert answer(dcm).status & FilterStatus.GAP
    dcm.clear_events()
    assert answer(dcm).status == FilterStatus.AT_REST
    assert dcm.state.gaps >= 1


def test_a_clock_set_back_does_not_lock_the_filter_out() -> None:
    dcm = DcmFilter()
    dcm.update_batch(sense(LYING, 3.0, FASTEST, start_ns=3_600_000_000_000))
    turned = rotation(0.0, 0.7, 0.3)
    dcm.update_batch(sense(lambda t: turned, 3.0, FASTEST, start_ns=-7))
    assert answer(dcm).timestamp_ns == 2_999_999_993
    assert error_deg(dcm, turned) < 1e-6
    assert answer(dcm).status & FilterStatus.GAP


def test_free_fall_is_flagged_and_carried_by_the_gyroscope() -> None:
    events = sense(lambda t: rotation(0, 2.0 * t, 0), 4.0, FASTEST)
    values = events.values.copy()
    falling = (events.sensor_type == ACC) & (events.timestamp_ns >= 2_000_000_000) & (events.timestamp_ns < 3e9)
    values[falling] = (0.1, -0.2, 0.3)
    events = FlatEvents(events.sensor_type, events.timestamp_ns, values)
    dcm = DcmFilter()
    dcm.update_batch(between(events, 0.0, 3.0))
    assert answer(dcm).status & FilterStatus.FREE_FALL
    assert error_deg(dcm, rotation(0, 2.0 * answer(dcm).timestamp_ns * 1e-9, 0)) < 0.01
    dcm.update_batch(between(events, 3.0, 5.0))
    assert not answer(dcm).status & FilterStatus.FREE_FALL


def test_bad_samples_are_counted_flagged_and_change_nothing_else() -> None:
    events = sense(handled, 10.0, FASTEST)
    clean = DcmFilter()
    clean.update_batch(events)
    dirty = DcmFilter()
    bad = [(np.nan, 0.0, 9.8), (0.0, np.inf, 0.0), (1e200, 0.0, 0.0), (0.0, 0.0, -1e308)]
    for k in range(0, len(events), 100):
        dirty.update_batch(events[k : k + 100])
        for sensor_type in (ACC, GYRO, MAG):
            dirty.update(sensor_type, int(events.timestamp_ns[min(k + 100, len(events) - 1)]), *bad[k // 100 % 4])
    count = 3 * len(range(0, len(events), 100))
    assert dirty.state.bad_samples == count
    assert answer(dirty).status & FilterStatus.BAD_SAMPLE
    dirty.clear_events()
    dirty.state.bad_samples = 0
    assert dirty.save() == clean.save()


@pytest.mark.parametrize("field", [(0.0, 0.0, 0.0), (0.0, 0.0, -48.0)])
def test_a_field_that_points_nowhere_is_skipped(field: tuple[float, float, float]) -> None:
    dcm = DcmFilter()
    dcm.update_batch(sense(LYING, 2.0, GAME))
    dcm.update(MAG, 2_010_000_000, *field)
    dcm.update(GYRO, 2_020_000_000, 0.0, 0.0, 0.0)
    assert dcm.state.bad_samples == 1
    assert answer(dcm).status & FilterStatus.BAD_SAMPLE
    assert error_deg(dcm, np.eye(3)) < 1e-9


def test_late_measurements_act_at_once_and_disorder_is_flagged() -> None:
    events = sense(handled, 20.0, FASTEST)
    # Accelerometer and magnetometer arrive 12 ms after their time, out of order with the gyroscope.
    late = events.timestamp_ns + np.where(events.sensor_type == GYRO, 0, 12_000_000)
    order = np.argsort(late, kind="stable")
    dcm = DcmFilter()
    dcm.update_batch(FlatEvents(events.sensor_type[order], events.timestamp_ns[order], events.values[order]))
    assert error_deg(dcm, handled(20.0)) < 0.5
    assert dcm.state.gaps == 0

    shuffled = np.arange(len(events))
    shuffled[100:-100:50], shuffled[101:-99:50] = shuffled[101:-99:50].copy(), shuffled[100:-100:50].copy()
    dcm = DcmFilter()
    dcm.update_batch(FlatEvents(events.sensor_type[shuffled], events.timestamp_ns[shuffled], events.values[shuffled]))
    assert error_deg(dcm, handled(20.0)) < 0.5

    before = dcm.state.gaps
    dcm.clear_events()
    dcm.update(GYRO, int(events.timestamp_ns[-100]), 9.0, 9.0, 9.0)
    dcm.update(ACC, int(events.timestamp_ns[-100]), 9.0, 9.0, 9.0)
    dcm.update(MAG, int(events.timestamp_ns[-100]), 9.0, 9.0, 9.0)
    assert dcm.state.gaps == before + 3
    assert answer(dcm).status & FilterStatus.GAP
    assert error_deg(dcm, handled(20.0)) < 0.5


def test_a_lost_gyroscope_is_flagged_and_stood_in_for() -> None:
    def leaning(t: float) -> Float64Array:
        return rotation(0, 0, 0.1 * t) @ rotation(0.05 * t, 0, 0)

    events = without(sense(leaning, 30.0, FASTEST), GYRO, 5.0, 25.0)
    dcm = DcmFilter()
    dcm.update_batch(between(events, 0.0, 5.4))
    assert not answer(dcm).status & FilterStatus.GYRO_LOST
    assert answer(dcm).timestamp_ns == 4_995_000_000
    dcm.update_batch(between(events, 5.4, 5.6))
    assert answer(dcm).status & FilterStatus.GYRO_LOST
    assert answer(dcm).angular_rate == (0.0, 0.0, 0.0)
    dcm.update_batch(between(events, 5.6, 25.0))
    lost = answer(dcm)
    assert lost.status == FilterStatus.GYRO_LOST
    assert lost.timestamp_ns > 24_900_000_000
    assert lost.heading_accuracy > np.radians(3.0)
    assert error_deg(dcm, leaning(lost.timestamp_ns * 1e-9)) < 1.5
    dcm.update_batch(between(events, 25.0, 31.0))
    assert answer(dcm).status == FilterStatus.OK
    assert error_deg(dcm, leaning(30.0)) < 1.0


def test_without_any_gyroscope_the_filter_starts_after_half_a_second() -> None:
    dcm = DcmFilter()
    turned = rotation(0.3, -0.4, 1.0)
    dcm.update_batch(without(sense(lambda t: turned, 1.0, GAME), GYRO, 0.0, 9.0))
    assert answer(dcm).status == FilterStatus.GYRO_LOST
    assert error_deg(dcm, turned) < 1e-6


def test_a_source_that_stamps_every_sample_alike_fills_no_memory() -> None:
    dcm = DcmFilter()
    for _ in range(3000):
        dcm.update(ACC, 0, 0.0, 0.0, 9.8)
    assert dcm.state.held.count <= 1024
    assert dcm.state.gyro_lost
