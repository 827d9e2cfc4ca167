"""The listeners of sensor events on their connections: what waits for each, and its way onto the socket."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.clock import Clock
from posed.daemon import encoding
from posed.errors import PosedError
from posed.proto import events_pb2, sensors_pb2
from posed.sensors import Client, SensorEventConnection, SensorService

_log = logging.getLogger(__name__)

# Keeps a message of the widest events (16 values) and of the most flush-completes below 64 KiB:
# 800 * (8 + 16 * 4 + 1) + 1000 * 5 bytes.
_EVENTS_A_MESSAGE = 800
# As SensorEventConnection.cpp: a listener that does not read is not to fill the log.
_DROP_LOG_INTERVAL_NS = 2_000_000_000
# ZeroMQ does not tell when a full queue has room again.
RETRY_S = 0.02


@dataclass(slots=True)
class Listener:
    """One callback object of a client and the events on their way to it."""

    peer: Peer
    name: str
    proxy: Proxy
    connection: SensorEventConnection
    messages: int = 0
    events_sent: int = 0
    unsent: events_pb2.SensorEvents | None = None
    """A message that the socket refused."""
    unsent_events: int = 0
    last_drop_ns: int = -(1 << 62)
    """When a drop was last told of, CLOCK_BOOTTIME."""

    @property
    def waits(self) -> bool:
        """True if something is to be sent."""
        return self.unsent is not None or bool(self.connection)

    @property
    def events_cached(self) -> int:
        """Events that are to be sent."""
        return self.connection.events_cached + self.unsent_events


class Listeners:
    """All of them, by the process and the name of the callback object."""

    def __init__(self, service: SensorService, clock: Clock) -> None:
        self._service = service
        self._clock = clock
        self._listeners: dict[tuple[Peer, str], Listener] = {}
        self.retry_s: float | None = None
        """When to deliver again though nothing is due: seconds from now; None if nobody's queue is full."""

    def __iter__(self) -> Iterator[Listener]:
        return iter(self._listeners.values())

    def find(self, peer: Peer, name: str) -> Listener | None:
        """Return a listener, None if it has no sensor."""
        return self._listeners.get((peer, name))

    def find_or_add(self, peer: Peer, name: str, client: Client) -> Listener:
        """Return a listener, a new one if need be; raises InvalidArgumentError if it has no name, or a long one."""
        listener = self._listeners.get((peer, name))
        if listener is None:
            listener = Listener(peer, name, peer.proxy(_LISTENER, name), self._service.connect(client))
            self._listeners[peer, name] = listener
        return listener

    def forget_if_idle(self, listener: Listener) -> None:
        """Let go of a listener that has no sensor, once all its events are sent: a one-shot sensor leaves before."""
        if not listener.connection.registrations and not listener.waits:
            self._listeners.pop((listener.peer, listener.name), None)

    def forget(self, listener: Listener) -> None:
        """Let go of a listener with all that waits for it."""
        self._service.disconnect(listener.connection)
        self._listeners.pop((listener.peer, listener.name), None)

    def forget_all_of(self, peer: Peer) -> None:
        """Let go of the listeners of a process that is gone."""
        for listener in [each for each in self._listeners.values() if each.peer is peer]:
            self.forget(listener)

    def deliver(self, header: Callable[[int], events_pb2.DeliveryHeader]) -> None:
        """Send every listener what waits for it; what a full socket refuses stays for the next call.

        header makes the delivery header of a message from its sequence.
        """
        self.retry_s = None
        if not self._listeners:
            return
        for listener in list(self._listeners.values()):
            while listener.waits:
                if not self._send(listener, header):
                    self.retry_s = RETRY_S
                    self._drop_overflow(listener)
                    break
            self.forget_if_idle(listener)

    def _send(self, listener: Listener, header: Callable[[int], events_pb2.DeliveryHeader]) -> bool:
        """Send the next message of a listener; False if the socket is full."""
        connection = listener.connection
        if listener.unsent is None:
            chunk = connection.take(_EVENTS_A_MESSAGE)
            listener.messages += 1
            listener.unsent_events = len(chunk)
            listener.unsent = encoding.sensor_events(header(listener.messages), chunk, connection.events_dropped)
        try:
            if not listener.proxy.onSensorEvents(listener.unsent):
                return False
            listener.events_sent += listener.unsent_events
        except PosedError:
            # Whatever one listener's message fails of, the other listeners are not to suffer from it.
            _log.exception("a message to listener %r of process %d is lost", listener.name, listener.peer.pid)
            connection.events_dropped += listener.unsent_events
        listener.unsent = None
        listener.unsent_events = 0
        return True

    def _drop_overflow(self, listener: Listener) -> None:
        dropped = listener.connection.drop_overflow()
        now_ns = self._clock.now_ns()
        if dropped and now_ns - listener.last_drop_ns > _DROP_LOG_INTERVAL_NS:
            listener.last_drop_ns = now_ns
            _log.warning(
                "listener %r of process %d does not read: %d events dropped, %d in all",
                listener.name,
                listener.peer.pid,
                dropped,
                listener.connection.events_dropped,
            )


_LISTENER = sensors_pb2.DESCRIPTOR.services_by_name["ISensorEventListener"]
