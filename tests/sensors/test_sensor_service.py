"""Registrations, delivery and poses of the sensor service over a source whose every sample is known."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from posed.errors import InvalidArgumentError, InvalidStateError
from posed.events import FilterStatus, RateMode, SensorType
from posed.sensors import SensorEventConnection
from posed.sensors.connection import MAX_FLUSH_COMPLETES

ACC, MAG, GYRO = 1, 2, 4
MakeBench = Callable[..., Any]


def _taken_ms(connection: SensorEventConnection, handle: int) -> list[float]:
    times: list[float] = []
    while connection:
        column = connection.take(1000).columns.get(handle)
        times += [] if column is None else [t / 1e6 for t in column.timestamp_ns.tolist()]
    return times


def test_the_hal_is_batched_before_activation_and_only_on_change(make_bench: MakeBench) -> None:
    bench = make_bench()
    slow, fast = bench.service.connect(), bench.service.connect()
    bench.service.enable(slow, ACC, 200_000, 0)
    assert bench.source.calls == [("batch", ACC, 200_000_000, 0), ("activate", ACC, True)]
    bench.source.calls.clear()
    bench.service.enable(fast, ACC, 20_000, 0)
    assert bench.source.calls == [("batch", ACC, 20_000_000, 0)]
    bench.source.calls.clear()
    another = bench.service.connect()
    bench.service.enable(another, ACC, 200_000, 0)
    assert bench.source.calls == []
    bench.service.disable(fast, ACC)
    assert bench.source.calls == [("batch", ACC, 200_000_000, 0)]
    bench.source.calls.clear()
    bench.service.disconnect(slow)
    bench.service.disconnect(another)
    assert bench.source.calls == [("activate", ACC, False)]
    assert bench.service.next_deadline_ns() is None


def test_every_listener_of_a_sensor_gets_all_its_events(make_bench: MakeBench) -> None:
    bench = make_bench()
    slow, fast = bench.service.connect(), bench.service.connect()
    bench.service.enable(slow, ACC, 200_000, 0)
    bench.service.enable(fast, ACC, 20_000, 0)
    bench.advance_ms(100)
    assert _taken_ms(slow, ACC) == _taken_ms(fast, ACC) == [20, 40, 60, 80, 100]


def test_a_streaming_listener_is_served_at_each_sample(make_bench: MakeBench) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 5_000, 0)
    for sample_ms in (5, 10, 15):
        assert bench.deadline_ms == sample_ms
        bench.advance_ms(sample_ms)
        assert _taken_ms(listener, GYRO) == [sample_ms]


def test_a_batching_listener_waits_for_its_latency(make_bench: MakeBench) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 5_000, 100_000)
    assert bench.deadline_ms == 100
    bench.advance_ms(50)
    assert _taken_ms(listener, GYRO) == []
    bench.advance_ms(100)
    assert len(_taken_ms(listener, GYRO)) == 20
    assert bench.deadline_ms == 200


def test_a_sensor_without_a_fifo_streams_whatever_is_asked(make_bench: MakeBench) -> None:
    bench = make_bench(fifo=0)
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 5_000, 100_000)
    assert bench.deadline_ms == 5


def test_a_fifo_that_is_full_before_the_latency_is_delivered_early(make_bench: MakeBench) -> None:
    bench = make_bench(fifo=10)
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 5_000, 1_000_000)
    assert bench.deadline_ms == 50
    bench.advance_ms(50)
    assert len(_taken_ms(listener, GYRO)) == 10


def test_one_sensors_stream_does_not_break_up_anothers_batches(make_bench: MakeBench) -> None:
    bench = make_bench()
    streaming, batching = bench.service.connect(), bench.service.connect()
    bench.service.enable(streaming, GYRO, 5_000, 0)
    bench.service.enable(batching, ACC, 10_000, 100_000)
    arrivals = []
    for sample_ms in range(5, 205, 5):
        bench.advance_ms(sample_ms)
        if batching:
            arrivals.append((sample_ms, len(_taken_ms(batching, ACC))))
    assert arrivals == [(100, 10), (200, 10)]
    assert len(_taken_ms(streaming, GYRO)) == 40


def test_a_newcomer_sees_nothing_sampled_for_others_before_it_came(make_bench: MakeBench) -> None:
    bench = make_bench()
    first, newcomer = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, GYRO, 20_000, 1_000_000)
    bench.advance_ms(100)
    bench.service.enable(newcomer, GYRO, 20_000, 1_000_000)
    bench.advance_ms(1200)
    assert _taken_ms(newcomer, GYRO)[0] == 120
    assert _taken_ms(first, GYRO)[0] == 20


def test_enabling_twice_is_refused_and_changes_nothing(make_bench: MakeBench) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 20_000, 0)
    before = list(bench.source.calls)
    with pytest.raises(InvalidArgumentError, match="already has sensor 4"):
        bench.service.enable(listener, GYRO, 5_000, 0)
    assert bench.source.calls == before


@pytest.mark.parametrize(
    ("handle", "period_us", "latency_us", "named"),
    [(99, 0, 0, "99"), (GYRO, -1, 0, "-1 us"), (GYRO, 0, -5, "-5 us")],
)
def test_a_bad_request_names_its_value(
    make_bench: MakeBench, handle: int, period_us: int, latency_us: int, named: str
) -> None:
    bench = make_bench()
    with pytest.raises(InvalidArgumentError, match=named):
        bench.service.enable(bench.service.connect(), handle, period_us, latency_us)
    assert bench.source.calls == []


def test_a_flush_completes_once_a_sensor_for_the_listener_that_asked(make_bench: MakeBench) -> None:
    bench = make_bench()
    asking, other = bench.service.connect(), bench.service.connect()
    for listener in (asking, other):
        bench.service.enable(listener, GYRO, 20_000, 1_000_000)
        bench.service.enable(listener, ACC, 20_000, 1_000_000)
    bench.advance_ms(100)
    bench.service.flush(asking)
    chunk = asking.take(1000)
    assert chunk.columns[GYRO].timestamp_ns.tolist()[-1] == 100_000_000
    assert sorted(chunk.flush_completes) == [ACC, GYRO]
    assert other.take(1000).flush_completes == ()


def test_a_flush_without_a_sensor_is_an_error(make_bench: MakeBench) -> None:
    bench = make_bench()
    with pytest.raises(InvalidStateError, match="nothing to flush"):
        bench.service.flush(bench.service.connect())


def test_flush_completes_that_nobody_reads_are_bounded(make_bench: MakeBench) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, ACC, 20_000, 0)
    for _ in range(MAX_FLUSH_COMPLETES):
        bench.service.flush(listener)
    with pytest.raises(InvalidStateError, match="1000 flush-completes already wait"):
        bench.service.flush(listener)
    assert len(listener.take(1000).flush_completes) == MAX_FLUSH_COMPLETES
    bench.service.flush(listener)


def test_one_that_leaves_does_not_put_off_what_waits_for_its_latency(make_bench: MakeBench) -> None:
    bench = make_bench()
    staying, leaving = bench.service.connect(), bench.service.connect()
    bench.service.enable(staying, ACC, 20_000, 1_000_000)
    bench.service.enable(leaving, ACC, 10_000, 1_000_000)
    bench.advance_ms(900)
    bench.service.disable(leaving, ACC)
    assert bench.deadline_ms == 1000


def test_after_a_suspend_the_present_comes_first(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("client", 100_000, 20_000)
    bench.advance_ms(1000)
    bench.service.take_poses()
    assert bench.deadline_ms is not None
    hour_ms = 3_600_000
    bench.advance_ms(hour_ms)
    assert ("resume",) in bench.source.calls
    assert len(bench.service.take_poses()) <= 2
    assert len(bench.filter.fed) < 500
    bench.advance_ms(hour_ms + 1000)
    assert [pose.sequence for pose in bench.service.take_poses()] == list(range(36_000, 36_010))


def test_a_listener_that_left_does_not_take_anothers_flush(make_bench: MakeBench) -> None:
    bench = make_bench()
    leaving, staying = bench.service.connect(), bench.service.connect()
    bench.service.enable(leaving, GYRO, 20_000, 0)
    bench.service.enable(staying, GYRO, 20_000, 0)
    bench.service.flush(leaving)
    bench.service.flush(staying)
    bench.service.disconnect(leaving)
    assert staying.take(1000).flush_completes == (GYRO,)


def test_poses_stand_on_the_grid_of_their_period_from_the_first_sample_on(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("a", 100_000, 5_000)
    assert bench.deadline_ms == 5
    bench.advance_ms(5)
    assert [(p.sequence, p.instant_ns) for p in bench.service.take_poses()] == [(0, 5_000_000)]
    assert bench.deadline_ms == 105
    bench.advance_ms(310)
    poses = bench.service.take_poses()
    assert [(p.sequence, p.orientation.timestamp_ns) for p in poses] == [
        (1, 105_000_000),
        (2, 205_000_000),
        (3, 305_000_000),
    ]
    assert [p.events_fused for p in poses] == [60, 60, 60]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps_ms=st.lists(st.integers(1, 400), min_size=1, max_size=8))
def test_poses_do_not_depend_on_when_the_service_wakes(make_bench: MakeBench, steps_ms: list[int]) -> None:
    whole, stepped = make_bench(), make_bench()
    for bench in (whole, stepped):
        bench.service.register_pose("a", 100_000, 20_000)
    now_ms = 0
    poses = []
    for step in steps_ms:
        now_ms += step
        stepped.advance_ms(now_ms)
        poses += stepped.service.take_poses()
    whole.advance_ms(now_ms)
    assert poses == whole.service.take_poses()
    assert stepped.filter.fed == whole.filter.fed


def test_each_period_has_its_own_grid_and_sequence(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("slow", 200_000, 5_000)
    bench.advance_ms(5)
    bench.service.register_pose("fast", 50_000, 5_000)
    bench.advance_ms(205)
    seen = sorted((p.period_us, p.sequence, p.events_fused) for p in bench.service.take_poses())
    assert [entry[:2] for entry in seen] == [
        (50_000, 1),
        (50_000, 2),
        (50_000, 3),
        (50_000, 4),
        (200_000, 0),
        (200_000, 1),
    ]
    assert sum(count for period, _, count in seen if period == 50_000) == 120


def test_the_fastest_pose_client_sets_the_rate_mode(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("normal", 100_000, 200_000)
    bench.service.register_pose("game", 100_000, 20_000)
    bench.advance_ms(100)
    assert bench.service.take_poses()[-1].rate_mode is RateMode.GAME
    bench.service.unregister_pose("game")
    bench.advance_ms(1000)
    assert bench.service.take_poses()[-1].rate_mode is RateMode.NORMAL


def test_the_pose_sets_rates_but_no_latency(make_bench: MakeBench) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 200_000, 1_000_000)
    bench.service.register_pose("a", 100_000, 5_000)
    gyro = next(s for s in bench.service.active_sensors if s.info.handle == GYRO)
    assert gyro.params is not None
    assert gyro.params.sampling_period_ns == 5_000_000
    assert gyro.latency_ns == 1_000_000_000


def test_with_nobody_registered_the_source_is_off_and_nothing_is_due(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("a", 100_000, 5_000)
    bench.advance_ms(200)
    bench.service.unregister_pose("a")
    assert [call for call in bench.source.calls if call[0] == "activate"][-3:] == [
        ("activate", handle, False) for handle in (ACC, MAG, GYRO)
    ]
    assert bench.service.next_deadline_ns() is None


def test_a_pose_registered_after_a_pause_begins_now_without_a_burst(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("a", 100_000, 5_000)
    bench.advance_ms(205)
    bench.service.unregister_pose("a")
    bench.service.take_poses()
    bench.advance_ms(60_000)
    bench.source.drain(60_000_000_000)
    bench.service.register_pose("b", 100_000, 5_000)
    bench.advance_ms(60_110)
    assert [pose.sequence for pose in bench.service.take_poses()] == [600, 601]


def test_a_period_out_of_range_or_a_source_without_magnetometer_gives_no_pose(make_bench: MakeBench) -> None:
    bench = make_bench()
    with pytest.raises(InvalidArgumentError, match="4999 us"):
        bench.service.register_pose("a", 4_999, 0)
    with pytest.raises(InvalidArgumentError, match="1000001 us"):
        bench.service.register_pose("a", 1_000_001, 0)
    blind = make_bench((SensorType.ACCELEROMETER, SensorType.GYROSCOPE))
    with pytest.raises(InvalidArgumentError, match="magnetic_field"):
        blind.service.register_pose("a", 100_000, 0)


def test_what_happened_in_the_filter_is_told_to_every_grid_once(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("slow", 200_000, 5_000)
    bench.service.register_pose("fast", 100_000, 5_000)
    bench.advance_ms(5)
    bench.service.take_poses()
    bench.filter.status = FilterStatus.GAP
    bench.advance_ms(405)
    told = [(p.period_us, p.sequence) for p in bench.service.take_poses() if p.orientation.status & FilterStatus.GAP]
    assert sorted(told) == [(100_000, 1), (200_000, 1)]


def test_fused_sensors_follow_accelerometer_events_and_keep_their_times(make_bench: MakeBench) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, SensorType.GRAVITY, 20_000, 0)
    bench.service.enable(listener, SensorType.ROTATION_VECTOR, 20_000, 0)
    bench.service.enable(listener, SensorType.LINEAR_ACCELERATION, 20_000, 0)
    bench.advance_ms(100)
    chunk = listener.take(1000)
    for kind in (SensorType.GRAVITY, SensorType.ROTATION_VECTOR, SensorType.LINEAR_ACCELERATION):
        assert chunk.columns[kind].timestamp_ns.tolist() == [t * 1_000_000 for t in (20, 40, 60, 80, 100)]
    assert chunk.columns[SensorType.GRAVITY].values[0].tolist() == pytest.approx([0, 0, 9.80665])
    assert chunk.columns[SensorType.LINEAR_ACCELERATION].values[0].tolist() == pytest.approx([1, 1, 1 - 9.80665])
    assert chunk.columns[SensorType.ROTATION_VECTOR].values[0].tolist() == [0, 0, 0, 1, 0.1]
    assert ACC not in chunk.columns


def test_a_slow_fused_sensor_still_runs_the_accelerometer_at_20_hz(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.enable(bench.service.connect(), SensorType.ROTATION_VECTOR, 200_000, 0)
    periods = {s.info.handle: s.params.sampling_period_ns // 1_000_000 for s in bench.service.active_sensors}
    assert (periods[ACC], periods[MAG], periods[GYRO]) == (50, 10, 5)


@pytest.mark.parametrize("steps_ms", [(900,), (250, 260, 270, 900), (205, 206, 900)])
def test_a_recording_that_ended_moves_no_grid_on(make_bench: MakeBench, steps_ms: tuple[int, ...]) -> None:
    bench = make_bench()
    bench.source.end_ns = 260_000_000
    bench.service.register_pose("a", 100_000, 20_000)
    for now_ms in steps_ms:
        bench.advance_ms(now_ms)
    assert [pose.instant_ns // 1_000_000 for pose in bench.service.take_poses()] == [20, 120, 220]
    assert bench.service.next_deadline_ns() is None


def test_the_end_of_a_recording_lets_go_what_waits_for_its_latency(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.source.end_ns = 100_000_000
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 20_000, 1_000_000)
    bench.advance_ms(80)
    assert bench.deadline_ms == 1000
    bench.advance_ms(1000)
    assert _taken_ms(listener, GYRO) == [20, 40, 60, 80, 100]
    assert bench.service.next_deadline_ns() is None


def test_what_the_source_refuses_leaves_nothing_behind(make_bench: MakeBench) -> None:
    bench = make_bench((SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD, SensorType.GYROSCOPE))
    batch = bench.source.batch

    def refuse(handle: int, period_ns: int, latency_ns: int) -> int:
        if handle == MAG:
            raise InvalidArgumentError("no magnetometer today")
        return int(batch(handle, period_ns, latency_ns))

    bench.source.batch = refuse
    with pytest.raises(InvalidArgumentError, match="today"):
        bench.service.register_pose("a", 100_000, 20_000)
    with pytest.raises(InvalidArgumentError, match="today"):
        bench.service.enable(bench.service.connect(), MAG, 20_000, 0)
    assert list(bench.service.active_sensors) == []
    assert bench.service.pose_sampling_period_us is None
    assert list(bench.service.registrations.newest_first()) == []
    bench.source.batch = batch
    bench.service.register_pose("a", 100_000, 20_000)
    bench.advance_ms(300)
    assert len(bench.service.take_poses()) > 1
