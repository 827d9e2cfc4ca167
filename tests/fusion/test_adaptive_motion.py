"""What the filter makes of motion, fields, rates and missing sensors of which everything is known."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from synthetic_phone import (
    FASTEST,
    FIELD,
    GAME,
    NORMAL,
    Attitude,
    FlatEvents,
    between,
    matrix,
    rotation,
    rotation_vector,
    sense,
    without,
)

from posed.errors import InvalidArgumentError
from posed.events import FilterStatus, Float64Array, Orientation, SensorType
from posed.fusion import make_filter
from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams
from posed.fusion.adaptive_interval import GyroInterval, IntervalParams, IntervalState

ACC, GYRO, MAG = SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD
UI = (15.0, 15.0, 15.0)
UNDELAYED = AdaptiveParams(gyro_delay_s=0.0, acc_delay_s=0.0, mag_delay_s=0.0)
LYING: Attitude = lambda t: np.eye(3)  # noqa: E731
MAGNET = np.array([60.0, 0.0, 0.0])


def handled(t: float) -> Float64Array:
    """A phone in the hand: never still, never far from portrait."""
    return rotation(0, 0, 0.8 * np.sin(0.5 * t)) @ rotation(0.6 + 0.3 * np.sin(1.3 * t), 0.2 * np.sin(0.9 * t), 0)


def tumbled(t: float) -> Float64Array:
    """A phone turned over and over about changing axes, up to 2 rad/s: through every attitude."""
    return rotation(0, 0, 1.1 * np.sin(0.7 * t)) @ rotation(1.5 * np.sin(0.9 * t), 0, 0) @ rotation(0, 0.6 * t, 0)


def answer(adaptive: AdaptiveFilter) -> Orientation:
    orientation = adaptive.orientation()
    assert orientation is not None
    return orientation


def error_deg(adaptive: AdaptiveFilter, attitude: Attitude) -> float:
    """Return the angle between the filter's orientation and the truth at its time."""
    orientation = answer(adaptive)
    truth = attitude(orientation.timestamp_ns * 1e-9)
    return float(np.degrees(np.linalg.norm(rotation_vector(truth.T @ matrix(orientation.quaternion)))))


def rms_deg(adaptive: AdaptiveFilter, events: FlatEvents, attitude: Attitude, from_s: float) -> float:
    """Return the RMS error right after each gyroscope sample from a time on."""
    errors = []
    fed = 0
    for row in np.flatnonzero(events.sensor_type == GYRO) + 1:
        adaptive.update_batch(events[fed:row])
        fed = row
        if events.timestamp_ns[row - 1] >= from_s * 1e9:
            errors.append(error_deg(adaptive, attitude))
    return float(np.sqrt(np.mean(np.square(errors))))


def test_the_first_pose_waits_for_gravity_and_north() -> None:
    turned = rotation(0.3, -0.4, 2.0)
    events = list(sense(lambda t: turned, 0.3, FASTEST))
    adaptive = AdaptiveFilter()
    adaptive.update_batch(event for event in events if event[0] != MAG)
    assert adaptive.orientation() is None
    adaptive = AdaptiveFilter()
    adaptive.update_batch(event for event in events if event[0] != ACC)
    assert adaptive.orientation() is None
    adaptive = AdaptiveFilter()
    adaptive.update_batch(events[:7])
    assert error_deg(adaptive, lambda t: turned) < 1e-6
    assert answer(adaptive).status == FilterStatus.OK


def mean_rates(events: FlatEvents, attitude: Attitude) -> FlatEvents:
    """Return the events with each gyroscope value the plain mean of the rate over its interval, as a chip forms it."""
    values = events.values.copy()
    rows = np.flatnonzero(events.sensor_type == GYRO)
    for before, row in pairwise(rows):
        times = np.linspace(events.timestamp_ns[before] * 1e-9, events.timestamp_ns[row] * 1e-9, 17)
        turns = [rotation_vector(attitude(a).T @ attitude(b)) for a, b in pairwise(times)]
        values[row] = np.sum(turns, axis=0) / (times[-1] - times[0])
    return FlatEvents(events.sensor_type, events.timestamp_ns, values)


@pytest.mark.parametrize(("rates", "at_most"), [(UI, 0.3), (NORMAL, 6.0)])
def test_perfect_sensors_give_a_near_perfect_pose_at_every_rate(
    rates: tuple[float, float, float], at_most: float
) -> None:
    events = mean_rates(sense(tumbled, 15.0, rates), tumbled)
    assert rms_deg(AdaptiveFilter(UNDELAYED), events, tumbled, 5.0) < at_most


def test_the_slope_within_an_interval_is_what_makes_slow_rates_work() -> None:
    events = mean_rates(sense(tumbled, 15.0, UI), tumbled)
    flat = replace(UNDELAYED, interval=IntervalParams(slope=False))
    with_slope = rms_deg(AdaptiveFilter(UNDELAYED), events, tumbled, 5.0)
    assert rms_deg(AdaptiveFilter(flat), events, tumbled, 5.0) > 5.0 * with_slope


