"""Calls and replies over a real socket: results, exceptions, limits, order, and who is calling."""

import logging
import os
import subprocess
import sys
from pathlib import Path

import pytest
from binder_harness import (
    EMPTY,
    LISTENER,
    MANAGER,
    SENSORS,
    Listener,
    Manager,
    Sensors,
    ServerThread,
    events,
    get_service,
    pump,
    spawn,
)

from posed.binder.connection import Connection
from posed.binder.interface import interface_of
from posed.binder.parcel import MAX_PARCEL_BYTES
from posed.binder.status import (
    DeadObjectError,
    ExceptionCode,
    RemoteError,
    TransactionTimeoutError,
    TransactionTooLargeError,
)
from posed.binder.stub import Stub
from posed.errors import InvalidArgumentError, PosedError, RecordingError
from posed.proto import sensors_pb2, service_manager_pb2


def sensor_list(name_length: int) -> sensors_pb2.SensorList:
    return sensors_pb2.SensorList(sensors=[sensors_pb2.SensorInfo(handle=3, name="n" * name_length)])


def test_response_arrives(server: ServerThread, connection: Connection) -> None:
    server.sensors.answer = sensor_list(5)
    assert connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY) == sensor_list(5)


@pytest.mark.parametrize("code", ExceptionCode)
def test_exception_crosses_with_its_code(server: ServerThread, connection: Connection, code: ExceptionCode) -> None:
    server.sensors.error = RemoteError(code, "the sensor is asleep", service_specific_error=-42)
    with pytest.raises(RemoteError, match="the sensor is asleep") as caught:
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    assert caught.value.exception_code is code
    assert caught.value.service_specific_error == -42


def test_exception_code_without_a_name_stays_a_number(server: ServerThread, connection: Connection) -> None:
    server.sensors.error = RemoteError(-77, "new in a later version")
    with pytest.raises(RemoteError) as caught:
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    assert caught.value.exception_code == -77


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InvalidArgumentError("handle 9 is unknown"), ExceptionCode.ILLEGAL_ARGUMENT),
        (RecordingError("the recording ended"), ExceptionCode.ILLEGAL_STATE),
        (PosedError("not now"), ExceptionCode.ILLEGAL_STATE),
    ],
)
def test_own_errors_cross_with_their_message(
    server: ServerThread, connection: Connection, error: PosedError, code: ExceptionCode
) -> None:
    server.sensors.error = error
    with pytest.raises(RemoteError, match=str(error)) as caught:
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    assert caught.value.exception_code is code


@pytest.mark.parametrize("error", [ZeroDivisionError("secret"), RemoteError(2**40, "no sint32")])
def test_unexpected_error_is_logged_and_not_told(
    server: ServerThread, connection: Connection, error: Exception, caplog: pytest.LogCaptureFixture
) -> None:
    service = connection.proxy(SENSORS, "sensorservice")
    server.sensors.error = error
    with pytest.raises(RemoteError, match=r"^internal error$") as caught:
        service.getSensorList(EMPTY)
    assert caught.value.exception_code is ExceptionCode.TRANSACTION_FAILED
    assert type(error).__name__ in caplog.text
    server.sensors.error = None
    assert service.getSensorList(EMPTY) == sensors_pb2.SensorList()


def test_response_of_a_wrong_type_is_an_internal_error(
    server: ServerThread, connection: Connection, caplog: pytest.LogCaptureFixture
) -> None:
    server.sensors.answer = None
    with pytest.raises(RemoteError) as caught:
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    assert caught.value.exception_code is ExceptionCode.TRANSACTION_FAILED
    assert "not a SensorList" in caplog.text


@pytest.mark.parametrize("message", ["m" * 200_000, "name \udcff is no UTF-8"])
def test_any_error_message_fits_into_a_reply(server: ServerThread, connection: Connection, message: str) -> None:
    server.sensors.error = InvalidArgumentError(message)
    with pytest.raises(RemoteError, match=message[:5]) as caught:
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    assert caught.value.exception_code is ExceptionCode.ILLEGAL_ARGUMENT


