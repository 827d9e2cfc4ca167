"""What simple emulations of Android's sensor service miss, one test each, on the service itself."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError
from posed.events import EventColumn, SensorType
from posed.hal import open_source
from posed.hal.profile import load_profile, profile_names
from posed.sensors import SensorEventConnection, SensorService, make_device_filter

ACC, MAG, GYRO = SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD, SensorType.GYROSCOPE
LIGHT, MOTION = SensorType.LIGHT, SensorType.MOTION_DETECT
MakeBench = Callable[..., Any]


def _taken_ms(connection: SensorEventConnection, handle: int) -> list[float]:
    times: list[float] = []
    while connection:
        column = connection.take(1000).columns.get(handle)
        times += [] if column is None else [t / 1e6 for t in column.timestamp_ns.tolist()]
    return times


def test_the_fastest_wins_and_no_client_is_decimated(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    slow, fast = bench.service.connect(), bench.service.connect()
    bench.service.enable(fast, GYRO, 20_000, 0)
    bench.service.enable(slow, GYRO, 200_000, 0)
    bench.advance_ms(200)
    assert _taken_ms(fast, GYRO) == _taken_ms(slow, GYRO) == [float(t) for t in range(20, 201, 20)]


def test_a_slow_streaming_client_does_not_force_a_latency_of_zero(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    bench.service.enable(bench.service.connect(), GYRO, 20_000, 1_000_000)
    bench.service.enable(bench.service.connect(), GYRO, 200_000, 0)
    assert bench.source.calls[-1] == ("batch", GYRO, 20_000_000, 200_000_000)
    bench.service.enable(bench.service.connect(), GYRO, 20_000, 0)
    assert bench.source.calls[-1] == ("batch", GYRO, 20_000_000, 0)


@pytest.mark.parametrize(
    ("asked_us", "set_ns"), [(0, 5_000_000), (4_000, 5_000_000), (66_667, 66_667_000), (2_000_000_000, 200_000_000)]
)
def test_periods_are_clamped_and_the_hal_is_batched_only_on_change(
    make_bench: MakeBench, asked_us: int, set_ns: int
) -> None:
    bench = make_bench((GYRO,))
    first, second = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, GYRO, asked_us, 0)
    assert bench.source.calls == [("batch", GYRO, set_ns, 0), ("activate", GYRO, True)]
    bench.source.calls.clear()
    bench.service.enable(second, GYRO, 200_000, 0)
    assert bench.source.calls == []
    bench.service.disable(second, GYRO)
    bench.service.disable(first, GYRO)
    assert bench.source.calls == [("activate", GYRO, False)]


def test_the_rate_drops_back_when_the_fast_client_leaves(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    fast, ui = bench.service.connect(), bench.service.connect()
    bench.service.enable(fast, GYRO, 0, 0)
    bench.service.enable(ui, GYRO, 66_667, 0)
    bench.service.disable(fast, GYRO)
    assert bench.source.calls[-1] == ("batch", GYRO, 66_667_000, 0)


@pytest.mark.parametrize("profile_name", profile_names())
@pytest.mark.parametrize("rate_hz", [200, 100, 50, 25, 15, 10, 5])
def test_a_rate_is_a_hint_and_delivered_at_no_less_than_nine_tenths(profile_name: str, rate_hz: int) -> None:
    profile = load_profile(profile_name)
    clock = VirtualClock(1_000_000_000)
    source = open_source("sim:still", profile, clock)
    service = SensorService(source, make_device_filter("dcm", profile), clock)
    for kind in (ACC, GYRO, MAG):
        connection = service.connect()
        service.enable(connection, kind, round(1e6 / rate_hz), 0)
        clock.advance_to(clock.now_ns() + 4_000_000_000)
        service.advance()
        times = _taken_ms(connection, kind)
        service.disable(connection, kind)
        delivered_hz = 1e3 * (len(times) - 1) / (times[-1] - times[0])
        rates = profile.sensor(kind).rates_hz
        # Where a profile has no rate within 220 %, its own rule holds: the slowest that is not slower.
        chosen = min((rate for rate in rates if rate >= rate_hz), default=rates[-1])
        assert 0.9 * min(rate_hz, rates[-1]) < delivered_hz < max(2.2 * rate_hz, 1.1 * chosen)


def test_who_registers_twice_is_refused_and_nothing_changes(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 20_000, 0)
    before = list(bench.source.calls)
    with pytest.raises(InvalidArgumentError, match="already has sensor 4"):
        bench.service.enable(listener, GYRO, 5_000, 0)
    assert bench.source.calls == before


def test_the_joiner_of_a_running_continuous_sensor_sees_nothing_until_a_flush_completes(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    first, joiner = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, GYRO, 20_000, 10_000_000)
    bench.advance_ms(100)
    bench.source.flush_is_slow = True
    bench.service.enable(joiner, GYRO, 20_000, 0)
    bench.advance_ms(200)
    assert len(_taken_ms(first, GYRO)) == 10
    assert _taken_ms(joiner, GYRO) == []
    bench.source.flush_is_slow = False
    bench.advance_ms(210)
    bench.advance_ms(300)
    assert _taken_ms(joiner, GYRO) == [220, 240, 260, 280, 300]


def test_an_on_change_joiner_gets_the_last_value_of_this_activation_only(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT,))
    first, joiner, second, late = (bench.service.connect() for _ in range(4))
    bench.service.enable(first, LIGHT, 0, 0)
    bench.advance_ms(10)
    bench.service.enable(joiner, LIGHT, 0, 0)
    assert len(joiner.take(10)) == 1
    bench.service.disconnect(first)
    bench.service.disconnect(joiner)
    bench.service.enable(second, LIGHT, 0, 0)
    bench.service.enable(late, LIGHT, 0, 0)
    assert len(late.take(10)) == 0


def test_flush_completes_are_counted_addressed_and_never_lost(make_bench: MakeBench) -> None:
    bench = make_bench((ACC, GYRO))
    asking, other = bench.service.connect(), bench.service.connect()
    for listener in (asking, other):
        for kind in (ACC, GYRO):
            bench.service.enable(listener, kind, 5_000, 0)
    for _ in range(5):
        bench.service.flush(asking)
    bench.advance_ms(60_000)
    asking.drop_overflow()
    assert asking.events_dropped > 0
    completes = []
    while asking:
        completes += asking.take(1000).flush_completes
    assert sorted(completes) == [ACC] * 5 + [GYRO] * 5
    assert other.flush_completes == 0


def test_timestamps_are_of_the_sample_and_strictly_increase_through_rate_changes() -> None:
    profile = load_profile("modern")
    clock = VirtualClock(5_000_000_000)
    service = SensorService(open_source("sim:pan", profile, clock), make_device_filter("dcm", profile), clock)
    staying = service.connect()
    service.enable(staying, GYRO, 20_000, 0)
    for period_us in (2_500, 66_667, 5_000, 10_000):
        other = service.connect()
        service.enable(other, GYRO, period_us, 0)
        clock.advance_to(clock.now_ns() + 1_000_000_000)
        service.advance()
        service.disconnect(other)
    times = _taken_ms(staying, GYRO)
    assert times == sorted(set(times))
    assert times[0] > 5_000
    assert times[-1] <= clock.now_ns() / 1e6


def test_fused_events_follow_the_accelerometers_at_20_hz_at_least_and_keep_its_timestamps(
    make_bench: MakeBench,
) -> None:
    bench = make_bench()
    listener = bench.service.connect()
    bench.service.enable(listener, SensorType.ROTATION_VECTOR, 200_000, 0)
    bench.service.enable(listener, ACC, 200_000, 0)
    bench.advance_ms(500)
    chunk = listener.take(1000)
    fused, measured = chunk.columns[SensorType.ROTATION_VECTOR], chunk.columns[ACC]
    assert fused.timestamp_ns.tolist() == measured.timestamp_ns.tolist()
    assert np.diff(fused.timestamp_ns).tolist() == [50_000_000] * 9


def test_a_fifo_that_is_full_is_delivered_early_without_loss(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,), fifo=10)
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 5_000, 10_000_000)
    assert bench.deadline_ms == 50
    bench.advance_ms(45)
    assert _taken_ms(listener, GYRO) == []
    bench.advance_ms(50)
    assert len(_taken_ms(listener, GYRO)) == 10


def test_a_fifo_filled_faster_than_asked_is_delivered_so_much_earlier() -> None:
    profile = load_profile("patonis2018")
    clock = VirtualClock(1_000_000_000)
    service = SensorService(open_source("sim:still", profile, clock), make_device_filter("dcm", profile), clock)
    listener = service.connect()
    service.enable(listener, ACC, 30_000, 10_000_000)  # the part has 15, 50 and 100 Hz: it runs at 50
    batches = []
    while len(batches) < 5:
        deadline_ns = service.next_deadline_ns()
        assert deadline_ns is not None
        clock.advance_to(deadline_ns)
        service.advance()
        batches.append(len(listener.take(1000)))
    assert all(31 <= events <= 33 for events in batches)


def test_a_slow_consumer_loses_its_oldest_events_and_keeps_their_order() -> None:
    connection = SensorEventConnection()
    connection.capacity = 10
    for first in (0, 8, 16):
        times = np.arange(first, first + 8, dtype=np.int64)
        connection.append(GYRO, EventColumn(times, np.zeros((8, 3)), np.full(8, 3, np.int8)))
        connection.drop_overflow()
    assert connection.take(100).columns[GYRO].timestamp_ns.tolist() == list(range(14, 24))
    assert connection.events_dropped == 14


def test_fusion_is_fed_what_apps_see(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.source.value = 1.23456
    listener = bench.service.connect()
    for kind in (ACC, SensorType.GRAVITY, SensorType.LINEAR_ACCELERATION):
        bench.service.enable(listener, kind, 20_000, 0)
    bench.advance_ms(100)
    columns = listener.take(1000).columns
    total = columns[SensorType.GRAVITY].values + columns[SensorType.LINEAR_ACCELERATION].values
    assert total == pytest.approx(columns[ACC].values, abs=1e-12)