def test_sensor_delays_are_made_good() -> None:
    """What the sensors say 3, 6 and 8 ms late stands for the time it was felt at."""
    params = AdaptiveParams()
    events = sense(handled, 12.0, FASTEST)
    delays_ns = {ACC: params.acc_delay_s, GYRO: params.gyro_delay_s, MAG: params.mag_delay_s}
    late = events.timestamp_ns + np.array([round(1e9 * delays_ns[SensorType(k)]) for k in events.sensor_type])
    order = np.argsort(late, kind="stable")
    delayed = FlatEvents(events.sensor_type[order], late[order], events.values[order])
    made_good = rms_deg(AdaptiveFilter(), delayed, handled, 5.0)
    assert made_good < 0.02
    assert rms_deg(AdaptiveFilter(UNDELAYED), delayed, handled, 5.0) > 3.0 * made_good


def test_a_start_while_moving_settles() -> None:
    def pushed(t: float) -> Float64Array:
        return np.array([2.0 * np.sin(3.0 * t), 1.5 * np.cos(4.0 * t), 1.0 * np.sin(2.0 * t)])

    events = sense(handled, 40.0, GAME, bias=(0.01, -0.01, 0.01), noise=np.random.default_rng(1))
    values = events.values.copy()
    for row in np.flatnonzero(events.sensor_type == ACC):
        t = events.timestamp_ns[row] * 1e-9
        values[row] += handled(t).T @ pushed(t)
    moving = FlatEvents(events.sensor_type, events.timestamp_ns, values)
    assert rms_deg(AdaptiveFilter(), moving, handled, 10.0) < 4.0


def test_the_bias_is_learnt_at_rest_and_its_deviation_says_how_well() -> None:
    bias = (0.02, -0.01, 0.015)
    adaptive = AdaptiveFilter()
    before = adaptive.gyro_bias()[1]
    adaptive.update_batch(sense(LYING, 20.0, FASTEST, bias=bias, noise=np.random.default_rng(2)))
    found, std = adaptive.gyro_bias()
    assert answer(adaptive).status == FilterStatus.AT_REST
    assert np.abs(np.subtract(found, bias)).max() < np.radians(0.03)
    assert max(std) < 0.1 * min(before)
    assert answer(adaptive).angular_rate == pytest.approx((0.0, 0.0, 0.0), abs=np.radians(1.0))


def test_the_bias_is_learnt_in_motion() -> None:
    bias = (0.01, -0.008, 0.012)
    adaptive = AdaptiveFilter()
    adaptive.update_batch(sense(tumbled, 120.0, GAME, bias=bias, noise=np.random.default_rng(3)))
    found, std = adaptive.gyro_bias()
    assert not adaptive.state.rest.at_rest
    for value, truth, sigma in zip(found, bias, std, strict=True):
        assert abs(value - truth) < 3.0 * sigma
        assert sigma < np.radians(0.25)


def test_a_magnet_that_passes_is_gated_flagged_and_left_behind() -> None:
    events = sense(handled, 60.0, field=lambda t: FIELD + MAGNET * (20.0 <= t < 40.0), noise=np.random.default_rng(4))
    adaptive = AdaptiveFilter()
    adaptive.update_batch(between(events, 0.0, 20.0))
    calm = answer(adaptive)
    assert not calm.status & FilterStatus.MAGNETIC_DISTURBANCE
    adaptive.update_batch(between(events, 20.0, 39.0))
    disturbed = answer(adaptive)
    assert disturbed.status & FilterStatus.MAGNETIC_DISTURBANCE
    assert disturbed.heading_accuracy > calm.heading_accuracy
    assert error_deg(adaptive, handled) < 3.0
    adaptive.update_batch(between(events, 39.0, 61.0))
    assert answer(adaptive).status == FilterStatus.OK
    assert error_deg(adaptive, handled) < 2.0


@pytest.mark.parametrize(("attitude", "within_s"), [(handled, 80.0), (LYING, 240.0)])
def test_a_wrong_first_reference_does_not_lock_the_heading(attitude: Attitude, within_s: float) -> None:
    """Started beside a magnet that is then gone: in motion the true field is taken up, at rest patience ends it."""
    events = sense(attitude, within_s, GAME, field=lambda t: FIELD + MAGNET * (t < 5.0))
    adaptive = AdaptiveFilter()
    adaptive.update_batch(between(events, 0.0, 10.0))
    assert answer(adaptive).status & FilterStatus.MAGNETIC_DISTURBANCE
    adaptive.update_batch(between(events, 10.0, within_s + 1.0))
    assert error_deg(adaptive, attitude) < 8.0


def test_a_magnet_stuck_to_the_phone_is_learnt_from_turning_it() -> None:
    iron = np.array([8.0, -6.0, 7.0])
    clean = sense(tumbled, 90.0, GAME, noise=np.random.default_rng(5))
    values = clean.values + iron * (clean.sensor_type == MAG)[:, None]
    events = FlatEvents(clean.sensor_type, clean.timestamp_ns, values)
    adaptive = AdaptiveFilter()
    adaptive.update_batch(events)
    b = adaptive.state.iron.estimate
    assert (b.x, b.y, b.z) == pytest.approx(iron, abs=1.5)
    assert adaptive.state.iron.use > 0.8
    assert error_deg(adaptive, tumbled) < 3.0


