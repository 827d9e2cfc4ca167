"""A source that dies and comes back: its clients see a gap, never an error."""

import itertools
import logging
from collections.abc import Callable
from typing import Any

import pytest

from posed.errors import InvalidArgumentError
from posed.events import SensorInfo, SensorType
from posed.sensors import SensorEventConnection

ACC, MAG, GYRO, LIGHT = (
    SensorType.ACCELEROMETER,
    SensorType.MAGNETIC_FIELD,
    SensorType.GYROSCOPE,
    SensorType.LIGHT,
)
MakeBench = Callable[..., Any]


def _taken_ms(connection: SensorEventConnection, handle: int) -> list[float]:
    times: list[float] = []
    while connection:
        column = connection.take(1000).columns.get(handle)
        times += [] if column is None else [t / 1e6 for t in column.timestamp_ns.tolist()]
    return times


def test_a_returned_source_is_batched_and_activated_anew_by_itself(
    make_bench: MakeBench, caplog: pytest.LogCaptureFixture
) -> None:
    bench = make_bench((GYRO,))
    fast, slow = bench.service.connect(), bench.service.connect()
    bench.service.enable(fast, GYRO, 20_000, 0)
    bench.service.enable(slow, GYRO, 100_000, 0)
    bench.advance_ms(100)
    bench.source.lose()
    bench.source.calls.clear()
    with caplog.at_level(logging.WARNING):
        for now_ms in (120, 400, 700, 1000):
            bench.advance_ms(now_ms)
    assert [record.message.split(";")[0] for record in caplog.records] == ["the source is lost"]
    assert bench.source.calls == []
    bench.source.is_lost = False
    bench.advance_ms(1200)
    assert bench.source.calls == [("batch", GYRO, 20_000_000, 0), ("activate", GYRO, True)]
    bench.advance_ms(1300)
    for listener in (fast, slow):
        times = _taken_ms(listener, GYRO)
        assert times[:5] == [20, 40, 60, 80, 100]
        assert times == sorted(set(times))
        assert max(b - a for a, b in itertools.pairwise(times)) > 1000
        assert times[-1] == 1300


def test_the_service_wakes_to_try_again_while_the_source_is_lost(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    bench.service.enable(bench.service.connect(), GYRO, 20_000, 0)
    bench.advance_ms(100)
    bench.source.lose()
    bench.advance_ms(120)
    assert bench.deadline_ms == 620


def test_registering_flushing_and_leaving_work_while_the_source_is_lost(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO, ACC))
    first, joiner, leaving = (bench.service.connect() for _ in range(3))
    bench.service.enable(first, GYRO, 20_000, 0)
    bench.service.enable(leaving, ACC, 20_000, 0)
    bench.advance_ms(100)
    bench.source.lose()
    bench.service.enable(joiner, GYRO, 5_000, 0)
    bench.service.disconnect(leaving)
    bench.service.flush(joiner)
    while (chunk := joiner.take(1000)) and not chunk.flush_completes:
        pass
    assert chunk.flush_completes == (GYRO,)
    bench.source.is_lost = False
    bench.source.calls.clear()
    bench.advance_ms(1000)
    assert bench.source.calls == [("batch", GYRO, 5_000_000, 0), ("activate", GYRO, True)]
    bench.advance_ms(1010)
    assert _taken_ms(joiner, GYRO)[-1] == 1010


def test_poses_go_on_while_the_source_is_lost(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("a", 100_000, 20_000)
    bench.advance_ms(120)
    bench.service.take_poses()
    bench.source.lose()
    for now_ms in (220, 320, 420):
        bench.advance_ms(now_ms)
    poses = bench.service.take_poses()
    assert [pose.events_fused for pose in poses] == [0, 0, 0]
    bench.source.is_lost = False
    bench.advance_ms(1000)
    bench.advance_ms(1220)
    assert bench.service.take_poses()[-1].events_fused > 0


def _dynamic(handle: int) -> SensorInfo:
    return SensorInfo(
        handle=handle,
        type=SensorType.LIGHT,
        name="Clip-on Light",
        vendor="test",
        version=1,
        max_range=1000.0,
        resolution=1.0,
        power_ma=0.0,
        min_delay_us=10_000,
        max_delay_us=0,
        is_dynamic=True,
    )


def _with_a_dynamic_sensor(make_bench: MakeBench) -> tuple[Any, SensorEventConnection]:
    """Return a bench 20 ms on and a listener of its gyroscope and of the sensor that came."""
    bench = make_bench((GYRO,))
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 20_000, 0)
    bench.source.connected = (_dynamic(1000),)
    bench.advance_ms(20)
    bench.service.enable(listener, 1000, 20_000, 0)
    return bench, listener


