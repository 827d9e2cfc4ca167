"""The FIFO of one listener: order, oldest dropped first, flush-completes kept."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posed.events import EventColumn, SensorInfo, SensorType
from posed.sensors import SensorEventConnection
from posed.sensors.connection import SensorRegistration, cache_limit


def _column(first: int, count: int) -> EventColumn:
    times = np.arange(first, first + count, dtype=np.int64)
    return EventColumn(times, np.zeros((count, 3)), np.full(count, 3, np.int8))


def _connection(capacity: int) -> SensorEventConnection:
    connection = SensorEventConnection()
    connection.capacity = capacity
    return connection


def _drain(connection: SensorEventConnection, max_events: int) -> list[int]:
    times: list[int] = []
    while connection:
        for column in connection.take(max_events).columns.values():
            times += column.timestamp_ns.tolist()
    return times


def test_events_leave_in_the_order_they_came() -> None:
    connection = _connection(100)
    connection.append(1, _column(0, 3))
    connection.append(1, _column(3, 4))
    assert _drain(connection, max_events=2) == list(range(7))
    assert connection.events_dropped == 0


@given(st.lists(st.integers(1, 12), min_size=1, max_size=12), st.integers(1, 20), st.integers(1, 9))
def test_the_newest_stay_and_the_dropped_are_counted(sizes: list[int], capacity: int, max_events: int) -> None:
    connection = _connection(capacity)
    total = 0
    for size in sizes:
        connection.append(1, _column(total, size))
        connection.drop_overflow()
        total += size
    kept = min(total, capacity)
    assert connection.events_cached == kept
    assert connection.events_dropped == total - kept
    assert _drain(connection, max_events) == list(range(total - kept, total))
    assert connection.events_cached == 0


def test_a_message_ends_behind_a_flush_complete_so_that_order_holds() -> None:
    connection = _connection(100)
    connection.append(1, _column(0, 2))
    connection.append_flush_complete(1)
    connection.append(1, _column(2, 2))
    first, second = connection.take(100), connection.take(100)
    assert (first.columns[1].timestamp_ns.tolist(), first.flush_completes) == ([0, 1], (1,))
    assert (second.columns[1].timestamp_ns.tolist(), second.flush_completes) == ([2, 3], ())


def test_a_flush_complete_outlives_the_events_dropped_around_it() -> None:
    connection = _connection(2)
    connection.append(1, _column(0, 2))
    connection.append_flush_complete(1)
    connection.append(4, _column(2, 5))
    assert connection.drop_overflow() == 5
    assert connection.events_dropped == 5
    first, second = connection.take(100), connection.take(100)
    assert (first.columns, first.flush_completes) == ({}, (1,))
    assert second.columns[4].timestamp_ns.tolist() == [5, 6]


def _interleaved(connection: SensorEventConnection, count: int) -> None:
    for handle, first in ((1, 0), (4, 1)):
        times = np.arange(first, 2 * count, 2, dtype=np.int64)
        connection.append(handle, EventColumn(times, np.zeros((count, 3)), np.full(count, 3, np.int8)))


def test_what_does_not_fit_one_message_stays_in_order_over_all_sensors() -> None:
    connection = _connection(10_000)
    _interleaved(connection, 1500)
    newest = -1
    while connection:
        columns = connection.take(1000).columns.values()
        assert sum(map(len, columns)) == 1000
        assert min(int(column.timestamp_ns[0]) for column in columns) > newest
        newest = max(int(column.timestamp_ns[-1]) for column in columns)
    assert newest == 2999


def test_the_oldest_of_all_sensors_are_dropped() -> None:
    connection = _connection(10)
    _interleaved(connection, 8)
    assert connection.drop_overflow() == 6
    assert connection.events_dropped == 6
    taken = connection.take(100).columns
    assert [taken[handle].timestamp_ns.tolist() for handle in (1, 4)] == [[6, 8, 10, 12, 14], [7, 9, 11, 13, 15]]


def test_a_flush_complete_waits_for_the_events_before_it() -> None:
    connection = _connection(100)
    connection.append(1, _column(0, 5))
    connection.append_flush_complete(1)
    assert connection.take(3).flush_completes == ()
    assert connection.flush_completes == 1
    assert connection.take(3).flush_completes == (1,)
    assert connection.flush_completes == 0


def _sensor(reserved: int, fifo: int, wake_up: bool = False, handle: int = 1) -> SensorInfo:
    return SensorInfo(
        handle=handle,
        type=SensorType.ACCELEROMETER,
        name="a",
        vendor="v",
        version=1,
        max_range=20.0,
        resolution=0.01,
        power_ma=0.1,
        min_delay_us=5_000,
        max_delay_us=200_000,
        fifo_reserved_event_count=reserved,
        fifo_max_event_count=fifo,
        wake_up=wake_up,
    )


@pytest.mark.parametrize(
    ("fifos", "limit"),
    [
        ([(0, 0, False)], 984),
        ([(32, 32, False), (100, 100, False)], 132),
        ([(10, 300, False), (0, 500, False)], 500),
        ([(32, 32, False), (10, 300, False), (20, 400, True)], 732),
    ],
)
def test_the_cache_holds_what_the_hardware_fifos_would(fifos: list[tuple[int, int, bool]], limit: int) -> None:
    assert cache_limit([_sensor(*fifo) for fifo in fifos]) == limit


def test_the_cache_follows_the_sensors_of_the_listener() -> None:
    connection = SensorEventConnection()
    connection.add(SensorRegistration(_sensor(32, 32)))
    assert connection.capacity == 32
    connection.add(SensorRegistration(_sensor(100, 100, handle=4)))
    assert connection.capacity == 132
    connection.remove(1)
    assert connection.capacity == 100


def test_what_was_received_is_sent_cached_or_dropped() -> None:
    connection = _connection(10)
    connection.append(1, _column(0, 25))
    sent = len(connection.take(5))
    connection.drop_overflow()
    assert (connection.events_received, sent) == (25, 5)
    assert connection.events_received == sent + connection.events_cached + connection.events_dropped
