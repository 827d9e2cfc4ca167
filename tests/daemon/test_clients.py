"""What a process says of itself when it binds, and what is believed of it."""

import pytest

from posed.binder.peer import Peer
from posed.daemon.clients import ClientRegistry
from posed.errors import InvalidArgumentError
from posed.proto import service_manager_pb2


def _peer() -> Peer:
    return Peer(b"p", 10123, 4321, lambda _: True)


def test_user_and_process_are_the_kernels_word_and_the_rest_the_clients() -> None:
    registry, peer = ClientRegistry(), _peer()
    registry.register(
        peer, service_manager_pb2.BindRequest(package_name="com.example", target_sdk=35, permissions=["android.X"])
    )
    client = registry.of(peer)
    assert (client.package_name, client.uid, client.pid, client.target_sdk) == ("com.example", 10123, 4321, 35)
    assert client.permissions == {"android.X"}
    registry.forget(peer)
    assert registry.of(peer).package_name == "process-4321"


def test_one_that_says_nothing_is_a_shell() -> None:
    registry, peer = ClientRegistry(), _peer()
    for bound in (False, True):
        if bound:
            registry.register(peer, service_manager_pb2.BindRequest())
        client = registry.of(peer)
        assert (client.package_name, client.target_sdk, client.permissions) == ("process-4321", 0, frozenset())


@pytest.mark.parametrize(
    ("request_", "named"),
    [
        (service_manager_pb2.BindRequest(package_name="a\nb"), "a\\\\nb"),
        (service_manager_pb2.BindRequest(package_name="x" * 256), "256 characters"),
        (service_manager_pb2.BindRequest(permissions=["p"] * 101), "101 permissions"),
    ],
)
def test_what_cannot_be_printed_is_refused(request_: service_manager_pb2.BindRequest, named: str) -> None:
    registry, peer = ClientRegistry(), _peer()
    with pytest.raises(InvalidArgumentError, match=named):
        registry.register(peer, request_)
    assert registry.of(peer).package_name == "process-4321"
