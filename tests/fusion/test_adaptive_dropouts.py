"""The dropout suite: every fault of every sensor for ten seconds of one recording, and what it may do to the pose."""

from enum import Enum

import numpy as np
import pytest
from synthetic_phone import FASTEST, FIELD, NORMAL, FlatEvents, matrix, rotation, rotation_vector, sense

from posed.errors import InvalidArgumentError
from posed.events import FilterStatus, Float64Array, SensorType
from posed.fusion import make_filter
from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams

ACC, GYRO, MAG = SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD
FROM_S, UNTIL_S, END_S = 20.0, 30.0, 60.0
NONE = FilterStatus.OK
GAP, BAD = FilterStatus.GAP, FilterStatus.BAD_SAMPLE
FREE, ACC_LOST = FilterStatus.HEADING_FREE, FilterStatus.ACCELEROMETER_LOST
RANGES = {ACC: 7.0, GYRO: 0.35, MAG: 30.0}
"""What a saturated sensor stops at: in the middle of what it reads here."""


class Fault(Enum):
    """What a sensor does."""

    LOST = "no samples"
    SPIKED = "every 50th sample is ten times too large"
    STUCK = "the last value again and again"
    SATURATED = "values stop at the range"
    NOT_A_NUMBER = "every fifth sample is NaN"
    REORDERED = "every tenth sample comes after the next"
    DUPLICATED = "every sample comes twice"


def held_phone(t: float) -> Float64Array:
    """A phone in the hand, turned to and fro about all axes: never still, up to 1.3 rad/s."""
    return rotation(0, 0, 1.2 * np.sin(0.5 * t)) @ rotation(0.8 + 0.3 * np.sin(1.3 * t), 0.4 * np.sin(0.9 * t), 0)


def still_then_held(t: float) -> Float64Array:
    """The same after four seconds on a table."""
    return held_phone(max(t - 4.0, 0.0))


@pytest.fixture(scope="module")
def recording() -> FlatEvents:
    return sense(still_then_held, END_S, FASTEST, bias=(0.004, -0.003, 0.005), noise=np.random.default_rng(7))


def with_fault(events: FlatEvents, sensor: SensorType, fault: Fault) -> FlatEvents:
    kinds, times, values = events.sensor_type.copy(), events.timestamp_ns.copy(), events.values.copy()
    seconds = times * 1e-9
    rows = np.flatnonzero((kinds == sensor) & (seconds >= FROM_S) & (seconds < UNTIL_S))
    order = np.arange(len(kinds))
    if fault is Fault.LOST:
        order = np.delete(order, rows)
    elif fault is Fault.SPIKED:
        values[rows[::50]] *= 10.0
    elif fault is Fault.STUCK:
        values[rows] = values[rows[0]]
    elif fault is Fault.SATURATED:
        values[rows] = np.clip(values[rows], -RANGES[sensor], RANGES[sensor])
    elif fault is Fault.NOT_A_NUMBER:
        values[rows[::5], 1] = np.nan
    elif fault is Fault.REORDERED:
        first, second = rows[:-1:10], rows[1::10]
        order[first], order[second] = second, first
    else:
        order = np.sort(np.concatenate([order, rows]))
    return FlatEvents(kinds[order], times[order], values[order])


def run(events: FlatEvents) -> tuple[Float64Array, Float64Array, list[FilterStatus], AdaptiveFilter]:
    """Return times (s), errors (deg) and flags of poses at 10 Hz."""
    adaptive = AdaptiveFilter()
    edges = np.searchsorted(events.timestamp_ns, np.arange(0.1, END_S, 0.1) * 1e9)
    times, errors, flags = [], [], []
    fed = 0
    for edge in edges:
        adaptive.update_batch(events[fed : max(edge, fed)])
        fed = max(edge, fed)
        answer = adaptive.orientation()
        if answer is not None:
            truth = still_then_held(answer.timestamp_ns * 1e-9)
            times.append(answer.timestamp_ns * 1e-9)
            errors.append(np.degrees(np.linalg.norm(rotation_vector(truth.T @ matrix(answer.quaternion)))))
            flags.append(answer.status)
            adaptive.clear_events()
    return np.array(times), np.array(errors), flags, adaptive


