"""Listeners whose sockets are full: order, the oldest dropped, and counts that add up."""

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from posed.binder.peer import Peer
from posed.clock import VirtualClock
from posed.daemon.listeners import Listeners
from posed.errors import InvalidArgumentError
from posed.events import EventColumn
from posed.proto import events_pb2
from posed.proto.binder_pb2 import Parcel
from posed.sensors import Client, SensorEventConnection


class Service:
    """Stands for the sensor service: only connecting matters here."""

    def connect(self, client: Client) -> SensorEventConnection:
        return SensorEventConnection(client)

    def disconnect(self, connection: SensorEventConnection) -> None:
        connection.registrations.clear()


class Reader:
    """A client's end that takes messages or does not."""

    def __init__(self) -> None:
        self.reads = True
        self.messages: list[events_pb2.SensorEvents] = []
        self.peer = Peer(b"p", 0, 77, self._send)

    def _send(self, parcel: bytes) -> bool:
        if self.reads:
            transaction = Parcel.FromString(parcel).transaction
            self.messages.append(events_pb2.SensorEvents.FromString(transaction.payload))
        return self.reads

    @property
    def times(self) -> list[int]:
        return [t for message in self.messages for column in message.columns for t in column.timestamp_ns]


def _header(sequence: int) -> events_pb2.DeliveryHeader:
    return events_pb2.DeliveryHeader(sequence=sequence)


def _column(first: int, count: int) -> EventColumn:
    times = np.arange(first, first + count, dtype=np.int64)
    return EventColumn(times, np.zeros((count, 16)), np.full(count, 3, np.int8))


@pytest.fixture
def make_listeners() -> Callable[[], Any]:
    return lambda: Listeners(Service(), VirtualClock(10**10))  # type: ignore[arg-type]


def test_what_does_not_fit_one_message_goes_in_several(make_listeners: Callable[[], Any]) -> None:
    listeners, reader = make_listeners(), Reader()
    listener = listeners.find_or_add(reader.peer, "l", Client())
    listener.connection.append(1, _column(0, 2000))
    listeners.deliver(_header)
    assert [len(message.columns[0].timestamp_ns) for message in reader.messages] == [800, 800, 400]
    assert [message.header.sequence for message in reader.messages] == [1, 2, 3]
    assert listeners.retry_s is None


def test_a_slow_consumer_loses_the_oldest_and_is_told_how_many(
    make_listeners: Callable[[], Any], caplog: pytest.LogCaptureFixture
) -> None:
    listeners, reader = make_listeners(), Reader()
    listener = listeners.find_or_add(reader.peer, "l", Client())
    listener.connection.capacity = 100
    reader.reads = False
    with caplog.at_level(logging.WARNING):
        for first in range(0, 500, 50):
            listener.connection.append(1, _column(first, 50))
            listener.connection.append_flush_complete(1)
            listeners.deliver(_header)
    # The first message was made already: it stands in the socket's buffer, as it were.
    assert listener.events_cached == 150
    assert listener.connection.events_dropped == 350
    assert len(caplog.records) == 1
    assert listeners.retry_s is not None
    reader.reads = True
    listeners.deliver(_header)
    assert reader.times == [*range(50), *range(400, 500)]
    assert sum(len(message.flush_completes) for message in reader.messages) == 10
    assert reader.messages[-1].events_dropped == 350
    assert listener.events_sent == len(reader.times)
    assert listener.connection.events_received == listener.events_sent + listener.connection.events_dropped


def test_a_listener_without_sensors_is_kept_until_its_last_event_is_sent(make_listeners: Callable[[], Any]) -> None:
    listeners, reader = make_listeners(), Reader()
    listener = listeners.find_or_add(reader.peer, "l", Client())
    listener.connection.append(30, _column(0, 1))
    reader.reads = False
    listeners.deliver(_header)
    assert listeners.find(reader.peer, "l") is listener
    reader.reads = True
    listeners.deliver(_header)
    assert reader.times == [0]
    assert listeners.find(reader.peer, "l") is None


def test_one_that_does_not_read_holds_nobody_up(make_listeners: Callable[[], Any]) -> None:
    listeners, stuck, sound = make_listeners(), Reader(), Reader()
    stuck.reads = False
    for reader in (stuck, sound):
        listeners.find_or_add(reader.peer, "l", Client()).connection.append(1, _column(0, 10))
    listeners.deliver(_header)
    assert (len(stuck.times), len(sound.times)) == (0, 10)


@pytest.mark.parametrize(("name", "said"), [("", "'' .* 0 characters"), ("x" * 256, "'x{40}' .* 256 characters")])
def test_a_listener_needs_a_name_that_leaves_room_for_its_events(
    make_listeners: Callable[[], Any], name: str, said: str
) -> None:
    listeners = make_listeners()
    with pytest.raises(InvalidArgumentError, match=said):
        listeners.find_or_add(Reader().peer, name, Client())
    assert list(listeners) == []


def test_the_longest_name_leaves_room_for_the_fullest_message(make_listeners: Callable[[], Any]) -> None:
    listeners, reader = make_listeners(), Reader()
    listener = listeners.find_or_add(reader.peer, "\U0001f4f1" * 255, Client())
    for _ in range(1000):
        listener.connection.append_flush_complete(1)
    # Times as they are: nanoseconds of days, irregular.
    times = np.cumsum(np.arange(5_000_001, 5_000_801, dtype=np.int64)) + 10**15
    listener.connection.append(1, EventColumn(times, np.ones((800, 16)), np.full(800, 3, np.int8)))
    listeners.deliver(_header)
    assert listener.events_sent == 800
    assert listener.connection.events_dropped == 0
