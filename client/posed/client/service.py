"""The binding to the daemon: one thread that owns the sockets, connects, and connects again."""

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

import zmq
from google.protobuf.descriptor import ServiceDescriptor

from posed.binder.connection import Connection
from posed.binder.interface import interface_of
from posed.binder.proxy import Proxy
from posed.binder.runtime import control_path, endpoint, runtime_directory
from posed.binder.sockets import Context, Socket, context
from posed.binder.status import DeadObjectError, TransactionTimeoutError
from posed.binder.stub import Caller, Stub
from posed.client.binding import Binding, ServiceState, call_back
from posed.client.launcher import ensure_daemon
from posed.client.package import Package
from posed.errors import PosedError, ServiceUnavailableError
from posed.proto import binder_pb2, service_manager_pb2

_log = logging.getLogger(__name__)
_T = TypeVar("_T")

_CALL_TIMEOUT_S = 2.0
_CLOSE_TIMEOUT_S = 1.0
_FAREWELL_TIMEOUT_S = 0.3
# A daemon that answers no call is tried again after this; one that keeps crashing is not started in a tight loop.
_RETRY_S = 1.0
_RESTART_INTERVAL_S = 2.0


class Service:
    """One client's binding to the daemon, kept by a thread of its own until `close`."""

    def __init__(
        self,
        binding: Binding,
        *,
        auto_create: bool,
        package: Package | None = None,
        on_service_connected: Callable[[], None] | None = None,
        on_service_disconnected: Callable[[], None] | None = None,
        on_binding_died: Callable[[str], None] | None = None,
    ) -> None:
        self._binding = binding
        self._auto_create = auto_create
        self.package = package or Package()
        """What this program says of itself when it binds."""
        self._on_connected = on_service_connected
        self._on_disconnected = on_service_disconnected
        self._on_died = on_binding_died
        self._changed = threading.Condition()
        self._state = ServiceState.CONNECTING
        self.reason = "no daemon has answered yet; start one with `posed serve` or bind with auto_create=True"
        """Why the binding is not connected, for people."""
        self._requests: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._links: list[bool] = []
        self._farewell: str | None = None
        self._retry_at: float | None = None
        self._started_at = float("-inf")
        self._thread_ended = False
        self._extra: dict[Socket, Callable[[], None]] = {}
        self.context: Context = context()
        self.directory = runtime_directory()
        endpoint(control_path(self.directory))  # a path too long is the caller's to hear of, not the thread's
        self._wake_fd: int | None = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._thread = threading.Thread(target=self._run, name="posed-client", daemon=True)

    # From any thread

    def start(self) -> None:
        """Begin: the binding may be called back from here on."""
        self._thread.start()

    @property
    def state(self) -> ServiceState:
        """Where the binding stands now."""
        return self._state

    @property
    def has_ended(self) -> bool:
        """True once closed, or failed for good: the binding's `release` is called when it has become so."""
        return self._thread_ended or self._state is ServiceState.CLOSED

    def wait_connected(self, timeout_s: float) -> None:
        """Wait until a daemon is connected.

        Raises ServiceUnavailableError with the reason after `timeout_s`, at once if the binding died or was closed, or
        in a callback on the binding's own thread, which would wait for itself.
        """
        if threading.current_thread() is self._thread:
            timeout_s = 0.0
        waiting = (ServiceState.CONNECTING, ServiceState.DISCONNECTED)
        with self._changed:
            self._changed.wait_for(lambda: self._state not in waiting, timeout_s)
            if self._state is not ServiceState.CONNECTED:
                raise ServiceUnavailableError(f"posed is {self._state.value}: {self.reason}")

    def run(self, action: Callable[[], _T], timeout_s: float = 2 * _CALL_TIMEOUT_S) -> _T:
        """Run `action` on the service thread, once connected, and return what it returns or raise what it raises.

        Raises ServiceUnavailableError if no daemon is connected in time, or it goes away or hangs meanwhile.
        """
        try:
            if threading.current_thread() is self._thread:
                return action()
            self.wait_connected(timeout_s)
            future = self.post(action)
            try:
                return future.result(timeout_s)
            except TimeoutError:
                future.cancel()
                raise ServiceUnavailableError(f"the daemon did not answer within {timeout_s:g} s") from None
        except (DeadObjectError, TransactionTimeoutError) as error:
            raise ServiceUnavailableError(str(error)) from error

    def post(self, action: Callable[[], _T]) -> "Future[_T]":
        """Have `action` run on the service thread, once connected, without waiting for it."""
        future: Future[_T] = Future()
        self._requests.append((action, future))
        self._wake()
        return future

    def close(self) -> None:
        """Unbind and stop the thread; a second call does nothing. Takes a second at most, whatever the daemon does."""
        with self._changed:
            if self._state is ServiceState.CLOSED:
                return
            self._set_state(ServiceState.CLOSED, "the client was closed")
        self._wake()
        if threading.current_thread() is not self._thread:
            self._thread.join(_CLOSE_TIMEOUT_S)

    # From the service thread

    @property
    def connection(self) -> Connection:
        """The connection to the daemon."""
        return self._connection

    def get_service(self, name: str, descriptor: ServiceDescriptor) -> tuple[Proxy, bytes]:
        """Return a service of the daemon and the daemon's boot id, its version checked."""
        request = service_manager_pb2.GetServiceRequest(name=name, interface=interface_of(descriptor).info)
        info = self._manager().getService(request)
        return self._connection.proxy(descriptor, name, _CALL_TIMEOUT_S), info.boot_id

    def watch(self, socket: Socket, on_readable: Callable[[], None]) -> None:
        """Have `on_readable` called on the service thread when the socket can be read."""
        self._extra[socket] = on_readable
        self._poller.register(socket, zmq.POLLIN)

    def unwatch(self, socket: Socket) -> None:
        """Undo `watch` and close the socket."""
        if self._extra.pop(socket, None) is not None:
            self._poller.unregister(socket)
        socket.close()

    # Private

    def _wake(self) -> None:
        with self._changed:
            if self._wake_fd is not None:
                os.eventfd_write(self._wake_fd, 1)

    def _set_state(self, state: ServiceState, reason: str) -> None:
        with self._changed:
            if self._state is not ServiceState.CLOSED:
                self._state = state
                self.reason = reason
                self._changed.notify_all()

    def _manager(self, timeout_s: float = _CALL_TIMEOUT_S) -> Proxy:
        return self._connection.proxy(_MANAGER, "servicemanager", timeout_s)

    def _run(self) -> None:
        wake_fd = self._wake_fd
        assert wake_fd is not None
        self._connection = Connection(control_path(self.directory), self.context)
        self._connection.on_connected = lambda: self._links.append(True)
        self._connection.on_disconnected = lambda: self._links.append(False)
        self._connection.add_callback("connection", _ServiceConnection(self))
        self._poller = zmq.Poller()
        for socket in self._connection.sockets:
            self._poller.register(socket, zmq.POLLIN)
        self._poller.register(wake_fd, zmq.POLLIN)
        if self._auto_create:
            self._start_daemon()
        try:
            while self._state is not ServiceState.CLOSED:
                self._turn()
            self._leave()
        except PosedError as error:
            # The socket is somebody else's, or this is a forked child: nothing more can come of this binding.
            self._die(str(error))
        except Exception as error:
            # A fault of ours must not leave the caller waiting for ever on a thread that is no more.
            _log.exception("the binding failed")
            self._die(f"the client failed: {error!r}; bind again")
        finally:
            self._thread_ended = True
            self._binding.release(self)
            self._connection.close()
            self._fail_requests()
            self.context.destroy(linger=0)
            self._close_waker()

    def _close_waker(self) -> None:
        # Under the lock: a number written to after it was closed could be another file's.
        with self._changed:
            if self._wake_fd is not None:
                os.close(self._wake_fd)
            self._wake_fd = None

    def _turn(self) -> None:
        """Take in what happened, then wait for more."""
        more = self._connection.process()
        while self._links:
            more = True
            if not self._links.pop(0):
                self._disconnected()
            elif not self._links:  # of a connection that is lost by now there is nothing to bind
                self._connected()
        while self._requests and self._state is ServiceState.CONNECTED:
            more = True
            self._serve(*self._requests.popleft())
        if self._retry_at is not None and time.monotonic() >= self._retry_at:
            self._retry_at = None
            self._try_again()
        # A call that waited for its reply has read the sockets: what came besides is only seen by the next process.
        ready = dict(self._poller.poll(0 if more else self._timeout_ms()))
        if self._wake_fd is not None and self._wake_fd in ready:
            os.eventfd_read(self._wake_fd)
        for socket, on_readable in list(self._extra.items()):
            if socket in ready and socket in self._extra:  # what came before may have closed it
                on_readable()

    def _try_again(self) -> None:
        if self._connection.connected:
            self._connected()
        elif self._auto_create:
            self._start_daemon()

    def _timeout_ms(self) -> int | None:
        if self._retry_at is None:
            return None
        return max(0, int((self._retry_at - time.monotonic()) * 1000) + 1)

    def _serve(self, action: Callable[[], Any], future: "Future[Any]") -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            future.set_result(action())
        except BaseException as error:
            future.set_exception(error)

    def _connected(self) -> None:
        self._farewell = None
        self._retry_at = None
        try:
            self._manager().bindService(
                service_manager_pb2.BindRequest(
                    auto_create=self._auto_create,
                    connection="connection",
                    package_name=self.package.name,
                    target_sdk=self.package.target_sdk,
                    permissions=self.package.permissions,
                )
            )
            self._binding.bind(self)
        except DeadObjectError:
            return  # the monitor reports it, and then what follows from it
        except TransactionTimeoutError as error:
            self._set_state(ServiceState.DISCONNECTED, str(error))
            self._retry_at = time.monotonic() + _RETRY_S
            return
        except PosedError as error:
            self._binding.release(self)
            self._leave()
            self._die(str(error))
            return
        self._set_state(ServiceState.CONNECTED, "")
        self._call_back(self._on_connected)

    def _disconnected(self) -> None:
        self._binding.release(self)
        was = self._state
        farewell, self._farewell = self._farewell, None
        if farewell is not None:
            self._die(farewell)
        elif was is not ServiceState.BINDING_DIED:
            self._set_state(ServiceState.DISCONNECTED, "the daemon went away without a word; waiting for its return")
            if was is ServiceState.CONNECTED:
                self._call_back(self._on_disconnected)
            if self._auto_create:
                self._start_daemon()

    def _start_daemon(self) -> None:
        wait_s = self._started_at + _RESTART_INTERVAL_S - time.monotonic()
        if wait_s > 0:
            self._retry_at = time.monotonic() + wait_s
            return
        self._started_at = time.monotonic()
        try:
            ensure_daemon()
            # It may die before it has answered: then there is no end of a connection to tell of it.
            self._retry_at = time.monotonic() + _RETRY_S
        except (PosedError, OSError) as error:
            self._die(str(error))

    def _die(self, reason: str) -> None:
        self._set_state(ServiceState.BINDING_DIED, reason)
        self._call_back(self._on_died, reason)

    def _leave(self) -> None:
        """Tell a daemon that is there that this client goes; one that is not there knows already."""
        if not self._connection.connected:
            return
        try:
            self._binding.unbind(self)
            self._manager(_FAREWELL_TIMEOUT_S).unbindService(binder_pb2.Empty())
        except PosedError as error:
            _log.debug("leaving without a farewell: %s", error)

    def _fail_requests(self) -> None:
        while self._requests:
            _, future = self._requests.popleft()
            if future.set_running_or_notify_cancel():
                future.set_exception(ServiceUnavailableError(f"posed is {self._state.value}: {self.reason}"))

    def _call_back(self, callback: Callable[..., None] | None, *arguments: Any) -> None:
        if callback is not None:
            call_back(callback, *arguments)


class _ServiceConnection(Stub):
    descriptor = service_manager_pb2.DESCRIPTOR.services_by_name["IServiceConnection"]

    def __init__(self, service: Service) -> None:
        self._service = service

    def onBindingDied(self, request: service_manager_pb2.BindingDied, caller: Caller) -> None:
        self._service._farewell = request.reason


_MANAGER = service_manager_pb2.DESCRIPTOR.services_by_name["IServiceManager"]