# Degrees at most while the fault lasts, and what the poses say then: must be among the flags, and all that may be.
EXPECTED: dict[tuple[SensorType, Fault], tuple[float, FilterStatus, FilterStatus]] = {
    (ACC, Fault.LOST): (1.0, ACC_LOST, ACC_LOST),
    (ACC, Fault.SPIKED): (1.0, NONE, NONE),
    (ACC, Fault.STUCK): (1.0, BAD | ACC_LOST, BAD | ACC_LOST),
    (ACC, Fault.SATURATED): (2.0, NONE, NONE),
    (ACC, Fault.NOT_A_NUMBER): (1.0, BAD, BAD),
    (ACC, Fault.REORDERED): (1.0, NONE, GAP),
    (ACC, Fault.DUPLICATED): (1.0, GAP, GAP),
    # Alone, the accelerometer follows a hand that turns at 1 rad/s a tenth of a second late.
    (GYRO, Fault.LOST): (12.0, FilterStatus.GYRO_LOST, FilterStatus.GYRO_LOST),
    # Each spike turns the phone by a degree or two that it did not turn.
    (GYRO, Fault.SPIKED): (25.0, NONE, FilterStatus.MAGNETIC_DISTURBANCE),
    # For half a second the value could be true: a turn at a steady rate.
    (GYRO, Fault.STUCK): (20.0, FilterStatus.GYRO_LOST | BAD, FilterStatus.GYRO_LOST | BAD),
    # Of a range that nobody told the filter; see below for one that it knows.
    (GYRO, Fault.SATURATED): (30.0, NONE, FilterStatus.MAGNETIC_DISTURBANCE),
    (GYRO, Fault.NOT_A_NUMBER): (1.0, BAD, BAD),
    (GYRO, Fault.REORDERED): (1.0, GAP, GAP),
    (GYRO, Fault.DUPLICATED): (1.0, GAP, GAP),
    (MAG, Fault.LOST): (1.0, FREE, FREE),
    (MAG, Fault.SPIKED): (1.0, FilterStatus.MAGNETIC_DISTURBANCE, FilterStatus.MAGNETIC_DISTURBANCE),
    (MAG, Fault.STUCK): (1.0, BAD | FREE, BAD | FREE | FilterStatus.MAGNETIC_DISTURBANCE),
    (MAG, Fault.SATURATED): (1.0, FilterStatus.MAGNETIC_DISTURBANCE, FilterStatus.MAGNETIC_DISTURBANCE),
    (MAG, Fault.NOT_A_NUMBER): (1.0, BAD, BAD),
    (MAG, Fault.REORDERED): (1.0, NONE, GAP),
    (MAG, Fault.DUPLICATED): (1.0, GAP, GAP),
}
AFTER_DEG = 3.0
"""Five seconds after any fault."""


@pytest.mark.parametrize("fault", Fault)
@pytest.mark.parametrize("sensor", [ACC, GYRO, MAG])
def test_a_fault_is_bounded_flagged_and_left_behind(recording: FlatEvents, sensor: SensorType, fault: Fault) -> None:
    at_most, must, may = EXPECTED[sensor, fault]
    times, errors, flags, adaptive = run(with_fault(recording, sensor, fault))
    assert errors[(times > 6.0) & (times < FROM_S)].max() < 0.5
    during = (times >= FROM_S) & (times < UNTIL_S + 0.2)
    assert errors[during].max() < at_most
    assert errors[times > UNTIL_S + 5.0].max() < AFTER_DEG
    said = NONE
    for status, counts in zip(flags, during, strict=True):
        if counts:
            said |= status
    assert said & must == must
    assert said & ~may == NONE
    assert all(status == NONE for status, time in zip(flags, times, strict=True) if time > UNTIL_S + 5.0)
    answer = adaptive.orientation()
    assert answer is not None
    assert answer.heading_accuracy < np.radians(5.0)
    bias, _ = adaptive.gyro_bias()
    assert np.abs(np.degrees(np.subtract(bias, (0.004, -0.003, 0.005)))).max() < 0.2


def test_a_sensor_that_never_was_is_stood_in_for(recording: FlatEvents) -> None:
    """Without a magnetometer the heading is free but steady; without a gyroscope the rest follows, late."""
    for sensor, flag in ((MAG, FilterStatus.HEADING_FREE), (GYRO, FilterStatus.GYRO_LOST)):
        there = recording.sensor_type != sensor
        events = FlatEvents(recording.sensor_type[there], recording.timestamp_ns[there], recording.values[there])
        adaptive = AdaptiveFilter()
        adaptive.update_batch(events)
        answer = adaptive.orientation()
        assert answer is not None
        assert answer.status == flag
        truth = still_then_held(answer.timestamp_ns * 1e-9)
        found = matrix(answer.quaternion)
        assert np.degrees(np.arccos(min(1.0, float(found[2] @ truth[2])))) < (0.5 if sensor is MAG else 10.0)
        if sensor is MAG:
            assert answer.heading_accuracy == pytest.approx(np.pi / np.sqrt(3.0))
        else:
            assert answer.heading_accuracy > np.radians(5.0)
    without_acc = recording.sensor_type != ACC
    adaptive = AdaptiveFilter()
    adaptive.update_batch(
        FlatEvents(
            recording.sensor_type[without_acc], recording.timestamp_ns[without_acc], recording.values[without_acc]
        )
    )
    assert adaptive.orientation() is None


