"""The object "sensorservice": listeners of sensor events, and the statistics."""

import logging
from collections.abc import Callable
from dataclasses import dataclass

from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.binder.stub import Caller, Stub
from posed.clock import Clock
from posed.daemon import encoding
from posed.daemon.statistics import PublicationStatistics, process_cpu_ns, voluntary_switches
from posed.errors import InvalidArgumentError, InvalidStateError, PosedError
from posed.proto import binder_pb2, events_pb2, sensors_pb2
from posed.sensors import SensorEventConnection, SensorService

_log = logging.getLogger(__name__)

# Keeps a message of the widest events (16 values) below 64 KiB: 800 * (8 + 16 * 4 + 1) bytes.
_EVENTS_A_MESSAGE = 800
# As SensorEventConnection.cpp: a listener that does not read is not to fill the log.
_DROP_LOG_INTERVAL_NS = 2_000_000_000


@dataclass(slots=True)
class _Listener:
    peer: Peer
    name: str
    proxy: Proxy
    connection: SensorEventConnection
    messages: int = 0
    events_sent: int = 0
    unsent: events_pb2.SensorEvents | None = None
    last_drop_ns: int = -(1 << 62)
    """When a drop was last told of, CLOCK_BOOTTIME."""


class SensorServiceStub(Stub):
    """ISensorService over the sensor service."""

    descriptor = sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]

    def __init__(
        self,
        service: SensorService,
        clock: Clock,
        publication: PublicationStatistics,
        parcels_refused: Callable[[], int],
    ) -> None:
        self._service = service
        self._parcels_refused = parcels_refused
        self._clock = clock
        self._publication = publication
        self._listeners: dict[tuple[Peer, str], _Listener] = {}
        self._watched: set[Peer] = set()

    def deliver(self, header: Callable[[int], events_pb2.DeliveryHeader]) -> None:
        """Send every listener what waits for it; what a full socket refuses stays for the next call.

        header makes the delivery header of a message from its sequence.
        """
        for listener in list(self._listeners.values()):
            while listener.unsent is not None or listener.connection:
                if listener.unsent is None:
                    chunk = listener.connection.take(_EVENTS_A_MESSAGE)
                    listener.messages += 1
                    listener.unsent = encoding.sensor_events(
                        header(listener.messages), chunk, listener.connection.events_dropped
                    )
                try:
                    sent = listener.proxy.onSensorEvents(listener.unsent)
                except PosedError:
                    # Whatever one listener's message fails of, the other listeners are not to suffer from it.
                    _log.exception("a message to listener %r of process %d is lost", listener.name, listener.peer.pid)
                    listener.unsent = None
                    continue
                if not sent:
                    self._drop_overflow(listener)
                    break
                listener.events_sent += sum(len(column.timestamp_ns) for column in listener.unsent.columns)
                listener.unsent = None
            self._forget_if_idle(listener)

    def getSensorList(self, request: binder_pb2.Empty, caller: Caller) -> sensors_pb2.SensorList:
        return encoding.sensor_list(self._service.sensors)

    def enableSensor(self, request: sensors_pb2.EnableSensorRequest, caller: Caller) -> binder_pb2.Empty:
        listener = self._listener(caller.peer, request.listener)
        try:
            self._service.enable(
                listener.connection, request.handle, request.sampling_period_us, request.max_report_latency_us
            )
        finally:
            self._forget_if_idle(listener)
        return binder_pb2.Empty()

    def disableSensor(self, request: sensors_pb2.DisableSensorRequest, caller: Caller) -> binder_pb2.Empty:
        listener = self._listeners.get((caller.peer, request.listener))
        if listener is not None:
            self._service.disable(listener.connection, request.handle)
            if not listener.connection.registrations:
                # Nobody is there any more for what still waits.
                del self._listeners[listener.peer, listener.name]
        return binder_pb2.Empty()

    def flush(self, request: sensors_pb2.FlushRequest, caller: Caller) -> binder_pb2.Empty:
        listener = self._listeners.get((caller.peer, request.listener))
        if listener is None:
            raise InvalidStateError(f"listener {request.listener!r} has no sensor registered: nothing to flush")
        self._service.flush(listener.connection)
        return binder_pb2.Empty()

    def getStatistics(self, request: binder_pb2.Empty, caller: Caller) -> sensors_pb2.Statistics:
        p50_ms, p99_ms = self._publication.lateness_percentiles_ms()
        return sensors_pb2.Statistics(
            timestamp_ns=self._clock.now_ns(),
            process_cpu_ns=process_cpu_ns(),
            source_cpu_ns=self._service.source_cpu_ns,
            filter_cpu_ns=self._service.filter_cpu_ns,
            wakeups=voluntary_switches(),
            events_fused=self._service.events_fused,
            poses_published=self._publication.published,
            poses_skipped=self._publication.skipped,
            lateness_p50_ms=p50_ms,
            lateness_p99_ms=p99_ms,
            sensors=[
                sensors_pb2.SensorStatistics(
                    handle=sensor.info.handle,
                    requested_period_us=sensor.params.sampling_period_ns // 1000 if sensor.params else 0,
                    configured_period_ns=sensor.configured_period_ns,
                    max_report_latency_us=(sensor.latency_ns or 0) // 1000,
                    registrations=len(sensor.requests),
                    events=sensor.events,
                )
                for sensor in self._service.active_sensors
            ],
            listeners=[
                sensors_pb2.ListenerStatistics(
                    uid=listener.peer.uid,
                    pid=listener.peer.pid,
                    listener=listener.name,
                    events_sent=listener.events_sent,
                    events_dropped=listener.connection.events_dropped,
                    events_cached=listener.connection.events_cached,
                )
                for listener in self._listeners.values()
            ],
            parcels_refused=self._parcels_refused(),
            source_ended=self._service.ended,
        )

    def _listener(self, peer: Peer, name: str) -> _Listener:
        if not name:
            raise InvalidArgumentError("the request names no listener; give the name of its callback object")
        listener = self._listeners.get((peer, name))
        if listener is None:
            proxy = peer.proxy(sensors_pb2.DESCRIPTOR.services_by_name["ISensorEventListener"], name)
            listener = _Listener(peer, name, proxy, self._service.connect())
            if peer not in self._watched:
                self._watched.add(peer)
                peer.link_to_death(lambda: self._peer_died(peer))
            self._listeners[peer, name] = listener
        return listener

    def _forget_if_idle(self, listener: _Listener) -> None:
        # A one-shot sensor leaves its listener before its event does.
        waits = listener.unsent is not None or listener.connection
        if not listener.connection.registrations and not waits:
            self._listeners.pop((listener.peer, listener.name), None)

    def _drop_overflow(self, listener: _Listener) -> None:
        dropped = listener.connection.drop_overflow()
        if dropped and self._clock.now_ns() - listener.last_drop_ns > _DROP_LOG_INTERVAL_NS:
            listener.last_drop_ns = self._clock.now_ns()
            _log.warning(
                "listener %r of process %d does not read: %d events dropped, %d in all",
                listener.name,
                listener.peer.pid,
                dropped,
                listener.connection.events_dropped,
            )

    def _peer_died(self, peer: Peer) -> None:
        self._watched.discard(peer)
        for key in [key for key in self._listeners if key[0] is peer]:
            self._service.disconnect(self._listeners.pop(key).connection)
