"""Short calls to the running daemon, which do not count as a binding."""

import contextlib
import math
import time
from collections.abc import Iterator

import zmq

from posed.binder import sockets
from posed.binder.connection import Connection
from posed.binder.interface import interface_of
from posed.binder.proxy import Proxy
from posed.binder.runtime import control_path, runtime_directory
from posed.binder.status import DeadObjectError, TransactionTimeoutError
from posed.client.launcher import daemon_listens
from posed.client.package import ACTIVITY_RECOGNITION, HIGH_SAMPLING_RATE_SENSORS, Package
from posed.errors import PosedError, ServiceUnavailableError
from posed.proto import binder_pb2, sensors_pb2, service_manager_pb2

# Of a daemon that lives, connecting takes 2 ms; a stopped or hung one is not worth a longer wait.
_TIMEOUT_S = 2.0

PACKAGE = Package("posed.cli", permissions=(HIGH_SAMPLING_RATE_SENSORS, ACTIVITY_RECOGNITION))
"""What the command says of itself when it binds: as Android's shell, it may sample as fast as a sensor goes."""


def require_daemon() -> None:
    """Raise ServiceUnavailableError with the remedy if no daemon runs."""
    if not daemon_listens():
        raise ServiceUnavailableError("no daemon is running; start one with 'posed start'")


@contextlib.contextmanager
def connect() -> Iterator[Connection]:
    """Yield a connection to the running daemon.

    Raises ServiceUnavailableError if there is none or it does not answer, then or during a call inside the block.
    """
    require_daemon()
    context = sockets.context()
    connection = Connection(control_path(runtime_directory()), context)
    try:
        _await_connected(connection)
        yield connection
    except (DeadObjectError, TransactionTimeoutError) as error:
        raise ServiceUnavailableError(str(error)) from error
    finally:
        connection.close()
        context.destroy(linger=0)


def service_manager(connection: Connection) -> Proxy:
    """Return the daemon's IServiceManager."""
    descriptor = service_manager_pb2.DESCRIPTOR.services_by_name["IServiceManager"]
    return connection.proxy(descriptor, "servicemanager", _TIMEOUT_S)


def sensor_service(connection: Connection) -> Proxy:
    """Return the daemon's ISensorService; raises RemoteError if this client and the daemon do not fit together."""
    descriptor = sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]
    service_manager(connection).getService(
        service_manager_pb2.GetServiceRequest(name="sensorservice", interface=interface_of(descriptor).info)
    )
    return connection.proxy(descriptor, "sensorservice", _TIMEOUT_S)


def source_has_ended() -> bool:
    """Return True if the running daemon says that its source has given its last sample."""
    try:
        with connect() as connection:
            return bool(sensor_service(connection).getStatistics(binder_pb2.Empty()).source_ended)
    except PosedError:
        return False  # it went meanwhile, which is told elsewhere


def _await_connected(connection: Connection) -> None:
    poller = zmq.Poller()
    for each in connection.sockets:
        poller.register(each, zmq.POLLIN)
    deadline = time.monotonic() + _TIMEOUT_S
    connection.process()
    while not connection.connected:
        remaining = deadline - time.monotonic()
        if remaining <= 0:
            raise ServiceUnavailableError(
                "the daemon is there but does not answer: it is stopped, hung or overloaded; its process id is in"
                f" {runtime_directory() / 'daemon.lock'}"
            )
        poller.poll(math.ceil(remaining * 1000))
        connection.process()