def test_a_known_range_flags_the_saturated_gyroscope_and_a_spike(recording: FlatEvents) -> None:
    values = recording.values.copy()
    gyro = recording.sensor_type == GYRO
    values[gyro] = np.clip(values[gyro], -RANGES[GYRO], RANGES[GYRO])
    adaptive = AdaptiveFilter(AdaptiveParams(gyro_range=RANGES[GYRO]))
    adaptive.update_batch(FlatEvents(recording.sensor_type, recording.timestamp_ns, values))
    answer = adaptive.orientation()
    assert answer is not None
    assert answer.status & BAD
    assert not answer.status & FilterStatus.GYRO_LOST
    assert adaptive.state.bad_samples == int((np.abs(values[gyro]).max(axis=1) >= 0.99 * RANGES[GYRO]).sum())
    spiked = AdaptiveFilter()
    spiked.update(GYRO, 0, 0.0, 0.0, 0.0)
    spiked.update(GYRO, 10_000_000, 0.0, 40.0, 0.0)
    assert spiked.state.bad_samples == 1
    assert spiked.state.gyro_ns == 0


@pytest.mark.parametrize("rates", [FASTEST, NORMAL])
def test_values_that_repeat_themselves_on_a_table_are_no_fault(rates: tuple[float, float, float]) -> None:
    """Noise below the last bit: the bias is learnt, as by dcm."""
    bias = (0.01, -0.02, 0.015)
    events = sense(lambda t: np.eye(3), 30.0, rates, bias=bias)
    adaptive, dcm = AdaptiveFilter(), make_filter("dcm")
    for each in (adaptive, dcm):
        each.update_batch(events)
        assert each.gyro_bias()[0] == pytest.approx(bias, abs=np.radians(0.05))
    answer = adaptive.orientation()
    assert answer is not None
    assert answer.status == FilterStatus.AT_REST
    assert adaptive.state.bad_samples == 0


def test_the_form_without_gyroscope_keeps_its_heading_on_a_constant_stream() -> None:
    turned = rotation(0.0, 0.0, 1.0)
    geomag = make_filter("geomag")
    geomag.update_batch(sense(lambda t: turned, 30.0, FASTEST))
    answer = geomag.orientation()
    assert answer is not None
    assert answer.status == FilterStatus.GYRO_LOST
    assert np.degrees(np.linalg.norm(rotation_vector(turned.T @ matrix(answer.quaternion)))) < 0.01


def test_a_wrong_stamp_ahead_is_a_bad_sample_and_two_are_a_gap(recording: FlatEvents) -> None:
    hour_ns = 3_600_000_000_000
    adaptive = AdaptiveFilter()
    adaptive.update_batch(recording[:5000])
    now = int(recording.timestamp_ns[4999])
    for sensor, row in ((ACC, 5000), (MAG, 5100)):
        adaptive.clear_events()
        before = adaptive.state.bad_samples
        adaptive.update(sensor, now + hour_ns, 1.0, 2.0, 9.0)
        adaptive.update_batch(recording[row : row + 100])
        assert adaptive.state.bad_samples == before + 1
        answer = adaptive.orientation()
        assert answer is not None
        assert answer.status == BAD
        assert adaptive.state.gaps == 0
    adaptive.clear_events()
    before = adaptive.state.bad_samples
    adaptive.update(ACC, now + hour_ns, 0.0, 0.0, 9.8)
    adaptive.update(ACC, now + hour_ns + 10_000_000, 0.0, 0.0, 9.8)
    assert adaptive.state.gaps > 0
    assert adaptive.state.bad_samples == before
    assert adaptive.state.time_ns == now + hour_ns + 10_000_000


def test_after_a_gap_north_waits_for_a_field_that_is_believed(recording: FlatEvents) -> None:
    magnet = np.array([80.0, 0.0, 0.0])
    lying = sense(lambda t: np.eye(3), 10.0, FASTEST)
    beside = sense(lambda t: np.eye(3), 5.0, FASTEST, start_ns=11_000_000_000, field=lambda t: FIELD + magnet)
    after = sense(lambda t: np.eye(3), 5.0, FASTEST, start_ns=16_100_000_000)
    adaptive = AdaptiveFilter()
    adaptive.update_batch(lying)
    adaptive.update_batch(beside)
    answer = adaptive.orientation()
    assert answer is not None
    assert answer.status & FilterStatus.INITIALISING
    assert answer.status & FilterStatus.MAGNETIC_DISTURBANCE
    assert answer.heading_accuracy == pytest.approx(np.pi / np.sqrt(3.0))
    adaptive.update_batch(after)
    answer = adaptive.orientation()
    assert answer is not None
    assert not answer.status & (FilterStatus.INITIALISING | FilterStatus.MAGNETIC_DISTURBANCE)
    assert np.degrees(np.linalg.norm(rotation_vector(matrix(answer.quaternion)))) < 0.5


@pytest.mark.parametrize("value", [-0.001, 0.2, float("nan"), float("inf")])
def test_delays_and_ranges_without_meaning_are_refused(value: float) -> None:
    for name in ("gyro_delay_s", "acc_delay_s", "mag_delay_s"):
        with pytest.raises(InvalidArgumentError, match=name):
            AdaptiveParams(**{name: value})
    with pytest.raises(InvalidArgumentError, match="gyro_range"):
        AdaptiveParams(gyro_range=-abs(value))
