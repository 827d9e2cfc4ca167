"""The simulated phone: a sensor source like any other, whose samples have exact physics and stated errors."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posed.clock import TimeMap, VirtualClock
from posed.errors import InvalidArgumentError
from posed.events import EventColumn, Float64Array, RateMode, SensorType
from posed.fusion import SensorErrors, make_filter
from posed.hal import open_source, rotation
from posed.hal.calibration import Calibration
from posed.hal.motion import Target, make_script
from posed.hal.profile import DeviceProfile, ResidualErrors, load_profile
from posed.hal.sensor_model import _RandomWalk
from posed.hal.simulated import SimulatedPhone
from posed.hal.source import SensorSource

ACCELEROMETER, MAGNETIC_FIELD, GYROSCOPE = 1, 2, 4
THREE = (ACCELEROMETER, MAGNETIC_FIELD, GYROSCOPE)
SIX = (*THREE, 14, 16, 35)
SECOND = 1_000_000_000
START = 5_000 * SECOND
TABLET = load_profile("patonis2018")
FINEST = 5e-5
"""Above half of the finest step there is, 2**-26 of a part's range: that of its magnetometer, 4912 uT."""


def changed(profile: DeviceProfile, **changes: object) -> DeviceProfile:
    """Return the profile with fields of all its parts replaced."""
    sensors = {kind: dataclasses.replace(part, **changes) for kind, part in profile.sensors.items()}  # type: ignore[arg-type]
    return dataclasses.replace(profile, sensors=sensors)


def ideal(profile: DeviceProfile = TABLET) -> DeviceProfile:
    """Return the profile of a phone without errors."""
    return changed(
        profile,
        noise_density=0.0,
        bias_walk=0.0,
        timestamp_jitter_s=0.0,
        delay_s=0.0,
        resolution=1e-13,
        residual=ResidualErrors(),
    )


def phone(
    profile: DeviceProfile = TABLET,
    script: str = "look-around",
    *,
    seed: int = 1,
    handles: tuple[int, ...] = THREE,
    period_us: int = 0,
) -> tuple[SimulatedPhone, VirtualClock]:
    """Return a phone whose `handles` are active, and its clock, which stands at START."""
    clock = VirtualClock(START)
    source = SimulatedPhone(profile, clock, make_script(script, seed), seed)
    for handle in handles:
        source.batch(handle, period_us * 1000, 0)
        source.activate(handle, True)
    return source, clock


def drained(source: SensorSource, seconds: float, handle: int) -> EventColumn:
    return source.drain(START + round(seconds * SECOND)).columns[handle]


def assert_same(left: EventColumn, right: EventColumn) -> None:
    np.testing.assert_array_equal(left.timestamp_ns, right.timestamp_ns)
    np.testing.assert_array_equal(left.values, right.values)
    np.testing.assert_array_equal(left.accuracy, right.accuracy)


