"""The object "servicemanager": versions, bindings, and the life of the daemon."""

import os
from collections.abc import Mapping

from posed.binder.interface import check_version
from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.binder.stub import Caller, Stub
from posed.clock import Clock
from posed.daemon.clients import ClientRegistry
from posed.daemon.config import DaemonConfig
from posed.daemon.lifecycle import Lifecycle
from posed.errors import InvalidArgumentError
from posed.proto import binder_pb2, service_manager_pb2
from posed.version import __version__


class ServiceManagerStub(Stub):
    """IServiceManager over the daemon's life cycle."""

    descriptor = service_manager_pb2.DESCRIPTOR.services_by_name["IServiceManager"]

    def __init__(
        self,
        services: Mapping[str, Stub],
        peers: Mapping[bytes, Peer],
        lifecycle: Lifecycle,
        clients: ClientRegistry,
        clock: Clock,
        boot_id: bytes,
        config: DaemonConfig,
    ) -> None:
        self._services = services
        self._peers = peers
        self._lifecycle = lifecycle
        self._clients = clients
        self._clock = clock
        self._boot_id = boot_id
        self._config = config
        self._ready_ns = clock.now_ns()
        self._bindings: dict[Peer, Proxy | None] = {}

    def announce_end(self, reason: str) -> None:
        """Tell every bound client that the daemon ends on purpose."""
        for proxy in self._bindings.values():
            if proxy is not None:
                proxy.onBindingDied(service_manager_pb2.BindingDied(reason=reason))

    def getService(
        self, request: service_manager_pb2.GetServiceRequest, caller: Caller
    ) -> service_manager_pb2.ServiceInfo:
        if request.name not in self._services:
            raise InvalidArgumentError(f"there is no service {request.name!r}; there are {', '.join(self._services)}")
        interface = self._services[request.name].interface
        check_version(interface, request.interface)
        return service_manager_pb2.ServiceInfo(interface=interface.info, boot_id=self._boot_id)

    def bindService(self, request: service_manager_pb2.BindRequest, caller: Caller) -> binder_pb2.Empty:
        peer = caller.peer
        connection = peer.proxy(_CONNECTION, request.connection) if request.connection else None
        self._clients.register(peer, request)
        peer.link_to_death(self._peer_died)
        self._bindings[peer] = connection
        self._lifecycle.bind(peer, request.auto_create)
        return binder_pb2.Empty()

    def unbindService(self, request: binder_pb2.Empty, caller: Caller) -> binder_pb2.Empty:
        self._unbind(caller.peer)
        return binder_pb2.Empty()

    def startService(self, request: binder_pb2.Empty, caller: Caller) -> binder_pb2.Empty:
        self._lifecycle.start()
        return binder_pb2.Empty()

    def stopService(self, request: service_manager_pb2.StopRequest, caller: Caller) -> service_manager_pb2.StopReply:
        self._lifecycle.stop()
        if request.force:
            self._lifecycle.end()
        return service_manager_pb2.StopReply(
            stopping=self._lifecycle.over, bound_clients=self._lifecycle.keeping_clients
        )

    def getStatus(self, request: binder_pb2.Empty, caller: Caller) -> service_manager_pb2.ServiceStatus:
        return service_manager_pb2.ServiceStatus(
            boot_id=self._boot_id,
            pid=os.getpid(),
            uptime_ns=self._clock.now_ns() - self._ready_ns,
            started=self._lifecycle.started,
            bound_clients=self._lifecycle.bound_clients,
            connections=len(self._peers),
            source=self._config.source,
            profile=self._config.profile,
            filter=",".join(self._config.filters),
            version=__version__,
        )

    def _unbind(self, peer: Peer) -> None:
        self._bindings.pop(peer, None)
        self._lifecycle.unbind(peer)

    def _peer_died(self, peer: Peer) -> None:
        self._clients.forget(peer)
        self._unbind(peer)


_CONNECTION = service_manager_pb2.DESCRIPTOR.services_by_name["IServiceConnection"]
