"""From the daemon's messages to a listener's callbacks."""

import logging
from typing import Any

import pytest

from posed.binder.peer import Peer
from posed.binder.stub import Caller
from posed.client import (
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    SENSOR_DELAY_UI,
    Handler,
    Sensor,
    SensorEvent,
    TriggerEvent,
)
from posed.client.event_queue import EventQueue, Registration, SensorEventQueue, TriggerEventQueue
from posed.client.sensor import period_of_delay_us
from posed.proto import events_pb2, sensors_pb2

CALLER = Caller(Peer(b"", 0, 0, lambda _: True))
ACC, GYRO, ROTATION = (
    Sensor.of_message(sensors_pb2.SensorInfo(handle=handle, type=handle, name=str(handle))) for handle in (1, 4, 11)
)


class Listener:
    def __init__(self) -> None:
        self.said: list[Any] = []

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.said.append((event.sensor.handle, event.timestamp, event.accuracy))

    def on_accuracy_changed(self, sensor: Sensor, accuracy: int) -> None:
        self.said.append(("accuracy", sensor.handle, accuracy))

    def on_flush_completed(self, sensor: Sensor) -> None:
        self.said.append(("flushed", sensor.handle))


def _queue(listener: Any, *sensors: Sensor, handler: Handler | None = None) -> SensorEventQueue:
    queue = SensorEventQueue("q", handler, listener)
    queue.registrations.update({sensor.handle: Registration(sensor, 0, 0) for sensor in sensors})
    return queue


def _send(queue: EventQueue, *columns: tuple[int, list[int], list[int]], flushes: tuple[int, ...] = ()) -> None:
    """Send columns of (handle, timestamps, accuracies)."""
    queue.onSensorEvents(
        events_pb2.SensorEvents(
            columns=[
                events_pb2.SensorColumn(handle=handle, timestamp_ns=times, values=[1.0] * len(times), accuracy=accuracy)
                for handle, times, accuracy in columns
            ],
            flush_completes=flushes,
        ),
        CALLER,
    )


def test_rate_codes_are_not_periods() -> None:
    codes = (SENSOR_DELAY_FASTEST, SENSOR_DELAY_GAME, SENSOR_DELAY_UI, SENSOR_DELAY_NORMAL)
    assert [period_of_delay_us(code) for code in codes] == [0, 20_000, 66_667, 200_000]
    assert codes == (0, 1, 2, 3)
    assert [period_of_delay_us(period) for period in (4, 100_000, -1)] == [4, 100_000, -1]


def test_accuracy_is_told_on_change_only_before_the_event_and_begins_at_zero() -> None:
    listener = Listener()
    queue = _queue(listener, GYRO)
    _send(queue, (4, [1, 2, 3, 4, 5], [0, 3, 3, -1, 1]))
    assert listener.said == [
        (4, 1, 0),
        ("accuracy", 4, 3),
        (4, 2, 3),
        (4, 3, 3),
        (4, 4, -1),
        ("accuracy", 4, 1),
        (4, 5, 1),
    ]


def test_types_without_a_status_are_told_as_high() -> None:
    listener = Listener()
    _send(_queue(listener, ROTATION), (11, [1], [0]))
    assert listener.said == [("accuracy", 11, 3), (11, 1, 3)]


def test_events_of_all_sensors_come_in_time_order_and_flushes_behind_them() -> None:
    listener = Listener()
    queue = _queue(listener, ACC, GYRO)
    queue.accuracies = {1: 3, 4: 3}
    _send(queue, (4, [1, 3], [3]), (1, [2, 3], [3]), flushes=(4,))
    assert listener.said == [(4, 1, 3), (1, 2, 3), (1, 3, 3), (4, 3, 3), ("flushed", 4)]


def test_what_is_still_under_way_when_its_sensor_is_unregistered_is_dropped() -> None:
    listener = Listener()
    queue = _queue(listener, GYRO)
    _send(queue, (1, [1], [3]), flushes=(1,))
    assert listener.said == []


def test_a_listener_may_do_without_the_other_callbacks() -> None:
    class Bare:
        seen = 0

        def on_sensor_changed(self, event: SensorEvent) -> None:
            self.seen += 1

    bare = Bare()
    _send(_queue(bare, GYRO), (4, [1], [3]), flushes=(4,))
    assert bare.seen == 1


def test_a_callback_that_raises_is_logged_with_its_listeners_name_and_the_next_runs(
    caplog: pytest.LogCaptureFixture,
) -> None:
    class Broken(Listener):
        def on_sensor_changed(self, event: SensorEvent) -> None:
            super().on_sensor_changed(event)
            raise RuntimeError("on purpose")

    broken = Broken()
    with caplog.at_level(logging.ERROR):
        _send(_queue(broken, ROTATION), (11, [1, 2], [3]))
    assert [timestamp for handle, timestamp, _ in broken.said if handle == 11] == [1, 2]
    assert "Broken.on_sensor_changed failed" in caplog.text


def test_with_a_handler_callbacks_run_when_it_is_pumped() -> None:
    listener, handler = Listener(), Handler()
    queue = _queue(listener, GYRO, handler=handler)
    _send(queue, (4, [1], [0]))
    _send(queue, (4, [2], [0]), flushes=(4,))
    assert listener.said == []
    assert handler.run_pending() == 3
    assert listener.said == [(4, 1, 0), (4, 2, 0), ("flushed", 4)]
    _send(queue, (4, [3], [0]))
    assert handler.run_pending() == 1


def test_a_callback_that_ends_the_handlers_run_is_the_last_and_the_rest_waits() -> None:
    class Quitting(Listener):
        def on_sensor_changed(self, event: SensorEvent) -> None:
            super().on_sensor_changed(event)
            if event.timestamp == 1:
                handler.quit()
            if event.timestamp == 2:
                raise SystemExit

    listener, handler = Quitting(), Handler()
    _send(_queue(listener, GYRO, handler=handler), (4, [1, 2, 3], [0]))
    handler.run()
    assert listener.said == [(4, 1, 0)]
    with pytest.raises(SystemExit):
        handler.run_pending()
    assert handler.run_pending() == 1
    assert listener.said == [(4, 1, 0), (4, 2, 0), (4, 3, 0)]


def test_a_handler_that_nobody_pumps_loses_the_oldest_events_but_no_flush_complete() -> None:
    listener, handler = Listener(), Handler()
    queue = _queue(listener, GYRO, handler=handler)
    _send(queue, (4, [0], [0]), flushes=(4,))
    for first in range(1, 12_001, 800):
        _send(queue, (4, list(range(first, first + 800)), [0]))
    assert queue.events_dropped == 2001
    handler.run_pending()
    assert listener.said[0] == ("flushed", 4)
    assert [said[1] for said in listener.said[1:]] == list(range(2001, 12_001))


def test_a_trigger_request_is_over_before_its_listener_hears_of_it() -> None:
    seen: list[Any] = []

    class Trigger:
        def on_trigger(self, event: TriggerEvent) -> None:
            seen.append((event.sensor.handle, event.timestamp, event.values, dict(queue.registrations)))

    queue = TriggerEventQueue("t", Trigger(), lambda queue, handle: queue.registrations.pop(handle) and None)
    queue.registrations[4] = Registration(GYRO, 0, 0)
    _send(queue, (4, [7, 8], [3]))
    assert seen == [(4, 7, (1.0,), {})]