def test_the_game_form_takes_no_magnetometer() -> None:
    events = sense(handled, 30.0, GAME, field=lambda t: FIELD + 3.0 * MAGNET * (t > 10.0))
    game = make_filter("game")
    game.update_batch(events)
    blind = make_filter("game")
    blind.update_batch(without(events, MAG, 0.0, 99.0))
    one, other = game.orientation(), blind.orientation()
    assert one is not None
    assert one == other
    assert one.status == FilterStatus.HEADING_FREE
    start = make_filter("game")
    start.update_batch(between(events, 0.0, 0.1))
    first = start.orientation()
    assert first is not None
    # Its own north, kept: the turn since the start is that of the phone.
    its_north = matrix(first.quaternion) @ handled(first.timestamp_ns * 1e-9).T
    truth = its_north @ handled(one.timestamp_ns * 1e-9)
    assert np.degrees(np.linalg.norm(rotation_vector(matrix(one.quaternion).T @ truth))) < 2.5


def test_the_geomag_form_takes_no_gyroscope() -> None:
    def leaning(t: float) -> Float64Array:
        return rotation(0, 0, 0.1 * t) @ rotation(0.02 * t, 0, 0)

    events = sense(leaning, 20.0, GAME)
    geomag = make_filter("geomag")
    geomag.update_batch(events)
    assert isinstance(geomag, AdaptiveFilter)
    assert answer(geomag).status == FilterStatus.GYRO_LOST
    assert answer(geomag).timestamp_ns == events.timestamp_ns[-1]
    assert error_deg(geomag, leaning) < 2.0


def test_a_gap_of_all_sensors_starts_anew_and_is_flagged() -> None:
    turned = rotation(0.5, 1.2, 2.0)
    after = sense(lambda t: turned, 4.0, FASTEST, start_ns=65_000_000_000)
    adaptive = AdaptiveFilter()
    adaptive.update_batch(sense(LYING, 5.0, FASTEST))
    adaptive.clear_events()
    gyro = np.flatnonzero(after.sensor_type == GYRO)[0]
    adaptive.update(GYRO, int(after.timestamp_ns[gyro]), 0.0, 0.0, 0.0)
    first = answer(adaptive)
    assert first.status & FilterStatus.GAP
    assert first.status & FilterStatus.INITIALISING
    assert first.heading_accuracy == pytest.approx(np.pi / np.sqrt(3))
    adaptive.update_batch(after)
    assert error_deg(adaptive, lambda t: turned) < 1e-6
    assert not answer(adaptive).status & FilterStatus.INITIALISING


def test_free_fall_is_flagged_and_bridged() -> None:
    events = sense(handled, 20.0, GAME)
    falling = (events.sensor_type == ACC) & (events.timestamp_ns > 10e9) & (events.timestamp_ns < 11e9)
    values = np.where(falling[:, None], 0.1, events.values)
    weightless = FlatEvents(events.sensor_type, events.timestamp_ns, values)
    adaptive = AdaptiveFilter()
    adaptive.update_batch(between(weightless, 0.0, 10.9))
    assert answer(adaptive).status & FilterStatus.FREE_FALL
    adaptive.update_batch(between(weightless, 10.9, 21.0))
    assert answer(adaptive).status == FilterStatus.OK
    assert error_deg(adaptive, handled) < 0.5


def test_a_source_that_stamps_every_sample_alike_fills_no_memory() -> None:
    adaptive = AdaptiveFilter()
    for _ in range(3000):
        adaptive.update(ACC, 0, 0.0, 0.0, 9.8)
    assert adaptive.state.held.count <= 1024
    assert adaptive.state.gyro_lost


@pytest.mark.parametrize("part", ["interval", "tilt", "bias", "rest", "earth", "iron", "heading"])
def test_parameters_without_meaning_are_refused(part: str) -> None:
    params = getattr(AdaptiveParams(), part)
    for name in params.__dataclass_fields__:
        if isinstance(getattr(params, name), float):
            with pytest.raises(InvalidArgumentError, match=name):
                replace(params, **{name: 0.0})


def test_before_an_interval_the_rate_is_what_the_interval_begins_with() -> None:
    """A measurement that came ten intervals late: a slope of 100 rad/s2 carried back would turn it by a radian."""
    interval = GyroInterval(IntervalParams(), IntervalState())
    interval.begin(1.0, 0.0, 0.0)
    interval.push(2.0, 0.0, 0.0, 0.01)
    interval.push(3.0, 0.0, 0.0, 0.01)
    interval.close(4.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.0)
    interval.turn(1.0)
    assert (interval.x, interval.y, interval.z) == pytest.approx((0.03, 0.0, 0.0))
    interval.turn(0.5)
    assert interval.x == pytest.approx(0.005 * 2.75)
    interval.turn(-10.0)
    assert (interval.x, interval.y, interval.z) == pytest.approx((-0.1 * 2.5, 0.0, 0.0))
