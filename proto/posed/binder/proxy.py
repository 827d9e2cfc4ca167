"""A remote object as its caller sees it."""

from collections.abc import Callable
from typing import Any, Protocol

from google.protobuf.message import Message

from posed.binder.interface import INTERFACE_HASH, INTERFACE_VERSION, Interface, Method
from posed.proto.binder_pb2 import InterfaceInfo


class Channel(Protocol):
    """The way from a proxy to the process that holds its object."""

    def call(self, target: str, code: int, payload: bytes, timeout_s: float) -> bytes:
        """Make a synchronous call and return the serialised response."""

    def post(self, target: str, code: int, payload: bytes) -> bool:
        """Send a oneway call; False if it cannot be queued now."""


class Proxy:
    """The methods of a remote object, named as in its interface.

    A method takes its request message. A synchronous one returns the response message, waits `timeout_s` at most
    (a keyword argument overrides the proxy's own) and raises RemoteError, DeadObjectError or TransactionTimeoutError.
    A oneway one returns True, or False if the call could not be queued now. Both raise TransactionTooLargeError.
    """

    def __init__(self, interface: Interface, target: str, channel: Channel, timeout_s: float) -> None:
        self._interface = interface
        self._target = target
        self._channel = channel
        self._timeout_s = timeout_s

    def __getattr__(self, name: str) -> Callable[..., Any]:
        # A private name that is missing must not be looked up in _interface, which may be the one missing.
        method = None if name.startswith("_") else self._interface.methods_by_name.get(name)
        if method is None:
            raise AttributeError(f"this proxy has no method {name!r}")
        bound = self._bind(method)
        setattr(self, name, bound)  # later look-ups find it without coming here
        return bound

    def get_interface_version(self, timeout_s: float | None = None) -> int:
        """Return the version of the interface that the other side speaks."""
        return self._interface_info(INTERFACE_VERSION, timeout_s).version

    def get_interface_hash(self, timeout_s: float | None = None) -> str:
        """Return the hash of the interface that the other side speaks."""
        return self._interface_info(INTERFACE_HASH, timeout_s).hash

    def _bind(self, method: Method) -> Callable[..., Any]:
        def payload_of(request: Message) -> bytes:
            if not isinstance(request, method.request_class):
                raise TypeError(
                    f"{self._interface.name}.{method.name} takes a {method.request_class.__name__}, "
                    f"not a {type(request).__name__}"
                )
            return request.SerializeToString()

        def post(request: Message) -> bool:
            return self._channel.post(self._target, method.code, payload_of(request))

        def call(request: Message, timeout_s: float | None = None) -> Message:
            timeout = self._timeout_s if timeout_s is None else timeout_s
            answer = self._channel.call(self._target, method.code, payload_of(request), timeout)
            return method.response_class.FromString(answer)

        return post if method.oneway else call

    def _interface_info(self, code: int, timeout_s: float | None) -> InterfaceInfo:
        timeout = self._timeout_s if timeout_s is None else timeout_s
        return InterfaceInfo.FromString(self._channel.call(self._target, code, b"", timeout))