@pytest.mark.parametrize(
    ("target", "code", "payload", "expected"),
    [
        ("nosuchservice", 1, b"", ExceptionCode.ILLEGAL_ARGUMENT),
        ("sensorservice", 0, b"", ExceptionCode.UNSUPPORTED_OPERATION),
        ("sensorservice", 99, b"", ExceptionCode.UNSUPPORTED_OPERATION),
        ("sensorservice", 2**32 - 1, b"", ExceptionCode.UNSUPPORTED_OPERATION),
        ("sensorservice", 2, b"\xff\xff", ExceptionCode.BAD_PARCELABLE),
        ("sensorservice", 2, b"\x0a\x02\xc3\x28", ExceptionCode.BAD_PARCELABLE),  # bad UTF-8 in a string
        ("sensorservice", 2, b"\x3b" * 10_000, ExceptionCode.BAD_PARCELABLE),  # 10,000 groups, one in the other
        ("listener", 1, b"", ExceptionCode.BAD_PARCELABLE),  # a oneway method called with a call_id
    ],
)
def test_call_that_cannot_be_carried_out_is_answered_and_counted(
    server: ServerThread, connection: Connection, target: str, code: int, payload: bytes, expected: ExceptionCode
) -> None:
    with pytest.raises(RemoteError) as caught:
        connection.call(target, code, payload, timeout_s=10)
    assert caught.value.exception_code is expected
    assert server.refused() == 1


def test_empty_payload_is_the_empty_message(server: ServerThread, connection: Connection) -> None:
    assert connection.call("sensorservice", 1, b"", timeout_s=10) == b""
    assert server.refused() == 0


def test_call_too_large_is_not_sent(server: ServerThread, connection: Connection) -> None:
    request = sensors_pb2.FlushRequest(listener="l" * MAX_PARCEL_BYTES)
    with pytest.raises(TransactionTooLargeError, match="65536"):
        connection.proxy(SENSORS, "sensorservice").flush(request)
    connection.ping()
    assert server.refused() == 0


def test_largest_call_passes(connection: Connection) -> None:
    request = sensors_pb2.FlushRequest(listener="l" * (MAX_PARCEL_BYTES - 100))
    assert connection.proxy(SENSORS, "sensorservice").flush(request) == EMPTY


def test_reply_too_large_is_an_exception(server: ServerThread, connection: Connection) -> None:
    server.sensors.answer = sensor_list(MAX_PARCEL_BYTES)
    with pytest.raises(RemoteError, match="65536") as caught:
        connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)
    assert caught.value.exception_code is ExceptionCode.TRANSACTION_FAILED


def test_callback_too_large_is_not_sent(server: ServerThread, connection: Connection) -> None:
    listener = server.peers()[0].proxy(LISTENER, "listener")
    with pytest.raises(TransactionTooLargeError, match="65536"):
        listener.onSensorEvents(events(1, flushes=MAX_PARCEL_BYTES))


@pytest.mark.parametrize("name", ["", "x" * 256])
def test_callback_object_needs_a_name_that_leaves_room(server: ServerThread, connection: Connection, name: str) -> None:
    with pytest.raises(InvalidArgumentError, match=f"has {len(name)} characters; give 1 to 255"):
        server.peers()[0].proxy(LISTENER, name)


def test_timeout_then_the_late_reply_is_nobody_elses(server: ServerThread, connection: Connection) -> None:
    service = connection.proxy(SENSORS, "sensorservice")
    server.sensors.answer = sensor_list(1)

    def hold_up(_server: object) -> None:
        with pytest.raises(TransactionTimeoutError, match="sensorservice"):
            service.getSensorList(EMPTY, timeout_s=0.05)

    server.do(hold_up)
    server.sensors.answer = sensor_list(2)
    assert service.getSensorList(EMPTY) == sensor_list(2)
    assert server.sensors.calls == 2


