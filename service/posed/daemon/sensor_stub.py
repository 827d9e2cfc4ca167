"""The object "sensorservice": the sensor list, listeners of events, dynamic sensors, the state and the statistics."""

import time
from collections.abc import Callable

from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.binder.stub import Caller, Stub
from posed.clock import Clock
from posed.daemon import encoding
from posed.daemon.clients import ClientRegistry
from posed.daemon.listeners import RETRY_S, Listeners
from posed.daemon.statistics import PublicationStatistics, process_cpu_ns, voluntary_switches
from posed.errors import InvalidArgumentError, InvalidStateError
from posed.events import SensorType
from posed.fusion.kernel import kernel
from posed.proto import binder_pb2, events_pb2, sensors_pb2
from posed.sensors import SensorService

# Characters of a dump in one reply: of UTF-8's four bytes each, still below 64 KiB.
_DUMP_PART = 16_000


class SensorServiceStub(Stub):
    """ISensorService over the sensor service."""

    descriptor = sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]

    def __init__(
        self,
        service: SensorService,
        clients: ClientRegistry,
        clock: Clock,
        publication: PublicationStatistics,
        parcels_refused: Callable[[], int],
    ) -> None:
        self._service = service
        self._clients = clients
        self._clock = clock
        self._publication = publication
        self._parcels_refused = parcels_refused
        self._listeners = Listeners(service, clock)
        self._dynamic_callbacks: dict[tuple[Peer, str], Proxy] = {}
        self._dynamic_changes_told: dict[tuple[Peer, str], int] = {}
        """What each callback knows of, by the service's count of changes."""
        self._dumps: dict[Peer, str] = {}

    @property
    def retry_s(self) -> float | None:
        """When to deliver again though nothing is due, seconds from now; None if nothing is held up."""
        if self._listeners.retry_s is None and self._untold():
            return RETRY_S
        return self._listeners.retry_s

    def deliver(self, header: Callable[[int], events_pb2.DeliveryHeader]) -> None:
        """Send what waits for listeners and callbacks; header makes a message's from its sequence."""
        self._listeners.deliver(header)
        for key in self._untold():
            client = self._clients.of(key[0])
            message = encoding.sensor_list(client.sees(info) for info in self._service.dynamic_sensors)
            # What a full socket refuses is tried again: the list, not the change, is told.
            if self._dynamic_callbacks[key].onDynamicSensorsChanged(message):
                self._dynamic_changes_told[key] = self._service.dynamic_changes

    def _untold(self) -> list[tuple[Peer, str]]:
        if not self._dynamic_callbacks:
            return []
        changes = self._service.dynamic_changes
        return [key for key in self._dynamic_callbacks if self._dynamic_changes_told[key] != changes]

    # ISensorService

    def getSensorList(self, request: binder_pb2.Empty, caller: Caller) -> sensors_pb2.SensorList:
        client = self._clients.of(caller.peer)
        return encoding.sensor_list(client.sees(info) for info in self._service.sensors)

    def getDynamicSensorList(self, request: binder_pb2.Empty, caller: Caller) -> sensors_pb2.SensorList:
        client = self._clients.of(caller.peer)
        return encoding.sensor_list(client.sees(info) for info in self._service.dynamic_sensors)

    def enableSensor(self, request: sensors_pb2.EnableSensorRequest, caller: Caller) -> binder_pb2.Empty:
        listener = self._listeners.find_or_add(caller.peer, request.listener, self._clients.of(caller.peer))
        caller.peer.link_to_death(self._peer_died)
        try:
            self._service.enable(
                listener.connection,
                request.handle,
                request.sampling_period_us,
                request.max_report_latency_us,
                request.decimate,
            )
        finally:
            self._listeners.forget_if_idle(listener)
        return binder_pb2.Empty()

    def disableSensor(self, request: sensors_pb2.DisableSensorRequest, caller: Caller) -> binder_pb2.Empty:
        listener = self._listeners.find(caller.peer, request.listener)
        if listener is not None:
            self._service.disable(listener.connection, request.handle)
            if not listener.connection.registrations:
                # Nobody is there any more for what still waits.
                self._listeners.forget(listener)
        return binder_pb2.Empty()

    def flush(self, request: sensors_pb2.FlushRequest, caller: Caller) -> binder_pb2.Empty:
        listener = self._listeners.find(caller.peer, request.listener)
        if listener is None:
            raise InvalidStateError(f"listener {request.listener!r} has no sensor registered: nothing to flush")
        self._service.flush(listener.connection)
        return binder_pb2.Empty()

    def registerDynamicSensorCallback(
        self, request: sensors_pb2.DynamicSensorCallbackRequest, caller: Caller
    ) -> binder_pb2.Empty:
        key = (caller.peer, request.callback)
        self._dynamic_callbacks[key] = caller.peer.proxy(_DYNAMIC_CALLBACK, request.callback)
        caller.peer.link_to_death(self._peer_died)
        self._dynamic_changes_told.setdefault(key, self._service.dynamic_changes)
        return binder_pb2.Empty()

    def unregisterDynamicSensorCallback(
        self, request: sensors_pb2.DynamicSensorCallbackRequest, caller: Caller
    ) -> binder_pb2.Empty:
        self._dynamic_callbacks.pop((caller.peer, request.callback), None)
        self._dynamic_changes_told.pop((caller.peer, request.callback), None)
        return binder_pb2.Empty()

    def setEnvironment(self, request: sensors_pb2.SetEnvironmentRequest, caller: Caller) -> binder_pb2.Empty:
        try:
            kind = SensorType(request.type)
        except ValueError:
            raise InvalidArgumentError(f"sensor type {request.type} is unknown; give one of the sensor list") from None
        self._service.set_environment(kind, request.value)
        return binder_pb2.Empty()

    def dump(self, request: sensors_pb2.DumpRequest, caller: Caller) -> sensors_pb2.DumpReply:
        from posed.sensors.dump import Traffic, dump  # memory that few daemons ever need

        peer = caller.peer
        if request.offset == 0:
            peer.link_to_death(self._peer_died)
            traffic = {each.connection: Traffic(each.events_sent, each.events_cached) for each in self._listeners}
            self._dumps[peer] = dump(self._service, self._clock.now_ns(), time.time_ns(), traffic)
        text = self._dumps.get(peer, "")
        end = request.offset + _DUMP_PART
        more = end < len(text)
        if not more:
            self._dumps.pop(peer, None)
        return sensors_pb2.DumpReply(text=text[request.offset : end], more=more)

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
                    events_cached=listener.events_cached,
                    package_name=listener.connection.client.package_name,
                    events_received=listener.connection.events_received,
                )
                for listener in self._listeners
            ],
            parcels_refused=self._parcels_refused(),
            source_ended=self._service.ended,
            filters_compiled=kernel() == "compiled",
        )

    # Private

    def _peer_died(self, peer: Peer) -> None:
        self._dumps.pop(peer, None)
        self._listeners.forget_all_of(peer)
        for key in [key for key in self._dynamic_callbacks if key[0] is peer]:
            del self._dynamic_callbacks[key]
            del self._dynamic_changes_told[key]


_DYNAMIC_CALLBACK = sensors_pb2.DESCRIPTOR.services_by_name["IDynamicSensorCallback"]
