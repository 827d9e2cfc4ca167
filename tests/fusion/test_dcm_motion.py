"""Motion and rest: exact increments, the covering gyroscope sample, the bias, the noise of a still phone."""

import numpy as np
import pytest
from synthetic_phone import FASTEST, GAME, NORMAL, Attitude, FlatEvents, error_deg, rotation, sense, without

from posed.events import FilterStatus, Float64Array, SensorType
from posed.fusion.dcm import DcmFilter, DcmParams
from posed.fusion.rest import RestParams

LYING: Attitude = lambda t: np.eye(3)  # noqa: E731


def test_a_constant_turn_at_5_hz_is_integrated_exactly() -> None:
    spin = np.array([0.8, -1.7, 1.1])
    start = rotation(0.4, 0.2, -1.0)
    events = sense(lambda t: start @ rotation(*(spin * t)), 60.0, NORMAL)
    only_gyro = (events.sensor_type == SensorType.GYROSCOPE) | (events.timestamp_ns == 0)
    dcm = DcmFilter()
    dcm.update_batch(
        FlatEvents(events.sensor_type[only_gyro], events.timestamp_ns[only_gyro], events.values[only_gyro])
    )
    assert error_deg(dcm, start @ rotation(*(spin * 60.0))) < 1e-9


def test_measurements_between_slow_gyroscope_samples_act_at_their_own_time() -> None:
    spin = np.array([1.0, -2.0, 0.5])
    dcm = DcmFilter()
    events = sense(lambda t: rotation(*(spin * t)), 30.0, NORMAL)
    dcm.update_batch(events)
    answer = dcm.orientation()
    assert answer is not None
    assert answer.timestamp_ns == 30_000_000_000
    assert error_deg(dcm, rotation(*(spin * 30.0))) < 1e-6
    assert answer.angular_rate == pytest.approx(tuple(spin))


@pytest.mark.parametrize("rates", [FASTEST, GAME, (15.0, 15.0, 15.0), NORMAL])
def test_the_bias_is_learnt_at_rest(rates: tuple[float, float, float]) -> None:
    bias = (0.005, -0.004, 0.003)
    dcm = DcmFilter()
    dcm.update_batch(sense(LYING, 60.0, rates, bias=bias, noise=np.random.default_rng(1)))
    rest = dcm.state.rest
    assert (rest.bias_x, rest.bias_y, rest.bias_z) == pytest.approx(bias, abs=np.radians(0.02))
    answer = dcm.orientation()
    assert answer is not None
    assert answer.status == FilterStatus.AT_REST


def test_the_bias_is_left_alone_when_switched_off_and_in_motion() -> None:
    events = sense(LYING, 20.0, GAME, bias=(0.005, 0.0, 0.0))
    off = DcmFilter(DcmParams(rest=RestParams(learn_bias=False)))
    off.update_batch(events)
    assert off.state.rest.at_rest
    assert off.state.rest.bias_x == 0.0

    waving = DcmFilter()
    waving.update_batch(sense(lambda t: rotation(0, 0.3 * np.sin(3.0 * t), 0), 20.0, GAME, bias=(0.005, 0.0, 0.0)))
    assert not waving.state.rest.at_rest
    assert waving.state.rest.bias_x == 0.0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_still_phone_holds_still_for_five_minutes(seed: int) -> None:
    bias = (np.radians(0.2), np.radians(-0.1), np.radians(0.3))
    events = sense(LYING, 300.0, bias=bias, noise=np.random.default_rng(seed))
    dcm = DcmFilter()
    angles = []
    for k in range(0, len(events), 35):
        dcm.update_batch(events[k : k + 35])
        c = dcm.state.matrix
        angles.append((np.arctan2(c.up_y, c.up_z), -np.arcsin(c.up_x), np.arctan2(c.north_x, c.north_y)))
    roll, pitch, heading = np.degrees(np.std(angles, axis=0))
    assert roll <= 0.02
    assert pitch <= 0.02
    assert heading <= 0.3


def test_linear_acceleration_that_cancels_leaves_little_tilt() -> None:
    events = sense(LYING, 60.0, GAME)
    shaken = events.values.copy()
    acc = events.sensor_type == SensorType.ACCELEROMETER
    shaken[acc, 0] += 3.0 * np.sin(2 * np.pi * 2.0 * events.timestamp_ns[acc] * 1e-9)
    dcm = DcmFilter()
    dcm.update_batch(FlatEvents(events.sensor_type, events.timestamp_ns, shaken))
    assert error_deg(dcm, np.eye(3)) < 1.0


@pytest.mark.parametrize("acc_hz", [100.0, 50.0, 15.0])
def test_the_time_constant_does_not_depend_on_the_rate(acc_hz: float) -> None:
    """Of a lean of 10 degrees that nobody measured, 3 s leave about exp(-1), at any accelerometer rate."""
    lean = rotation(np.radians(10.0), 0, 0)

    def shaken(turn: Float64Array, seconds: float, start_ns: int) -> FlatEvents:
        """The gyroscope shakes and means nothing by it, so the noise is that of motion."""
        events = sense(lambda t: turn, seconds, (acc_hz, 50.0, 50.0), start_ns=start_ns)
        gyro = np.flatnonzero(events.sensor_type == SensorType.GYROSCOPE)
        events.values[gyro, 2] += 0.2 * (-1.0) ** np.arange(len(gyro))
        return events

    dcm = DcmFilter()
    dcm.update_batch(shaken(np.eye(3), 20.0, 0))
    dcm.update_batch(shaken(lean, 3.0, 20_020_000_000))
    assert error_deg(dcm, lean) == pytest.approx(3.7, abs=0.4)


def test_the_first_orientation_needs_gravity_and_north() -> None:
    for missing in (SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD):
        dcm = DcmFilter()
        dcm.update_batch(without(sense(LYING, 2.0, GAME), missing, 0.0, 9.0))
        assert dcm.orientation() is None


def test_other_sensors_are_ignored() -> None:
    dcm = DcmFilter()
    dcm.update_batch(sense(LYING, 1.0, GAME))
    before = dcm.save()
    dcm.update(SensorType.GRAVITY, 5_000_000_000, 1.0, 2.0, 3.0)
    assert dcm.save() == before