def test_oneway_calls_keep_their_order(server: ServerThread, connection: Connection) -> None:
    listener = connection.proxy(LISTENER, "listener")
    for sequence in range(500):
        while not listener.onSensorEvents(events(sequence)):
            connection.ping()
    connection.ping()
    assert server.listener.sequences == list(range(500))


def test_callbacks_that_arrive_during_a_call_wait_for_process(server: ServerThread, connection: Connection) -> None:
    listener = Listener()
    connection.add_callback("mine", listener)
    request = sensors_pb2.EnableSensorRequest(listener="mine", sampling_period_us=40)
    connection.proxy(SENSORS, "sensorservice").enableSensor(request)
    assert listener.sequences == []
    connection.process()
    assert listener.sequences == list(range(40))
    assert {(caller.uid, caller.pid) for caller in listener.callers} == {(os.getuid(), os.getpid())}


def test_callback_that_raises_harms_nobody(
    server: ServerThread, connection: Connection, caplog: pytest.LogCaptureFixture
) -> None:
    errors: dict[str, Exception | None] = {"bad": ZeroDivisionError("oops"), "poor": PosedError("later"), "good": None}
    listeners = {name: Listener(error) for name, error in errors.items()}
    for name, listener in listeners.items():
        connection.add_callback(name, listener)
        request = sensors_pb2.EnableSensorRequest(listener=name, sampling_period_us=2)
        connection.proxy(SENSORS, "sensorservice").enableSensor(request)
    connection.process()
    assert [listener.sequences for listener in listeners.values()] == [[0, 1]] * 3
    assert "ZeroDivisionError" in caplog.text
    assert "later" in caplog.text


def test_removed_callback_hears_nothing(server: ServerThread, connection: Connection) -> None:
    listener = Listener()
    connection.add_callback("mine", listener)
    request = sensors_pb2.EnableSensorRequest(listener="mine", sampling_period_us=3)
    connection.proxy(SENSORS, "sensorservice").enableSensor(request)
    connection.remove_callback("mine")
    connection.remove_callback("mine")
    connection.process()
    assert listener.sequences == []


def test_callback_names_are_unique(connection: Connection) -> None:
    connection.add_callback("mine", Listener())
    with pytest.raises(InvalidArgumentError, match="mine"):
        connection.add_callback("mine", Listener())


def test_callback_may_call_the_daemon(server: ServerThread, connection: Connection) -> None:
    answers = []

    class Nested(Listener):
        def onSensorEvents(self, request: object, caller: object) -> None:
            answers.append(connection.proxy(SENSORS, "sensorservice").getSensorList(EMPTY))

    connection.add_callback("mine", Nested())
    request = sensors_pb2.EnableSensorRequest(listener="mine", sampling_period_us=3)
    connection.proxy(SENSORS, "sensorservice").enableSensor(request)
    pump(connection, lambda: len(answers) == 3)
    assert answers == [server.sensors.answer] * 3


def test_caller_is_who_the_kernel_says(server: ServerThread, connection: Connection) -> None:
    status = connection.proxy(MANAGER, "servicemanager").getStatus(EMPTY)
    assert (status.connections, status.pid) == (os.getuid(), os.getpid())


def test_caller_in_another_process(server: ServerThread) -> None:
    with spawn("client", server.path) as client:
        caller = server.manager.bound.get(timeout=20)
        assert (caller.uid, caller.pid) == (os.getuid(), client.pid)
        client.kill()


def test_daemon_does_not_wait_for_a_client(server: ServerThread, connection: Connection) -> None:
    with pytest.raises(RemoteError, match="oneway"):
        server.peers()[0].proxy(SENSORS, "mine").getSensorList(EMPTY)


