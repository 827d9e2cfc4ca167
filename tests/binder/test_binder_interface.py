"""Interfaces read from their services, the version rule, and the socket options that everything rests on."""

import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
import zmq
from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.internal import api_implementation

from posed.binder import sockets
from posed.binder.interface import FIRST_CALL, INTERFACE_HASH, INTERFACE_VERSION, PING, check_version, interface_of
from posed.binder.status import ExceptionCode, RemoteError
from posed.errors import PosedError
from posed.proto import binder_pb2, events_pb2, pose_pb2, sensors_pb2, service_manager_pb2

FILES = (service_manager_pb2, sensors_pb2, pose_pb2)
SERVICES = [service for file in FILES for service in file.DESCRIPTOR.services_by_name.values()]
SENSORS = interface_of(sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"])


@pytest.mark.parametrize("service", SERVICES, ids=lambda service: service.name)
def test_methods_are_numbered_in_order(service: ServiceDescriptor) -> None:
    interface = interface_of(service)
    names = [method.name for method in service.methods]
    assert [interface.methods_by_name[name].code for name in names] == [FIRST_CALL + i for i in range(len(names))]
    assert set(interface.methods_by_code.values()) == set(interface.methods_by_name.values())
    assert interface.version >= 1


def test_methods_know_their_messages_and_whether_they_are_answered() -> None:
    enable = SENSORS.methods_by_name["enableSensor"]
    assert (enable.request_class, enable.response_class) == (sensors_pb2.EnableSensorRequest, binder_pb2.Empty)
    assert not enable.oneway
    listener = interface_of(sensors_pb2.DESCRIPTOR.services_by_name["ISensorEventListener"])
    assert listener.methods_by_name["onSensorEvents"].oneway
    assert listener.methods_by_name["onSensorEvents"].request_class is events_pb2.SensorEvents


def test_interface_is_made_once() -> None:
    assert interface_of(sensors_pb2.DESCRIPTOR.services_by_name["ISensorService"]) is SENSORS


def test_each_file_with_interfaces_has_a_hash_of_its_own() -> None:
    assert len({interface_of(service).hash for service in SERVICES}) == len(FILES)


def test_nothing_that_is_imported_needs_the_descriptor_of_descriptors() -> None:
    check = "import sys, posed.client, posed.daemon.loop; print('google.protobuf.descriptor_pb2' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert ran.stdout == "False\n"


def test_codes_are_androids() -> None:
    assert (INTERFACE_VERSION, INTERFACE_HASH) == (FIRST_CALL + 16777214, FIRST_CALL + 16777213)
    assert PING.to_bytes(4, "big") == b"_PNG"


def test_equal_version_and_hash_is_accepted() -> None:
    check_version(SENSORS, SENSORS.info)


def test_older_version_is_accepted_whatever_its_hash() -> None:
    newer = type(SENSORS)(SENSORS.name, 3, SENSORS.hash, {}, {})
    check_version(newer, binder_pb2.InterfaceInfo(version=2, hash="of another time"))


@pytest.mark.parametrize(
    ("version", "hash", "code", "message"),
    [
        (SENSORS.version, "0" * 64, ExceptionCode.ILLEGAL_STATE, "install the same posed"),
        (SENSORS.version, "", ExceptionCode.ILLEGAL_STATE, "client none"),
        (SENSORS.version + 1, SENSORS.hash, ExceptionCode.ILLEGAL_STATE, "restart the daemon"),
        (2**32 - 1, "", ExceptionCode.ILLEGAL_STATE, "4294967295"),
        (0, SENSORS.hash, ExceptionCode.ILLEGAL_ARGUMENT, "count from 1"),
    ],
)
def test_other_versions_are_refused(version: int, hash: str, code: ExceptionCode, message: str) -> None:
    with pytest.raises(RemoteError, match=message) as caught:
        check_version(SENSORS, binder_pb2.InterfaceInfo(version=version, hash=hash))
    assert caught.value.exception_code is code


def test_every_socket_is_bounded_in_queue_size_and_patience(context: sockets.Context) -> None:
    made = [
        sockets.router(context),
        sockets.dealer(context),
        sockets.xpub(context),
        sockets.sub(context, conflate=False),
        sockets.sub(context, conflate=True),
    ]
    for socket in made:
        option: Callable[[int], Any] = socket.getsockopt
        assert 0 < option(zmq.SNDHWM) <= 1000
        assert 0 < option(zmq.RCVHWM) <= 1000
        assert option(zmq.MAXMSGSIZE) == 128 * 1024
        assert 0 <= option(zmq.LINGER) <= 200
        assert option(zmq.HANDSHAKE_IVL) == 500
    for socket in made[1], made[3], made[4]:
        assert socket.getsockopt(zmq.RECONNECT_IVL) == 100
        assert socket.getsockopt(zmq.RECONNECT_IVL_MAX) == 500
    heartbeats = [
        [made_one.getsockopt(each) for each in (zmq.HEARTBEAT_IVL, zmq.HEARTBEAT_TIMEOUT)] for made_one in made[:3]
    ]
    assert heartbeats == [[900, 1000], [3000, 1000], [3000, 1000]]
    assert context.get(zmq.IO_THREADS) == 1
    for socket in made:
        socket.close()


def test_old_libzmq_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zmq, "zmq_version_info", lambda: (4, 3, 4))
    with pytest.raises(PosedError, match="install pyzmq 26"):
        sockets.context()


def test_slow_protobuf_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api_implementation, "Type", lambda: "python")
    with pytest.raises(PosedError, match="unset PROTOCOL_BUFFERS_PYTHON_IMPLEMENTATION"):
        sockets.context()


def test_both_sides_import_neither_asyncio_nor_numpy() -> None:
    script = "import sys, posed.binder.server, posed.binder.connection; print({'asyncio', 'numpy'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", script], env=os.environ, capture_output=True, text=True, timeout=60)
    assert run.stdout == "set()\n"