class TestSource:
    """What every sensor source promises."""

    def test_is_a_sensor_source_on_boot_time(self) -> None:
        source: SensorSource = phone()[0]
        assert [sensor.handle for sensor in source.sensors] == [1, 2, 4, 5, 6, 8, 14, 16, 35]
        assert source.time_map == TimeMap()
        assert source.end_ns is None

    @pytest.mark.parametrize(
        ("mode", "events"), [(RateMode.NORMAL, 25), (RateMode.UI, 45), (RateMode.GAME, 150), (RateMode.FASTEST, 350)]
    )
    def test_events_a_second_are_those_of_table_2(self, mode: RateMode, events: int) -> None:
        source, _ = phone(changed(TABLET, timestamp_jitter_s=0.0), period_us=mode.sampling_period_us)
        assert len(source.drain(START + 60 * SECOND)) == 60 * events

    def test_spacing_of_15_hz_does_not_drift(self) -> None:
        source, _ = phone(ideal(), "still", handles=(ACCELEROMETER,), period_us=66_667)
        stamps = drained(source, 3600, ACCELEROMETER).timestamp_ns
        assert (stamps == [START + k * SECOND // 15 for k in range(1, 54_001)]).all()

    def test_stamps_ascend_and_vary_as_the_profile_says(self) -> None:
        jittery = changed(TABLET, timestamp_jitter_s=3e-4)
        gaps = np.diff(drained(phone(jittery)[0], 60, ACCELEROMETER).timestamp_ns)
        assert gaps.min() > 0
        assert gaps.std() == pytest.approx(math.sqrt(2) * 3e5, rel=0.1)
        wild = changed(TABLET, timestamp_jitter_s=1.0)
        assert np.diff(drained(phone(wild)[0], 60, GYROSCOPE).timestamp_ns).min() > 0

    @settings(max_examples=25)
    @given(
        cuts=st.lists(st.integers(0, 6 * SECOND), max_size=12),
        periods_us=st.lists(st.sampled_from([0, 5_000, 20_000, 66_667, 200_000]), min_size=6, max_size=6),
    )
    def test_samples_do_not_depend_on_how_often_they_are_drained(self, cuts: list[int], periods_us: list[int]) -> None:
        whole, _ = phone(handles=())
        parts, _ = phone(handles=())
        for handle, period_us in zip(SIX, periods_us, strict=True):
            for source in (whole, parts):
                source.batch(handle, period_us * 1000, 0)
                source.activate(handle, True)
        expected = whole.drain(START + 6 * SECOND).columns
        pieces = [parts.drain(START + cut).columns for cut in [*cuts, 6 * SECOND]]
        assert set(expected) == set(SIX)
        for handle in SIX:
            columns = [piece[handle] for piece in pieces if handle in piece]
            assert all(len(column) for column in columns)
            joined = EventColumn(
                np.concatenate([column.timestamp_ns for column in columns]),
                np.concatenate([column.values for column in columns]),
                np.concatenate([column.accuracy for column in columns]),
            )
            assert_same(joined, expected[handle])

    def test_a_sample_a_drain_gives_what_one_drain_gives(self) -> None:
        source, _ = phone(handles=(GYROSCOPE,))
        expected = drained(phone(handles=(GYROSCOPE,))[0], 3, GYROSCOPE)
        for stamp, values in zip(expected.timestamp_ns.tolist(), expected.values, strict=True):
            assert source.next_sample_ns(GYROSCOPE) == stamp
            assert not source.drain(stamp - 1).columns
            column = source.drain(stamp).columns[GYROSCOPE]
            assert column.timestamp_ns.tolist() == [stamp]
            np.testing.assert_array_equal(column.values[0], values)

    def test_same_seed_same_samples_other_seed_others(self) -> None:
        for handle in THREE:
            first, again = (drained(phone(seed=9)[0], 5, handle) for _ in range(2))
            assert_same(first, again)
            other = drained(phone(seed=10)[0], 5, handle)
            assert (first.values[: len(other)] != other.values[: len(first)]).any()

    def test_one_sensor_does_not_change_another(self) -> None:
        alone = drained(phone(handles=(GYROSCOPE,))[0], 5, GYROSCOPE)
        assert_same(drained(phone(handles=SIX)[0], 5, GYROSCOPE), alone)

    def test_only_active_sensors_have_columns(self) -> None:
        source, _ = phone(handles=(ACCELEROMETER, 16))
        assert set(source.drain(START + SECOND).columns) == {ACCELEROMETER, 16}
        assert source.next_sample_ns(GYROSCOPE) is None

    def test_all_samples_are_of_high_accuracy(self) -> None:
        assert set(drained(phone()[0], 5, GYROSCOPE).accuracy.tolist()) == {3}

    def test_rate_change_takes_effect_from_the_last_drain(self) -> None:
        source, _ = phone(changed(TABLET, timestamp_jitter_s=0.0), handles=(GYROSCOPE,), period_us=200_000)
        assert len(drained(source, 1.1, GYROSCOPE)) == 5
        assert source.batch(GYROSCOPE, 0, 0) == 5_000_000
        assert source.next_sample_ns(GYROSCOPE) == START + 1_105_000_000
        fast = drained(source, 2, GYROSCOPE)
        np.testing.assert_array_equal(fast.timestamp_ns, START + 5_000_000 * np.arange(221, 401))
        source.batch(GYROSCOPE, 200_000_000, 0)
        assert drained(source, 3, GYROSCOPE).timestamp_ns.tolist() == [
            START + k * SECOND // 5 for k in (11, 12, 13, 14, 15)
        ]

    def test_no_rotation_is_lost_or_told_twice_when_the_rate_changes(self) -> None:
        source, _ = phone(ideal(), "pan", handles=(GYROSCOPE,))
        found = []
        for at_s, period_us in ((3.013, 200_000), (3.4, 0), (4.031, 66_667), (4.033, 20_000), (6.13, 0), (7.0, 0)):
            found.append(source.drain(START + round(at_s * SECOND)).columns.get(GYROSCOPE))
            source.batch(GYROSCOPE, period_us * 1000, 0)
        column = EventColumn.concatenate([each for each in found if each is not None])
        first, last = int(column.timestamp_ns[0]), int(column.timestamp_ns[-1])
        turns = rotation.from_rotation_vector(column.values[1:] * np.diff(column.timestamp_ns)[:, np.newaxis] / 1e9)
        attitude = np.array([source.truth(first).quaternion])
        for turn in turns:
            attitude = rotation.multiply(attitude, turn[np.newaxis])
        assert abs(float(attitude[0] @ source.truth(last).quaternion)) == pytest.approx(1.0, abs=1e-10)

    def test_what_a_suspend_missed_is_left_out(self) -> None:
        source, clock = phone(handles=(GYROSCOPE,))
        source.drain(START + SECOND)
        clock.advance_to(START + 3600 * SECOND)
        source.resume()
        stamps = source.drain(START + 3601 * SECOND).columns[GYROSCOPE].timestamp_ns
        assert len(stamps) == pytest.approx(200, abs=1)
        assert stamps[0] > START + 3600 * SECOND

    def test_what_is_prepared_is_what_would_have_come(self) -> None:
        prepared, plain = phone(handles=SIX)[0], phone(handles=SIX)[0]
        for tenths in range(1, 40):
            prepared.prepare()
            until_ns = START + tenths * SECOND // 10
            for source in (prepared, plain):
                if tenths == 14:
                    source.batch(GYROSCOPE, 20_000_000, 0)
            columns, expected = prepared.drain(until_ns).columns, plain.drain(until_ns).columns
            assert columns.keys() == expected.keys()
            for handle, column in expected.items():
                assert_same(columns[handle], column)

    def test_batch_to_the_same_rate_leaves_the_stream_alone(self) -> None:
        source, _ = phone(handles=(GYROSCOPE,))
        before = drained(source, 1, GYROSCOPE).timestamp_ns[-1]
        assert source.batch(GYROSCOPE, 1, 10**9) == 5_000_000
        assert drained(source, 2, GYROSCOPE).timestamp_ns[0] > before

    def test_a_rate_change_before_the_first_drain_keeps_to_the_activation(self) -> None:
        source, clock = phone(handles=())
        clock.advance_to(START + SECOND)
        source.activate(ACCELEROMETER, True)
        clock.advance_to(START + 3 * SECOND // 2)
        source.activate(GYROSCOPE, True)
        source.batch(GYROSCOPE, 20_000_000, 0)
        assert drained(source, 2, GYROSCOPE).timestamp_ns[0] > START + 3 * SECOND // 2

    def test_activation_is_idempotent(self) -> None:
        source, _ = phone()
        source.drain(START + SECOND)
        source.activate(GYROSCOPE, True)
        assert len(drained(source, 2, GYROSCOPE)) == pytest.approx(200, abs=1)
        source.activate(GYROSCOPE, False)
        source.activate(GYROSCOPE, False)
        assert GYROSCOPE not in source.drain(START + 3 * SECOND).columns

    def test_no_stale_sample_after_reactivation_and_time_goes_on(self) -> None:
        source, clock = phone(handles=(GYROSCOPE,))
        source.drain(START + SECOND)
        clock.advance_to(START + 2 * SECOND)
        source.activate(GYROSCOPE, False)
        clock.advance_to(START + 10 * SECOND)
        source.activate(GYROSCOPE, True)
        again = drained(source, 12, GYROSCOPE)
        assert again.timestamp_ns[0] > START + 10 * SECOND
        never_off = drained(phone(handles=(GYROSCOPE,))[0], 12, GYROSCOPE)
        assert_same(again, never_off[-len(again) :])

    @pytest.mark.parametrize("seed", range(6))
    @pytest.mark.parametrize("periods", [1, 255, 256, 257, 512, 700])
    def test_a_sensor_activated_on_its_grid_misses_nothing_later(self, periods: int, seed: int) -> None:
        whole = drained(phone(handles=(GYROSCOPE,), seed=seed)[0], 5, GYROSCOPE)
        source, clock = phone(handles=(ACCELEROMETER,), seed=seed)
        now_ns = START + periods * SECOND // 200
        clock.advance_to(now_ns)
        source.activate(GYROSCOPE, True)
        assert_same(drained(source, 5, GYROSCOPE), whole[int(np.searchsorted(whole.timestamp_ns, now_ns, "right")) :])

    @pytest.mark.parametrize("seed", range(6))
    def test_no_stale_sample_where_jitter_has_a_block_begin_too_early(self, seed: int) -> None:
        shaky = changed(TABLET, timestamp_jitter_s=0.002)
        whole = drained(phone(shaky, handles=(GYROSCOPE,), seed=seed)[0], 5, GYROSCOPE)
        source, clock = phone(shaky, handles=(ACCELEROMETER,), seed=seed)
        # Sample 256 is the last of its block; the one behind it may stand before this instant, short of its own.
        now_ns = START + 2569 * SECOND // 2000
        clock.advance_to(now_ns)
        source.activate(GYROSCOPE, True)
        assert_same(drained(source, 5, GYROSCOPE), whole[int(np.searchsorted(whole.timestamp_ns, now_ns, "right")) :])

    def test_flush_completes_once_a_call_in_order(self) -> None:
        source, _ = phone()
        for handle in (GYROSCOPE, ACCELEROMETER, GYROSCOPE):
            source.flush(handle)
        assert list(source.drain(START + SECOND).flush_completes) == [GYROSCOPE, ACCELEROMETER, GYROSCOPE]
        assert list(source.drain(START + 2 * SECOND).flush_completes) == []

    def test_a_flush_is_abandoned_with_its_sensor(self) -> None:
        source, _ = phone()
        source.flush(GYROSCOPE)
        source.flush(ACCELEROMETER)
        source.activate(GYROSCOPE, False)
        assert list(source.drain(START + SECOND).flush_completes) == [ACCELEROMETER]

    def test_bad_calls_are_refused(self) -> None:
        source, _ = phone(handles=(ACCELEROMETER,))
        with pytest.raises(InvalidArgumentError, match=r"handle 4 \(gyroscope\) is not active; activate it"):
            source.flush(GYROSCOPE)
        with pytest.raises(InvalidArgumentError, match="handle 99 is not of profile patonis2018; allowed: 1 "):
            source.flush(99)
        with pytest.raises(InvalidArgumentError, match="handle 99"):
            source.activate(99, True)
        with pytest.raises(InvalidArgumentError, match="handle 99"):
            source.batch(99, 0, 0)
        with pytest.raises(InvalidArgumentError, match="sampling_period_ns = -5"):
            source.batch(ACCELEROMETER, -5, 0)
        with pytest.raises(InvalidArgumentError, match="max_report_latency_ns = -5"):
            source.batch(ACCELEROMETER, 0, -5)


class TestPhysics:
    """Without errors the samples are the motion itself."""

    @pytest.mark.parametrize("script", ["look-around", "turn-x", "shake", "walk"])
    @pytest.mark.parametrize("period_us", [0, 200_000])
    def test_gyroscope_integrates_to_the_truth(self, script: str, period_us: int) -> None:
        source, _ = phone(ideal(), script, handles=(GYROSCOPE,), period_us=period_us)
        column = drained(source, 12, GYROSCOPE)
        steps = np.diff(column.timestamp_ns, prepend=START)[:, np.newaxis] * 1e-9
        attitude = np.array([true_quaternion(source, START)])
        for step, stamp in zip(column.values * steps, column.timestamp_ns.tolist(), strict=True):
            attitude = rotation.multiply(attitude, rotation.from_rotation_vector(step[np.newaxis]))
            assert abs(attitude[0] @ true_quaternion(source, stamp)) == pytest.approx(1.0, abs=1e-12)

    def test_accelerometer_at_rest_reads_gravity_upwards(self) -> None:
        values = drained(phone(ideal(), "still")[0], 2, ACCELEROMETER).values
        np.testing.assert_allclose(values, np.tile([0.0, 0.0, 9.80665], (len(values), 1)), atol=1e-12)

    def test_upright_phone_has_gravity_along_the_screen(self) -> None:
        values = drained(phone(ideal(), "turn-x")[0], 14, ACCELEROMETER).values
        np.testing.assert_allclose(values[-1], [0.0, 9.80665, 0.0], atol=1e-12)

    def test_accelerometer_feels_the_motion(self) -> None:
        source, _ = phone(ideal(), "shake")
        column = drained(source, 8, ACCELEROMETER)
        t = 1e-9 * (column.timestamp_ns - START).astype(np.float64)
        script = make_script("shake", 1)
        expected = rotation.to_device(script.attitude(t), script.acceleration(t) + np.array([0.0, 0.0, 9.80665]))
        np.testing.assert_allclose(column.values, expected, atol=FINEST)

    def test_field_has_the_norm_dip_and_declination_of_thessaloniki(self) -> None:
        source, _ = phone(ideal(), "still")
        x, y, z = drained(source, 2, MAGNETIC_FIELD).values[-1]
        assert math.sqrt(x * x + y * y + z * z) == pytest.approx(46.9)
        assert math.degrees(math.atan2(-z, math.hypot(x, y))) == pytest.approx(57.0, abs=1e-4)
        assert math.degrees(math.atan2(x, y)) == pytest.approx(5.5, abs=1e-4)
        truth = source.truth(START + SECOND)
        assert truth is not None
        assert math.degrees(truth.declination) == pytest.approx(5.5)

    def test_field_turns_with_the_phone_and_keeps_its_norm(self) -> None:
        source, _ = phone(ideal(), "look-around")
        column = drained(source, 20, MAGNETIC_FIELD)
        np.testing.assert_allclose(np.linalg.norm(column.values, axis=1), 46.9, atol=FINEST)
        assert np.ptp(column.values[:, 0]) > 10.0

    def test_magnet_is_seen(self) -> None:
        norms = np.linalg.norm(drained(phone(ideal(), "magnet")[0], 20, MAGNETIC_FIELD).values, axis=1)
        assert norms[:350] == pytest.approx(46.9, abs=0.1)
        assert np.abs(norms - 46.9).max() > 5.0

    def test_truth_is_the_script_from_the_first_activation_on(self) -> None:
        source, clock = phone(handles=())
        assert source.truth(START) is None
        clock.advance_to(START + SECOND)
        source.activate(ACCELEROMETER, True)
        assert source.truth(START + SECOND - 1) is None
        truth = source.truth(START + 31 * SECOND)
        assert truth is not None
        attitude = make_script("look-around", 1).attitude(np.array([30.0]))[0]
        assert abs(attitude @ truth.quaternion) == pytest.approx(1.0)
        assert truth.quaternion[3] >= 0.0
        assert truth.position_enu == pytest.approx(make_script("look-around", 1).position(np.array([30.0]))[0])


def true_quaternion(source: SensorSource, timestamp_ns: int) -> Float64Array:
    truth = source.truth(timestamp_ns)
    assert truth is not None
    return np.array(truth.quaternion)


class Steady:
    """A phone that lies flat and turns evenly about its screen's normal."""

    targets: tuple[Target, ...] = ()

    def __init__(self, rate: float) -> None:
        self._rate = rate

    def attitude(self, t: Float64Array) -> Float64Array:
        half = 0.5 * self._rate * t
        return np.stack([np.zeros_like(t), np.zeros_like(t), np.sin(half), np.cos(half)], axis=1)

    def position(self, t: Float64Array) -> Float64Array:
        return np.zeros((len(t), 3))

    def acceleration(self, t: Float64Array) -> Float64Array:
        return np.zeros((len(t), 3))

    def disturbance(self, t: Float64Array) -> Float64Array | None:
        return None


class TestErrors:
    """What a profile says of its parts' errors is what the samples show."""

    def test_raw_angles_vary_as_in_the_paper(self) -> None:
        # Section 3.1: about 0.2 degrees for roll and pitch, 3 degrees for the heading, before the fusion.
        source, _ = phone(TABLET, "still")
        columns = source.drain(START + 60 * SECOND).columns
        ax, ay, az = columns[ACCELEROMETER].values.T
        mx, my, _ = columns[MAGNETIC_FIELD].values.T
        assert np.degrees(np.arctan2(ay, az)).std() == pytest.approx(0.2, rel=0.1)
        assert np.degrees(np.arctan2(-ax, np.hypot(ay, az))).std() == pytest.approx(0.2, rel=0.1)
        assert np.degrees(np.arctan2(mx, my)).std() == pytest.approx(3.0, rel=0.1)

    @pytest.mark.parametrize("period_us", [0, 20_000, 66_667])
    def test_white_noise_follows_the_rate(self, period_us: int) -> None:
        noisy = changed(ideal(), noise_density=0.01)
        source, _ = phone(noisy, "still", handles=(GYROSCOPE,), period_us=period_us)
        rate = noisy.sensor(GYROSCOPE).configured_rate_hz(period_us * 1000)
        values = drained(source, 200, GYROSCOPE).values
        np.testing.assert_allclose(values.std(axis=0), 0.01 * math.sqrt(rate), rtol=0.1)

    def test_noise_never_repeats(self) -> None:
        noisy = changed(ideal(), noise_density=0.01)
        values = drained(phone(noisy, "still", handles=(GYROSCOPE,))[0], 60, GYROSCOPE).values
        assert len(np.unique(values, axis=0)) == len(values)

    def test_the_profiles_noise_is_what_a_sample_shows(self) -> None:
        columns = phone(TABLET, "still")[0].drain(START + 60 * SECOND).columns
        noise = TABLET.noise
        assert columns[ACCELEROMETER].values.std(axis=0) == pytest.approx(noise.accelerometer_std, rel=0.1)
        assert columns[MAGNETIC_FIELD].values.std(axis=0) == pytest.approx(noise.magnetic_field_std, rel=0.1)

    @pytest.mark.parametrize("handle", THREE)
    def test_readings_are_whole_steps_of_the_resolution(self, handle: int) -> None:
        values = drained(phone()[0], 10, handle).values
        steps = values / TABLET.sensor(handle).resolution
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)

    def test_readings_stop_at_the_range(self) -> None:
        narrow = changed(ideal(), max_range=1.5)
        clock = VirtualClock(START)
        source = SimulatedPhone(narrow, clock, Steady(-2.0), 1)
        for handle in THREE:
            source.activate(handle, True)
        columns = source.drain(START + SECOND).columns
        assert columns[GYROSCOPE].values[:, 2] == pytest.approx(-1.5)
        assert columns[ACCELEROMETER].values[:, 2] == pytest.approx(1.5)
        assert np.abs(columns[MAGNETIC_FIELD].values).max() == pytest.approx(1.5)

    @pytest.mark.parametrize("seed", range(5))
    def test_constant_errors_stay_within_their_bounds(self, seed: int) -> None:
        bounds = changed(ideal(), residual=ResidualErrors(bias=0.02))
        for handle, truth in ((GYROSCOPE, [0.0, 0.0, 0.0]), (ACCELEROMETER, [0.0, 0.0, 9.80665])):
            error = drained(phone(bounds, "still", seed=seed)[0], 1, handle).values - truth
            assert np.ptp(error, axis=0) == pytest.approx(0.0, abs=1e-12)
            assert 0.0 < np.abs(error).max() <= 0.02

    def test_scale_and_misalignment_act_on_the_reading(self) -> None:
        scaled, _ = phone(changed(ideal(), residual=ResidualErrors(scale=0.01)), "still")
        x, y, z = drained(scaled, 1, ACCELEROMETER).values[0] / 9.80665
        assert [x, y] == pytest.approx([0.0, 0.0], abs=1e-12)
        assert 0.0 < abs(z - 1.0) <= 0.01
        skewed, _ = phone(changed(ideal(), residual=ResidualErrors(misalignment=0.01)), "still")
        x, y, z = drained(skewed, 1, ACCELEROMETER).values[0] / 9.80665
        assert z == pytest.approx(1.0)
        assert 0.0 < max(abs(x), abs(y)) <= 0.01

    def test_hard_iron_shifts_the_field_and_soft_iron_bends_it(self) -> None:
        field = drained(phone(ideal(), "still")[0], 1, MAGNETIC_FIELD).values[0]
        hard, _ = phone(changed(ideal(), residual=ResidualErrors(hard_iron=3.0)), "still")
        shift = drained(hard, 1, MAGNETIC_FIELD).values[0] - field
        assert 0.0 < np.abs(shift).max() <= 3.0
        soft, _ = phone(changed(ideal(), residual=ResidualErrors(soft_iron=0.01)), "still")
        bend = drained(soft, 1, MAGNETIC_FIELD).values[0] - field
        assert 0.0 < np.abs(bend).max() <= 0.01 * np.abs(field).sum()

    def test_bias_wanders_alike_at_every_rate(self) -> None:
        walking = changed(ideal(), bias_walk=1e-3)
        slow = drained(phone(walking, "still", handles=(GYROSCOPE,), period_us=200_000)[0], 3000, GYROSCOPE)
        fast = drained(phone(walking, "still", handles=(GYROSCOPE,), period_us=20_000)[0], 3000, GYROSCOPE)
        np.testing.assert_allclose(fast.values[9::10], slow.values, atol=1e-9)
        minutes = np.diff(slow.values[299::300], axis=0)
        assert minutes.std() == pytest.approx(1e-3 * math.sqrt(60), rel=0.25)

    def test_a_bias_that_wanders_takes_no_more_memory_as_time_goes_on(self) -> None:
        times = np.arange(0.0, 100_000.0, 7.0)
        walk = _RandomWalk(1e-3, [1, 2], 100.0)
        values = np.concatenate([walk.at(times[start : start + 50]) for start in range(0, len(times), 50)])
        assert len(walk._nodes) < 1000
        np.testing.assert_array_equal(values, _RandomWalk(1e-3, [1, 2], 1e6).at(times))
        np.testing.assert_array_equal(walk.at(times[70:80]), values[70:80])
        constant = _RandomWalk(0.0, [1, 2], 100.0)
        assert not constant.at(times).any()
        assert len(constant._nodes) == 1

    def test_uncalibrated_streams_are_raw_with_the_bias_beside(self) -> None:
        matrix = np.array([[1.1, 0.02, 0.0], [0.02, 0.95, 0.01], [0.0, 0.01, 1.0]])
        calibration = {kind: Calibration(np.array([0.3, -0.2, 0.1]), matrix) for kind in TABLET.sensors}
        profile = dataclasses.replace(TABLET, calibration=calibration)
        columns = phone(profile, handles=SIX)[0].drain(START + 5 * SECOND).columns
        for handle, raw_handle in ((ACCELEROMETER, 35), (MAGNETIC_FIELD, 14), (GYROSCOPE, 16)):
            raw, bias = columns[raw_handle].values[:, :3], columns[raw_handle].values[:, 3:]
            assert (bias == [0.3, -0.2, 0.1]).all()
            np.testing.assert_array_equal(columns[handle].timestamp_ns, columns[raw_handle].timestamp_ns)
            step = profile.sensor(handle).resolution / 8
            np.testing.assert_allclose(columns[handle].values, (raw - bias) @ matrix.T, atol=1.1 * step)

    def test_a_calibration_undoes_itself(self) -> None:
        calibration = {kind: Calibration(np.array([0.3, -0.2, 0.1]), 1.1 * np.eye(3)) for kind in TABLET.sensors}
        source, _ = phone(dataclasses.replace(ideal(), calibration=calibration), "still", handles=SIX)
        columns = source.drain(START + SECOND).columns
        np.testing.assert_allclose(columns[ACCELEROMETER].values[0], [0.0, 0.0, 9.80665], atol=1e-9)
        np.testing.assert_allclose(columns[35].values[0], [0.3, -0.2, 9.80665 / 1.1 + 0.1, 0.3, -0.2, 0.1], atol=1e-9)


class TestOpenSource:
    """The source is chosen by a word."""

    @pytest.mark.parametrize("spec", ["sim", "sim:", "sim:look-around"])
    def test_default_script_is_look_around(self, spec: str) -> None:
        source = open_source(spec, TABLET, VirtualClock(START), seed=1)
        source.activate(GYROSCOPE, True)
        assert_same(drained(source, 2, GYROSCOPE), drained(phone(handles=(GYROSCOPE,))[0], 2, GYROSCOPE))

    def test_script_by_name(self) -> None:
        source = open_source("sim:still", ideal(), VirtualClock(START))
        source.activate(GYROSCOPE, True)
        assert not drained(source, 2, GYROSCOPE).values.any()

    @pytest.mark.parametrize("spec", ["", "simulate", "phone:5"])
    def test_unknown_source(self, spec: str) -> None:
        with pytest.raises(InvalidArgumentError, match="allowed: sim, sim:SCRIPT, replay:PATH"):
            open_source(spec, TABLET, VirtualClock())

    def test_unfit_options(self) -> None:
        with pytest.raises(InvalidArgumentError, match=r"speed = 2\.0 with source 'sim'; allowed: 1"):
            open_source("sim", TABLET, VirtualClock(), speed=2.0)
        with pytest.raises(InvalidArgumentError, match="seed = -1; allowed: 0 or more"):
            open_source("sim", TABLET, VirtualClock(), seed=-1)
        with pytest.raises(InvalidArgumentError, match="motion script 'dance' is unknown"):
            open_source("sim:dance", TABLET, VirtualClock())


def test_a_delayed_part_stamps_what_was_felt_before() -> None:
    """By a whole period: the same readings, one stamp later, after the standstill that the motion begins with."""
    prompt, late = (phone(changed(ideal(), delay_s=delay_s), handles=(ACCELEROMETER,))[0] for delay_s in (0.0, 0.01))
    felt, stamped = drained(prompt, 20, ACCELEROMETER), drained(late, 20, ACCELEROMETER)
    np.testing.assert_array_equal(stamped.timestamp_ns, felt.timestamp_ns)
    np.testing.assert_allclose(stamped.values[1:], felt.values[:-1], atol=1e-9)
    assert np.abs(stamped.values - felt.values).max() > 0.01


def test_the_default_filter_makes_the_delays_good() -> None:
    def error_deg(delay_s: float, told_s: float) -> float:
        source, _ = phone(changed(ideal(), delay_s=delay_s))
        told = SensorErrors(gyro_delay_s=told_s, acc_delay_s=told_s, mag_delay_s=told_s)
        adaptive = make_filter("dcm-adaptive", told)
        adaptive.update_batch(source.drain(START + 60 * SECOND).flat({handle: SensorType(handle) for handle in THREE}))
        errors = []
        for hundredth in range(6001, 7001):
            batch = source.drain(START + hundredth * SECOND // 100)
            adaptive.update_batch(batch.flat({handle: SensorType(handle) for handle in THREE}))
            answer = adaptive.orientation()
            assert answer is not None
            truth = source.truth(answer.timestamp_ns)
            assert truth is not None
            magnetic = rotation.multiply(
                np.array([[0.0, 0.0, math.sin(truth.declination / 2), math.cos(truth.declination / 2)]]),
                np.array([truth.quaternion]),
            )
            errors.append(2.0 * math.acos(min(1.0, abs(float(magnetic[0] @ answer.quaternion)))))
        return math.degrees(float(np.sqrt(np.mean(np.square(errors)))))

    # What is left without any delay is the linear acceleration's.
    prompt = error_deg(0.0, 0.0)
    assert error_deg(0.006, 0.006) == pytest.approx(prompt, rel=0.05)
    assert error_deg(0.006, 0.0) > 1.3 * prompt
    assert error_deg(0.0, 0.006) > 1.3 * prompt