def test_interface_version_and_hash_before_get_service(server: ServerThread, unconnected: Connection) -> None:
    pump(unconnected, lambda: unconnected.connected)
    service = unconnected.proxy(SENSORS, "sensorservice")
    assert service.get_interface_version() == interface_of(SENSORS).version
    assert service.get_interface_hash() == interface_of(SENSORS).hash


def test_service_is_closed_before_get_service(server: ServerThread, unconnected: Connection) -> None:
    pump(unconnected, lambda: unconnected.connected)
    service = unconnected.proxy(SENSORS, "sensorservice")
    with pytest.raises(RemoteError, match="getService") as caught:
        service.getSensorList(EMPTY)
    assert caught.value.exception_code is ExceptionCode.ILLEGAL_STATE
    get_service(unconnected, "listener")
    with pytest.raises(RemoteError, match="getService"):
        service.getSensorList(EMPTY)
    get_service(unconnected)
    service.getSensorList(EMPTY)


def test_service_stays_closed_after_a_refused_version(server: ServerThread, unconnected: Connection) -> None:
    pump(unconnected, lambda: unconnected.connected)
    newer = interface_of(SENSORS).info
    newer.version += 1
    request = service_manager_pb2.GetServiceRequest(name="sensorservice", interface=newer)
    with pytest.raises(RemoteError, match="restart the daemon"):
        unconnected.proxy(MANAGER, "servicemanager").getService(request)
    with pytest.raises(RemoteError, match="getService"):
        unconnected.proxy(SENSORS, "sensorservice").getSensorList(EMPTY)


def test_stub_without_a_method_cannot_be_made() -> None:
    class Lazy(Stub):
        descriptor = LISTENER

        def __init__(self) -> None:
            pass

    with pytest.raises(TypeError, match="Lazy does not implement onSensorEvents"):
        Lazy()


def test_proxy_takes_only_its_methods_and_requests(connection: Connection) -> None:
    service = connection.proxy(SENSORS, "sensorservice")
    with pytest.raises(AttributeError, match="getGnomes"):
        service.getGnomes(EMPTY)
    with pytest.raises(TypeError, match="takes a FlushRequest, not a Empty"):
        service.flush(EMPTY)


def test_call_without_a_daemon_fails_at_once(unconnected: Connection) -> None:
    with pytest.raises(DeadObjectError, match=r"control\.sock"):
        unconnected.ping(timeout_s=600)
    with pytest.raises(DeadObjectError):
        unconnected.proxy(LISTENER, "listener").onSensorEvents(events(1))
    with pytest.raises(DeadObjectError):
        unconnected.link_to_death(lambda _: None)


def test_fork_cannot_use_its_parents_connection(server: ServerThread) -> None:
    script = """
import os, sys
from pathlib import Path
from binder_harness import pump
from posed.binder import sockets
from posed.binder.connection import Connection
from posed.errors import PosedError
context = sockets.context()
connection = Connection(Path(sys.argv[1]), context)
pump(connection, lambda: connection.connected)
child = os.fork()
if child == 0:
    raised = 0
    for use in (connection.ping, connection.process):
        try:
            use()
        except PosedError as error:
            raised += "belongs to process" in str(error)
    connection.close()
    os._exit(raised)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 2
connection.ping()
connection.close()
context.term()
"""
    command = [sys.executable, "-W", "ignore", "-c", script, str(server.path)]
    path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    assert subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, timeout=60).returncode == 0


def test_two_stubs_do_not_share_state() -> None:
    assert Manager() is not Manager()
    assert Sensors().interface is Sensors().interface


def test_oneway_failure_is_logged_in_the_daemon(
    server: ServerThread, connection: Connection, caplog: pytest.LogCaptureFixture
) -> None:
    server.listener.error = PosedError("the listener is full")
    with caplog.at_level(logging.WARNING):
        assert connection.proxy(LISTENER, "listener").onSensorEvents(events(1))
        connection.ping()
    assert "the listener is full" in caplog.text
