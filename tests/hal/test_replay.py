"""The replay source: pace, pauses, loops, rates, and what a drain yields."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError, RecordingError
from posed.events import EventBatch, EventColumn, SensorType
from posed.hal.calibration import Calibration
from posed.hal.profile import DeviceProfile, load_profile
from posed.hal.recording import Recording, TruthTrack, in_time_order
from posed.hal.replay import LOOP_GAP_NS, ReplaySource, load_recording, open_replay
from posed.hal.thinning import thin_by_mean, thin_by_nearest

MS = 1_000_000
ACC, MAG, GYRO, GYRO_RAW = 1, 2, 4, 16
START = 7_000_000_003
BOOT = 5_000_000_000_000


def column_of(seed: int, period_ns: int, count: int, offset_ns: int, width: int = 3) -> EventColumn:
    rng = np.random.default_rng(seed)
    jitter = np.append(0, rng.integers(0, period_ns // 10, count - 1))
    stamps = START + offset_ns + np.arange(count, dtype=np.int64) * period_ns + jitter
    column, _ = in_time_order(stamps, rng.normal(size=(count, width)))
    return column


def a_recording(seconds: float = 3.0) -> Recording:
    columns = {
        SensorType.ACCELEROMETER: column_of(1, 5 * MS, int(seconds * 200), 2 * MS),
        SensorType.GYROSCOPE: column_of(2, 5 * MS, int(seconds * 200), 0),
        SensorType.MAGNETIC_FIELD: column_of(3, 20 * MS, int(seconds * 50), 11 * MS),
        SensorType.GYROSCOPE_UNCALIBRATED: column_of(4, 5 * MS, int(seconds * 200), 0, 6),
    }
    return Recording("walk", columns, {})


def exact(profile: DeviceProfile) -> DeviceProfile:
    """Return the profile with parts so fine that their values pass as they are."""
    sensors = {kind: replace(part, resolution=1e-13, max_range=1e-6) for kind, part in profile.sensors.items()}
    return replace(profile, sensors=sensors)


RECORDING = a_recording()
TABLET = exact(load_profile("patonis2018"))
PHONE = exact(load_profile("modern"))
FIRST, LAST = RECORDING.start_ns, RECORDING.end_ns


def a_source(
    recording: Recording = RECORDING,
    profile: DeviceProfile = PHONE,
    speed: float = 1.0,
    loop: bool = False,
    on: Sequence[int] = (),
) -> tuple[ReplaySource, VirtualClock]:
    clock = VirtualClock(BOOT)
    source = ReplaySource(recording, profile, clock, speed, loop)
    for handle in on:
        source.batch(handle, 0, 0)
        source.activate(handle, True)
    return source, clock


def times(batch: EventBatch, handle: int) -> list[int]:
    column = batch.columns.get(handle)
    return [] if column is None else column.timestamp_ns.tolist()


def assert_same(found: EventColumn, expected: EventColumn) -> None:
    np.testing.assert_array_equal(found.timestamp_ns, expected.timestamp_ns)
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(found.accuracy, expected.accuracy)


def test_sensors_are_the_profiles_as_far_as_recorded() -> None:
    source, _ = a_source()
    assert [info.handle for info in source.sensors] == [ACC, MAG, GYRO, GYRO_RAW]
    assert all(info in PHONE.sensor_infos() for info in source.sensors)


def test_a_recording_without_a_sensor_of_the_profile_is_refused() -> None:
    gravity = Recording("walk", {SensorType.GRAVITY: column_of(1, MS, 5, 0)}, {})
    with pytest.raises(RecordingError, match="recording 'walk' holds gravity; expected a sensor of profile modern"):
        a_source(gravity)


@pytest.mark.parametrize("speed", [0.0, 0.05, 51.0, -1.0, math.nan, math.inf])
def test_speeds_outside_the_allowed_are_refused(speed: float) -> None:
    with pytest.raises(InvalidArgumentError, match=r"replay speed .*; allowed: 0.1 to 50"):
        a_source(speed=speed)


def test_full_rate_yields_what_was_recorded() -> None:
    source, _ = a_source(on=(ACC, MAG, GYRO, GYRO_RAW))
    batch = source.drain(LAST)
    for info in source.sensors:
        assert_same(batch.columns[info.handle], RECORDING.columns[info.type])
    assert source.end_ns == LAST


@pytest.mark.parametrize("step_ns", [100 * MS, 3_700 * MS])
@pytest.mark.parametrize("rate_period_ns", [0, 20 * MS])
def test_values_are_rounded_to_what_an_app_may_see(rate_period_ns: int, step_ns: int) -> None:
    coarse = load_profile("patonis2018")
    handles = (ACC, MAG, GYRO, GYRO_RAW)
    source, _ = a_source(profile=coarse, loop=True, on=handles)
    plain, _ = a_source(profile=TABLET, loop=True, on=handles)
    for handle in handles:
        for each in (source, plain):
            each.batch(handle, rate_period_ns, 0)
    until_ns = 2 * (LAST - FIRST + LOOP_GAP_NS) + FIRST
    batches = [source.drain(min(end, until_ns)) for end in range(FIRST, until_ns + step_ns, step_ns)]
    expected = plain.drain(until_ns)
    for info in source.sensors:
        parts = [batch.columns[info.handle] for batch in batches if info.handle in batch.columns]
        found, recorded = EventColumn.concatenate(parts), expected.columns[info.handle]
        assert info.resolution > 1e-6
        step = info.resolution / 8
        np.testing.assert_array_equal(found.timestamp_ns, recorded.timestamp_ns)
        np.testing.assert_allclose(found.values[:, :3], recorded.values[:, :3], atol=0.5001 * step)
        np.testing.assert_allclose(found.values[:, :3], np.rint(found.values[:, :3] / step) * step, rtol=1e-12)
        np.testing.assert_array_equal(found.values[:, 3:], recorded.values[:, 3:])


def test_a_sensor_never_given_a_period_runs_at_the_profiles_fastest() -> None:
    source, _ = a_source(profile=TABLET)
    source.activate(ACC, True)
    expected = thin_by_nearest(RECORDING.columns[SensorType.ACCELEROMETER], 100.0, FIRST)
    assert_same(source.drain(LAST).columns[ACC], expected)


def test_batch_answers_with_the_profiles_period() -> None:
    source, _ = a_source(profile=TABLET)
    assert source.batch(GYRO, 200 * MS, 0) == 200 * MS
    assert source.batch(ACC, 66_667_000, 0) == 66_666_667
    assert source.batch(MAG, 0, 0) == 20 * MS
    with pytest.raises(InvalidArgumentError, match="sampling_period_ns"):
        source.batch(MAG, -1, 0)


@pytest.mark.parametrize(("period_ns", "rate_hz"), [(200 * MS, 5.0), (66_667_000, 15.0), (20 * MS, 50.0)])
def test_lower_rates_are_thinned_on_one_grid_from_the_start(period_ns: int, rate_hz: float) -> None:
    source, _ = a_source(profile=TABLET, on=(GYRO, GYRO_RAW, ACC, MAG))
    for handle in (GYRO, GYRO_RAW, ACC, MAG):
        source.batch(handle, period_ns, 0)
    batch = source.drain(LAST)
    for handle, kind in ((GYRO, SensorType.GYROSCOPE), (GYRO_RAW, SensorType.GYROSCOPE_UNCALIBRATED)):
        assert_same(batch.columns[handle], thin_by_mean(RECORDING.columns[kind], rate_hz, FIRST))
    if rate_hz < 50.0:
        magnetic = thin_by_nearest(RECORDING.columns[SensorType.MAGNETIC_FIELD], rate_hz, FIRST)
        assert_same(batch.columns[MAG], magnetic)
    else:
        assert_same(batch.columns[MAG], RECORDING.columns[SensorType.MAGNETIC_FIELD])
    recorded = set(RECORDING.columns[SensorType.ACCELEROMETER].timestamp_ns.tolist())
    assert set(times(batch, ACC)) < recorded
    assert len(batch.columns[ACC]) == pytest.approx(3.0 * max(rate_hz, 15.0), abs=1)


def test_stamps_rounded_to_nanoseconds_do_not_thin_a_recording_at_its_own_rate() -> None:
    stamps = np.array([k * 200_000_000 // 3 for k in range(100)], np.int64)
    column, _ = in_time_order(stamps, np.zeros((100, 3)))
    source, _ = a_source(Recording("slow", {SensorType.MAGNETIC_FIELD: column}, {}), TABLET, on=(MAG,))
    source.batch(MAG, 66_667_000, 0)
    assert times(source.drain(10**12), MAG) == stamps.tolist()


def test_a_rate_change_takes_effect_from_the_last_drained_instant() -> None:
    source, _ = a_source(profile=TABLET, on=(GYRO,))
    source.batch(GYRO, 200 * MS, 0)
    source.drain(FIRST + 1000 * MS)
    source.batch(GYRO, 20 * MS, 0)
    fast = thin_by_mean(RECORDING.columns[SensorType.GYROSCOPE], 50.0, FIRST)
    assert_same(source.drain(LAST).columns[GYRO], fast[51:])


@settings(max_examples=50)
@given(
    changes=st.lists(
        st.tuples(st.integers(1, 700 * MS), st.sampled_from([0, 20 * MS, 66_667_000, 200 * MS])),
        min_size=1,
        max_size=6,
    ),
)
def test_no_rotation_is_lost_or_told_twice_when_the_rate_changes(changes: list[tuple[int, int]]) -> None:
    source, _ = a_source(profile=TABLET, on=(GYRO,))
    now_ns, found = FIRST, []
    for wait_ns, period_ns in [*changes, (LAST - FIRST, 0)]:
        now_ns += wait_ns
        found.append(source.drain(now_ns).columns.get(GYRO))
        source.batch(GYRO, period_ns, 0)
    column = EventColumn.concatenate([each for each in found if each is not None])
    told = np.diff(column.timestamp_ns) @ column.values[1:]
    recorded = RECORDING.columns[SensorType.GYROSCOPE]
    share = np.diff(recorded.timestamp_ns, prepend=FIRST)[:, np.newaxis] * recorded.values
    ends = column.timestamp_ns[[0, -1]]
    for axis, angle in enumerate(np.cumsum(share, axis=0).T):
        turned = np.diff(np.interp(ends, recorded.timestamp_ns, angle))
        assert told[axis] == pytest.approx(turned[0], rel=1e-9, abs=1.0)


def test_the_first_sample_of_all_stands_at_the_first_activation() -> None:
    source, clock = a_source()
    clock.advance_to(BOOT + 77)
    source.activate(MAG, True)
    assert source.time_map.to_boot(FIRST) == BOOT + 77
    clock.advance_to(BOOT + 300 * MS)
    source.activate(GYRO, True)
    assert source.time_map.to_boot(FIRST) == BOOT + 77
    assert times(source.drain(FIRST), GYRO) == [FIRST]


@pytest.mark.parametrize("speed", [0.1, 0.5, 3.0, 50.0])
def test_speed_scales_the_time_map(speed: float) -> None:
    source, _ = a_source(speed=speed, on=(GYRO,))
    assert source.time_map.scale == 1.0 / speed
    assert source.time_map.to_boot(FIRST) == BOOT
    assert source.time_map.to_boot(FIRST + 1000 * MS) == pytest.approx(BOOT + 1000 * MS / speed, abs=1)


def test_the_replay_pauses_while_no_sensor_is_active() -> None:
    source, clock = a_source(speed=2.0, on=(GYRO,))
    clock.advance_to(BOOT + 500 * MS)
    source.drain(FIRST + 900 * MS)
    source.activate(GYRO, False)
    assert len(source.drain(LAST)) == 0
    assert source.next_sample_ns(GYRO) is None
    clock.advance_to(BOOT + 60_000 * MS)
    source.activate(GYRO, True)
    # Half a second at double speed: sample time stood at 1 s, and what was not drained of it is abandoned.
    assert source.time_map.to_boot(FIRST + 1000 * MS) == pytest.approx(clock.now_ns(), abs=1)
    recorded = RECORDING.columns[SensorType.GYROSCOPE].timestamp_ns
    assert times(source.drain(LAST), GYRO) == recorded[recorded > FIRST + 1000 * MS].tolist()


def test_a_pause_of_a_replay_drained_ahead_of_the_clock_loses_nothing() -> None:
    source, _ = a_source(on=(GYRO,))
    before = times(source.drain(FIRST + 900 * MS), GYRO)
    source.activate(GYRO, False)
    source.activate(GYRO, True)
    recorded = RECORDING.columns[SensorType.GYROSCOPE].timestamp_ns.tolist()
    assert before + times(source.drain(LAST), GYRO) == recorded


def test_a_replay_resumed_after_a_suspend_goes_on_where_it_was() -> None:
    source, clock = a_source(speed=2.0, on=(GYRO,))
    before = times(source.drain(FIRST + 900 * MS), GYRO)
    clock.advance_to(BOOT + 3_600_000 * MS)
    source.resume()
    assert source.time_map.to_boot(FIRST + 900 * MS) == pytest.approx(clock.now_ns(), abs=1)
    recorded = RECORDING.columns[SensorType.GYROSCOPE].timestamp_ns.tolist()
    assert before + times(source.drain(LAST), GYRO) == recorded


def test_no_stale_events_after_reactivation() -> None:
    source, clock = a_source(on=(GYRO, ACC))
    clock.advance_to(BOOT + 100 * MS)
    source.drain(FIRST + 100 * MS)
    source.flush(GYRO)
    source.activate(GYRO, False)
    clock.advance_to(BOOT + 150 * MS)
    source.activate(GYRO, True)
    batch = source.drain(FIRST + 200 * MS)
    assert FIRST + 150 * MS < times(batch, GYRO)[0] <= FIRST + 156 * MS
    assert times(batch, ACC)[0] <= FIRST + 106 * MS
    assert list(batch.flush_completes) == []


def test_activation_is_idempotent() -> None:
    source, clock = a_source(on=(GYRO,))
    clock.advance_to(BOOT + 500 * MS)
    source.activate(GYRO, True)
    assert times(source.drain(LAST), GYRO)[0] == FIRST
    source.activate(MAG, False)
    source.activate(GYRO, False)
    source.activate(GYRO, False)
    assert source.next_sample_ns(GYRO) is None


def test_flushes_complete_at_the_next_drain_in_the_order_asked() -> None:
    source, _ = a_source(on=(GYRO, ACC))
    source.drain(FIRST + 100 * MS)
    for handle in (ACC, GYRO, ACC):
        source.flush(handle)
    batch = source.drain(FIRST + 100 * MS)
    assert list(batch.flush_completes) == [ACC, GYRO, ACC]
    assert len(batch) == 0
    assert list(source.drain(FIRST + 200 * MS).flush_completes) == []


def test_handles_that_are_unknown_or_off_are_named() -> None:
    source, _ = a_source(on=(GYRO,))
    with pytest.raises(InvalidArgumentError, match="sensor handle 2 is not active; activate it before flush"):
        source.flush(MAG)
    calls: list[Callable[[], object]] = [
        lambda: source.flush(99),
        lambda: source.activate(99, True),
        lambda: source.batch(99, 0, 0),
        lambda: source.next_sample_ns(99),
    ]
    for call in calls:
        with pytest.raises(InvalidArgumentError, match=r"sensor handle 99 is not in this replay; allowed: 1 \(accel"):
            call()


def test_next_sample_follows_the_drain() -> None:
    source, _ = a_source(on=(MAG,))
    recorded = RECORDING.columns[SensorType.MAGNETIC_FIELD].timestamp_ns.tolist()
    assert source.next_sample_ns(MAG) == recorded[0]
    source.drain(recorded[4])
    assert source.next_sample_ns(MAG) == recorded[5]
    assert source.next_sample_ns(GYRO) is None
    source.drain(LAST)
    assert source.next_sample_ns(MAG) is None


def test_it_ends_with_the_last_sample_of_any_sensor_and_yields_nothing_behind_it() -> None:
    source, _ = a_source(on=(GYRO,))
    assert source.end_ns == LAST
    source.drain(LAST)
    assert len(source.drain(LAST + 10**12)) == 0


def test_a_loop_continues_sample_time_behind_a_gap() -> None:
    source, _ = a_source(loop=True, on=(GYRO, MAG))
    pass_ns = LAST - FIRST + LOOP_GAP_NS
    batch = source.drain(FIRST + 2 * pass_ns + 100 * MS)
    recorded = RECORDING.columns[SensorType.GYROSCOPE]
    found = batch.columns[GYRO]
    size = len(recorded)
    assert found.timestamp_ns[:size].tolist() == recorded.timestamp_ns.tolist()
    assert found.timestamp_ns[size : 2 * size].tolist() == (recorded.timestamp_ns + pass_ns).tolist()
    np.testing.assert_allclose(found.values[size : 2 * size], recorded.values, rtol=1e-13, atol=1e-13)
    assert np.max(np.diff(found.timestamp_ns)) > 500 * MS
    assert np.min(np.diff(found.timestamp_ns)) > 0
    assert found.timestamp_ns[-1] > FIRST + 2 * pass_ns
    assert source.end_ns is None
    assert source.next_sample_ns(MAG) == min(
        t
        for t in (RECORDING.columns[SensorType.MAGNETIC_FIELD].timestamp_ns + 2 * pass_ns).tolist()
        if t > FIRST + 2 * pass_ns + 100 * MS
    )


def test_in_the_gap_of_a_loop_the_next_sample_is_of_the_next_pass() -> None:
    source, _ = a_source(loop=True, on=(GYRO,))
    source.drain(LAST + 10 * MS)
    assert source.next_sample_ns(GYRO) == FIRST + LAST - FIRST + LOOP_GAP_NS


def test_a_sensor_that_begins_passes_ahead_of_a_drain_has_nothing_in_it() -> None:
    source, clock = a_source(loop=True, on=(GYRO,))
    pass_ns = LAST - FIRST + LOOP_GAP_NS
    source.drain(FIRST + 10 * MS)
    clock.advance_to(source.time_map.to_boot(FIRST + 2 * pass_ns + 10 * MS))
    source.activate(MAG, True)
    assert list(source.drain(FIRST + pass_ns + 10 * MS).columns) == [GYRO]
    begun = source.drain(FIRST + 2 * pass_ns + 500 * MS).columns[MAG]
    assert begun.timestamp_ns[0] > FIRST + 2 * pass_ns + 10 * MS


operations = st.lists(
    st.tuples(
        st.sampled_from(["on", "off", "rate", "wait"]),
        st.sampled_from([ACC, MAG, GYRO, GYRO_RAW]),
        st.sampled_from([0, 20 * MS, 66_667_000, 200 * MS]),
        st.integers(0, 1500 * MS),
    ),
    min_size=1,
    max_size=8,
)


@settings(max_examples=80)
@given(
    operations=operations,
    cuts=st.lists(st.integers(0, 8000 * MS), max_size=12),
    speed=st.sampled_from([1.0, 0.7, 4.0]),
    loop=st.booleans(),
)
def test_what_is_yielded_does_not_depend_on_how_it_is_cut(
    operations: list[tuple[str, int, int, int]], cuts: list[int], speed: float, loop: bool
) -> None:
    def run(cuts: list[int]) -> dict[int, list[EventColumn]]:
        source, clock = a_source(profile=TABLET, speed=speed, loop=loop)
        found: dict[int, list[EventColumn]] = {}

        def drain(until_ns: int) -> None:
            for handle, column in source.drain(until_ns).columns.items():
                found.setdefault(handle, []).append(column)

        for what, handle, period_ns, wait_ns in [("on", GYRO, 0, 0), *operations]:
            if what == "on":
                source.activate(handle, True)
            elif what == "off":
                source.activate(handle, False)
            elif what == "rate":
                source.batch(handle, period_ns, 0)
            until_boot = clock.now_ns() + wait_ns
            for cut in cuts:
                if clock.now_ns() < BOOT + cut < until_boot:
                    clock.advance_to(BOOT + cut)
                    drain(source.time_map.to_sample(clock.now_ns()))
            clock.advance_to(until_boot)
            drain(source.time_map.to_sample(clock.now_ns()))
        return found

    whole, cut = run([]), run(sorted(cuts))
    assert whole.keys() == cut.keys()
    for handle in whole:
        stamps = np.concatenate([column.timestamp_ns for column in whole[handle]])
        assert np.all(np.diff(stamps) > 0)
        np.testing.assert_array_equal(stamps, np.concatenate([column.timestamp_ns for column in cut[handle]]))
        np.testing.assert_array_equal(
            np.concatenate([column.values for column in whole[handle]]),
            np.concatenate([column.values for column in cut[handle]]),
        )


def calibrated_profile(kind: SensorType) -> DeviceProfile:
    matrix = np.array([[1.1, 0.1, 0.0], [0.0, 0.9, 0.0], [0.0, 0.0, 1.0]])
    calibration = {**PHONE.calibration, kind: Calibration(np.array([0.5, 0.0, -0.5]), matrix)}
    return DeviceProfile(PHONE.name, PHONE.description, PHONE.sensors, calibration)


def test_a_calibration_is_applied_to_the_uncalibrated_stream() -> None:
    source, _ = a_source(profile=calibrated_profile(SensorType.GYROSCOPE), on=(ACC, GYRO, GYRO_RAW))
    batch = source.drain(LAST)
    raw = RECORDING.columns[SensorType.GYROSCOPE_UNCALIBRATED]
    assert_same(batch.columns[GYRO_RAW], raw)
    assert batch.columns[GYRO].timestamp_ns.tolist() == raw.timestamp_ns.tolist()
    expected = 1.1 * (raw.values[:, 0] - 0.5) + 0.1 * raw.values[:, 1]
    np.testing.assert_allclose(batch.columns[GYRO].values[:, 0], expected, atol=1e-12)
    assert_same(batch.columns[ACC], RECORDING.columns[SensorType.ACCELEROMETER])


def test_a_calibration_corrects_the_recorded_stream_where_there_is_no_other() -> None:
    source, _ = a_source(profile=calibrated_profile(SensorType.MAGNETIC_FIELD), on=(MAG,))
    recorded = RECORDING.columns[SensorType.MAGNETIC_FIELD]
    found = source.drain(LAST).columns[MAG]
    np.testing.assert_allclose(found.values[:, 2], recorded.values[:, 2] + 0.5, atol=1e-12)


def test_a_calibration_of_a_sensor_that_was_not_recorded_changes_nothing() -> None:
    columns = {SensorType.GYROSCOPE: RECORDING.columns[SensorType.GYROSCOPE]}
    source, _ = a_source(Recording("walk", columns, {}), calibrated_profile(SensorType.ACCELEROMETER))
    assert [info.handle for info in source.sensors] == [GYRO]


def test_truth_is_loaded_once_asked_for_and_follows_the_loop() -> None:
    loads = []

    def load() -> TruthTrack:
        loads.append(1)
        stamps = START + np.arange(200, dtype=np.int64) * 16 * MS
        return TruthTrack(stamps, np.tile([0.0, 0.0, 0.0, 1.0], (200, 1)), np.zeros((200, 3)))

    recording = Recording("walk", RECORDING.columns, {}, declination=0.03, load_truth=load)
    source, _ = a_source(recording, loop=True, on=(GYRO,))
    source.drain(LAST)
    assert not loads
    pass_ns = LAST - FIRST + LOOP_GAP_NS
    for instant in (FIRST + 100 * MS, FIRST + pass_ns + 100 * MS):
        truth = source.truth(instant)
        assert truth is not None
        assert (truth.timestamp_ns, truth.declination) == (instant, 0.03)
        assert truth.quaternion == (0.0, 0.0, 0.0, 1.0)
    assert source.truth(LAST + LOOP_GAP_NS - MS) is None
    assert loads == [1]
    assert a_source()[0].truth(FIRST) is None


def test_open_replay_reads_a_file(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("sensor,timestamp_ns,x,y,z\n" + "".join(f"gyroscope,{k * 5 * MS},1,2,{k}\n" for k in range(50)))
    source = open_replay(str(path), PHONE, VirtualClock(), speed=2.0)
    source.activate(GYRO, True)
    assert source.drain(245 * MS).columns[GYRO].values[:, 2].tolist() == list(range(50))


def test_a_trial_thinned_to_5_hz_keeps_its_integral(data_dir: Path) -> None:
    recording = load_recording(data_dir / "smartphone-attitude" / "trials" / "Guillaume_Nexus5_NoDist_RunningHand")
    source = ReplaySource(recording, TABLET, VirtualClock())
    source.batch(GYRO, 200 * MS, 0)
    source.activate(GYRO, True)
    thinned = source.drain(recording.end_ns).columns[GYRO]
    recorded = recording.columns[SensorType.GYROSCOPE]
    running = np.cumsum(recorded.values[1:] * np.diff(recorded.timestamp_ns)[:, None] / 1e9, axis=0)
    turned = np.cumsum(thinned.values[1:] * np.diff(thinned.timestamp_ns)[:, None] / 1e9, axis=0)
    for axis in range(3):
        at = np.interp(thinned.timestamp_ns, recorded.timestamp_ns[1:], running[:, axis])
        np.testing.assert_allclose(turned[:, axis] - turned[0, axis], (at[1:] - at[1]), atol=1e-9)
