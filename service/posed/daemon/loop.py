"""The daemon's one loop in one thread: poll until the next deadline, drain, fuse, deliver, publish."""

import contextlib
import ctypes
import gc
import logging
import os
import signal
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

from posed.binder.runtime import InstanceLock, control_path, pose_path, runtime_directory
from posed.binder.server import Server
from posed.binder.sockets import Socket, context
from posed.binder.stub import Stub
from posed.clock import BootClock, Clock
from posed.daemon.clients import ClientRegistry
from posed.daemon.config import DaemonConfig
from posed.daemon.encoding import delivery_header
from posed.daemon.lifecycle import Lifecycle
from posed.daemon.manager_stub import ServiceManagerStub
from posed.daemon.notify import sd_notify
from posed.daemon.pose_stub import PoseServiceStub
from posed.daemon.publisher import PosePublisher
from posed.daemon.sensor_stub import SensorServiceStub
from posed.daemon.statistics import PublicationStatistics
from posed.daemon.waiting import Waiter
from posed.hal import open_source
from posed.hal.profile import load_profile
from posed.proto import events_pb2
from posed.sensors import SensorService, device_errors, make_device_filter
from posed.sensors.declination import declination_at

_log = logging.getLogger(__name__)

# A client that had the daemon started binds within milliseconds of its readiness; one that died meanwhile never does.
_FIRST_BIND_WAIT_NS = 10_000_000_000


def run(config: DaemonConfig) -> None:
    """Serve until told to stop (SIGTERM, SIGINT, stopService, the last unbind).

    Raises AlreadyRunningError if another daemon of this user runs, and any PosedError that the source, the profile or
    the runtime directory gives rise to.
    """
    directory = runtime_directory()
    lock = InstanceLock(directory)
    lock.acquire()
    try:
        daemon = _Daemon(config, BootClock(), directory)
        try:
            daemon.serve()
        finally:
            daemon.close()
    finally:
        lock.release()


class _Daemon:
    def __init__(self, config: DaemonConfig, clock: Clock, directory: Path) -> None:
        self._clock = clock
        self._boot_id = os.urandom(16)
        self._lifecycle = Lifecycle(config.started)
        self._signal: int | None = None
        profile = load_profile(config.profile)
        self._source = open_source(
            config.source, profile, clock, seed=config.seed, speed=config.speed, loop=config.loop
        )
        first, *beside = (make_device_filter(name, profile) for name in config.filters)
        self._service = SensorService(
            self._source,
            first,
            clock,
            config.position,
            beside=beside,
            aligned=config.aligned,
            declination=declination_at(config.position),
            errors=device_errors(profile),
        )
        self._context = context()
        self._server = Server(control_path(directory), self._context)
        statistics = PublicationStatistics()
        try:
            self._publisher = PosePublisher(
                pose_path(directory), self._context, self._boot_id, clock, self._source, statistics
            )
        except BaseException:
            self._server.close()
            raise
        clients = ClientRegistry()
        self._sensors = SensorServiceStub(
            self._service, clients, clock, statistics, lambda: self._server.parcels_refused
        )
        self._poses = PoseServiceStub(self._service, profile)
        services: dict[str, Stub] = {
            "sensorservice": self._sensors,
            "poseservice": self._poses,
        }
        self._manager = ServiceManagerStub(
            services, self._server.peers, self._lifecycle, clients, clock, self._boot_id, config
        )
        for name, stub in {"servicemanager": self._manager, **services}.items():
            self._server.add_service(name, stub)
        self._waiter = Waiter((*self._server.sockets, self._publisher.socket))

    def serve(self) -> None:
        """Run until the life cycle or a signal ends it."""
        with _signals(self._on_signal) as signal_fd:
            self._waiter.watch(signal_fd)
            wait_for_bind_ns = self._clock.now_ns() + _FIRST_BIND_WAIT_NS
            _release_memory()
            sd_notify("READY=1")
            _log.info("ready: %s", ", ".join(sensor.name for sensor in self._source.sensors))
            readable = self._waiter.readable()
            while self._signal is None and not self._lifecycle.over:
                calls_wait = self._take_in(readable)
                self._service.advance()
                self._publisher.publish(self._service.take_poses())
                self._sensors.deliver(self._header)
                if self._poses.retry_s is not None:
                    self._poses.tell()
                deadline_ns = self._service.next_deadline_ns()
                if self._lifecycle.awaits_first_bind:
                    if self._clock.now_ns() >= wait_for_bind_ns:
                        break
                    deadline_ns = min(deadline_ns or wait_for_bind_ns, wait_for_bind_ns)
                for retry_s in (self._server.retry_s, self._sensors.retry_s, self._poses.retry_s):
                    if retry_s is not None:
                        retry_ns = self._clock.now_ns() + int(retry_s * 1e9)
                        deadline_ns = min(deadline_ns or retry_ns, retry_ns)
                readable = self._waiter.readable()
                idle = not (calls_wait or readable or self._lifecycle.over)
                if idle:
                    self._source.prepare()
                if idle and self._waiter.wait(deadline_ns):
                    readable = self._waiter.readable()
        reason = self._lifecycle.reason if self._signal is None else f"it got {signal.Signals(self._signal).name}"
        _log.info("stopping: %s", reason)
        sd_notify("STOPPING=1")
        self._manager.announce_end(f"the daemon ended because {reason}")

    def close(self) -> None:
        """Close the sockets; what was queued gets a moment to leave."""
        self._waiter.close()
        self._publisher.close()
        self._server.close()
        self._context.term()

    def _take_in(self, readable: list[Socket]) -> bool:
        """Handle what the sockets have, and only those: trying one in vain costs an exception. True if calls wait."""
        if self._publisher.socket in readable:
            self._publisher.read_subscriptions()
            readable.remove(self._publisher.socket)
        if readable or self._server.retry_s is not None:
            return self._server.process()
        return False

    def _on_signal(self, number: int) -> None:
        self._signal = number

    def _header(self, sequence: int) -> events_pb2.DeliveryHeader:
        return delivery_header(self._boot_id, sequence, self._clock.now_ns(), self._source.time_map)


def _release_memory() -> None:
    """Give back what only the start needed.

    Reading a recording leaves up to 6 MB behind that glibc keeps for later; and of the libraries' code, most ran once.
    What is called again comes back from the page cache.
    """
    gc.collect()
    libc = ctypes.CDLL(None)
    libc.malloc_trim(0)
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, mode, _offset, _device, inode = line.split()[:5]
        # Code alone: nothing is ever written there, as it is to relocated data.
        if mode == "r-xp" and inode != "0":
            start, end = (int(address, 16) for address in span.split("-"))
            libc.madvise(ctypes.c_void_p(start), ctypes.c_size_t(end - start), _MADV_DONTNEED)


_MADV_DONTNEED = 4


@contextlib.contextmanager
def _signals(on_signal: Callable[[int], None]) -> Iterator[int]:
    """Have SIGTERM and SIGINT noted and a file descriptor made readable by them, so that a poll wakes up."""
    reader, writer = socket.socketpair()
    for end in (reader, writer):
        end.setblocking(False)
    handlers = {
        number: signal.signal(number, lambda number, _frame: on_signal(number))
        for number in (signal.SIGTERM, signal.SIGINT)
    }
    previous = signal.set_wakeup_fd(writer.fileno())
    try:
        yield reader.fileno()
    finally:
        signal.set_wakeup_fd(previous)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        reader.close()
        writer.close()