def test_a_dynamic_sensor_comes_serves_and_goes(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    listener = bench.service.connect()
    bench.service.enable(listener, GYRO, 20_000, 0)
    bench.source.connected = (_dynamic(1000),)
    bench.advance_ms(20)
    assert [info.handle for info in bench.service.dynamic_sensors] == [1000]
    assert 1000 not in [info.handle for info in bench.service.sensors]
    assert bench.service.dynamic_changes == 1
    bench.service.enable(listener, 1000, 20_000, 0)
    bench.source.disconnected = (1000,)
    bench.advance_ms(40)
    assert bench.service.dynamic_sensors == ()
    assert list(listener.registrations) == [GYRO]
    assert bench.service.dynamic_changes == 2


def test_a_lost_source_takes_its_dynamic_sensors_along(make_bench: MakeBench) -> None:
    bench, _ = _with_a_dynamic_sensor(make_bench)
    bench.source.lose()
    bench.advance_ms(40)
    assert bench.service.dynamic_sensors == ()
    bench.source.is_lost = False
    bench.source.calls.clear()
    bench.advance_ms(1000)
    assert [call[1] for call in bench.source.calls] == [GYRO, GYRO]


def test_a_sensor_that_the_source_refuses_leaves_no_trace(
    make_bench: MakeBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make_bench((GYRO,))
    listener = bench.service.connect()

    def refuse(*_: int) -> int:
        raise InvalidArgumentError("no such period")

    with monkeypatch.context() as patched:
        patched.setattr(bench.source, "batch", refuse)
        with pytest.raises(InvalidArgumentError, match="no such period"):
            bench.service.enable(listener, GYRO, 20_000, 0)
    assert listener.registrations == {}
    assert bench.service.connections == ()
    bench.service.enable(listener, GYRO, 20_000, 0)
    bench.advance_ms(100)
    assert _taken_ms(listener, GYRO) == [20, 40, 60, 80, 100]


def test_a_flush_of_a_dynamic_sensor_that_went_is_forgotten_with_it(make_bench: MakeBench) -> None:
    bench, listener = _with_a_dynamic_sensor(make_bench)
    bench.source.flush_is_slow = True
    bench.service.flush(listener)
    bench.source.disconnected = (1000,)
    bench.advance_ms(40)
    bench.source.lose()
    bench.advance_ms(60)
    flushed: list[int] = []
    while listener:
        flushed += listener.take(1000).flush_completes
    assert flushed == [GYRO]


def test_what_a_returned_source_makes_of_a_period_is_taken_over(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO, ACC))
    bench.service.enable(bench.service.connect(), GYRO, 20_000, 0)
    bench.source.lose()
    bench.advance_ms(20)
    bench.service.enable(bench.service.connect(), ACC, 60_000, 0)
    configured = {sensor.info.handle: sensor for sensor in bench.service.active_sensors}
    assert configured[ACC].configured_period_ns == 60_000_000
    bench.source.is_lost = False
    bench.source.batch = lambda handle, period_ns, latency_ns: period_ns // 2
    bench.advance_ms(1000)
    assert configured[ACC].configured_period_ns == 30_000_000
    assert configured[GYRO].configured_period_ns == 10_000_000


def test_events_of_a_dynamic_sensor_that_went_are_nobodys(make_bench: MakeBench) -> None:
    bench, listener = _with_a_dynamic_sensor(make_bench)
    bench.source.disconnected = (1000,)
    bench.advance_ms(40)
    assert 1000 in bench.source._done_ns
    bench.advance_ms(80)
    assert _taken_ms(listener, GYRO)[-1] == 80
