"""Sensors that do not tick: on-change, one-shot and special-trigger, and who joins them."""

from collections.abc import Callable
from typing import Any

import pytest

from posed.errors import InvalidStateError
from posed.events import SensorType
from posed.sensors import SensorEventConnection

LIGHT, MOTION, STEP = SensorType.LIGHT, SensorType.MOTION_DETECT, SensorType.STEP_DETECTOR
GYRO = SensorType.GYROSCOPE
MakeBench = Callable[..., Any]


def _taken(connection: SensorEventConnection, handle: int) -> list[float]:
    """Return the first values of a sensor's queued events."""
    values: list[float] = []
    while connection:
        column = connection.take(1000).columns.get(handle)
        values += [] if column is None else column.values[:, 0].tolist()
    return values


def test_an_on_change_sensor_tells_its_value_on_activation_and_then_its_changes(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT,))
    listener = bench.service.connect()
    bench.service.enable(listener, LIGHT, 0, 0)
    bench.advance_ms(10)
    assert _taken(listener, LIGHT) == [0]
    bench.source.happen(LIGHT, 50, 300)
    bench.advance_ms(60)
    assert _taken(listener, LIGHT) == [300]
    bench.advance_ms(500)
    assert _taken(listener, LIGHT) == []


def test_who_joins_an_on_change_sensor_gets_its_last_value_at_once(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT,))
    first, joiner = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, LIGHT, 0, 0)
    bench.source.happen(LIGHT, 50, 300)
    bench.advance_ms(60)
    bench.service.enable(joiner, LIGHT, 0, 0)
    assert _taken(joiner, LIGHT) == [300]
    bench.source.happen(LIGHT, 70, 310)
    bench.advance_ms(80)
    assert _taken(joiner, LIGHT) == [310]
    assert _taken(first, LIGHT) == [0, 300, 310]


def test_the_last_value_of_an_earlier_activation_is_not_told_to_a_joiner(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT,))
    first, second, joiner = (bench.service.connect() for _ in range(3))
    bench.service.enable(first, LIGHT, 0, 0)
    bench.source.happen(LIGHT, 50, 300)
    bench.advance_ms(60)
    bench.service.disable(first, LIGHT)
    bench.service.enable(second, LIGHT, 0, 0)
    bench.service.enable(joiner, LIGHT, 0, 0)
    assert _taken(joiner, LIGHT) == []


def test_a_joiner_of_a_batched_on_change_sensor_gets_the_last_value_once(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT, GYRO))
    first, joiner = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, LIGHT, 20_000, 10_000_000)
    bench.source.happen(LIGHT, 50, 300)
    bench.advance_ms(60)
    assert _taken(first, LIGHT) == []
    bench.service.enable(joiner, LIGHT, 20_000, 10_000_000)
    assert _taken(joiner, LIGHT) == [300]
    bench.service.flush(joiner)
    assert _taken(joiner, LIGHT) == []
    assert _taken(first, LIGHT) == [0, 300]


def test_a_batched_on_change_sensor_waits_for_its_latency_or_a_full_fifo(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT,), fifo=10)
    listener = bench.service.connect()
    bench.service.enable(listener, LIGHT, 0, 60_000_000)
    for number in range(8):
        bench.source.happen(LIGHT, 100 * number + 50, number)
    bench.advance_ms(1000)
    assert _taken(listener, LIGHT) == []
    assert bench.deadline_ms == 60_000
    bench.source.happen(LIGHT, 1050, 8)
    bench.advance_ms(1100)
    assert _taken(listener, LIGHT) == [0, *range(9)]


def test_a_one_shot_sensor_is_off_before_its_listener_hears_of_it(make_bench: MakeBench) -> None:
    bench = make_bench((MOTION, GYRO))
    listener, other = bench.service.connect(), bench.service.connect()
    for each in (listener, other):
        bench.service.enable(each, MOTION, 0, 0)
    bench.service.enable(other, GYRO, 20_000, 0)
    bench.source.happen(MOTION, 50, 1)
    bench.advance_ms(60)
    assert MOTION not in listener.registrations
    assert list(other.registrations) == [GYRO]
    assert bench.service.connections == (other,)
    assert _taken(listener, MOTION) == [1]
    assert _taken(other, MOTION) == [1]
    bench.source.happen(MOTION, 70, 1)
    bench.advance_ms(80)
    assert _taken(listener, MOTION) == []
    bench.service.enable(listener, MOTION, 0, 0)
    bench.source.happen(MOTION, 90, 1)
    bench.advance_ms(100)
    assert _taken(listener, MOTION) == [1]


def test_a_one_shot_sensor_that_saw_more_in_one_drain_fires_once(make_bench: MakeBench) -> None:
    bench = make_bench((MOTION,))
    listener = bench.service.connect()
    bench.service.enable(listener, MOTION, 0, 0)
    for at_ms in (10, 20, 30):
        bench.source.happen(MOTION, at_ms, 1)
    bench.advance_ms(60)
    assert _taken(listener, MOTION) == [1]


def test_a_special_trigger_sensor_tells_each_event_and_nothing_to_joiners(make_bench: MakeBench) -> None:
    bench = make_bench((STEP,))
    first, joiner = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, STEP, 0, 0)
    bench.source.happen(STEP, 10, 1)
    bench.source.happen(STEP, 20, 1)
    bench.advance_ms(30)
    bench.service.enable(joiner, STEP, 0, 0)
    assert _taken(joiner, STEP) == []
    assert _taken(first, STEP) == [1, 1]
    bench.source.happen(STEP, 40, 1)
    bench.advance_ms(50)
    assert _taken(joiner, STEP) == _taken(first, STEP) == [1]


def test_who_joins_a_running_continuous_sensor_waits_for_a_flush(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    first, joiner = bench.service.connect(), bench.service.connect()
    bench.service.enable(first, GYRO, 20_000, 1_000_000)
    bench.advance_ms(100)
    bench.source.flush_is_slow = True
    bench.service.enable(joiner, GYRO, 20_000, 1_000_000)
    bench.advance_ms(200)
    bench.service.flush(first)
    assert joiner.registrations[GYRO].first_flush_pending
    assert _taken(joiner, GYRO) == []
    bench.source.flush_is_slow = False
    bench.advance_ms(201)
    assert not joiner.registrations[GYRO].first_flush_pending
    bench.advance_ms(300)
    bench.service.flush(joiner)
    chunk = joiner.take(1000)
    assert chunk.columns[GYRO].timestamp_ns[0] == 220_000_000
    assert chunk.flush_completes == (GYRO,)


def test_on_change_and_special_sensors_have_no_flush_at_joining(make_bench: MakeBench) -> None:
    bench = make_bench((LIGHT, STEP))
    for kind in (LIGHT, STEP):
        for _ in range(2):
            listener = bench.service.connect()
            bench.service.enable(listener, kind, 0, 0)
            assert not listener.registrations[kind].first_flush_pending
    assert bench.source.flushes_asked == 0


def test_a_flush_completes_on_what_can_and_fails_for_a_one_shot_sensor(make_bench: MakeBench) -> None:
    bench = make_bench((MOTION, GYRO, LIGHT))
    listener = bench.service.connect()
    for kind in (MOTION, GYRO, LIGHT):
        bench.service.enable(listener, kind, 20_000, 0)
    with pytest.raises(InvalidStateError, match="MOTION_DETECT is a one-shot sensor"):
        bench.service.flush(listener)
    assert sorted(listener.take(1000).flush_completes) == [GYRO, LIGHT]
