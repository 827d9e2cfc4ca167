"""An object that others call: its methods, and one call of them from bytes to bytes."""

import logging
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.message import DecodeError

from posed.binder.interface import INTERFACE_HASH, INTERFACE_VERSION, PING, Interface, Method, interface_of
from posed.binder.peer import Peer
from posed.binder.status import ExceptionCode, RemoteError, status_of
from posed.errors import PosedError
from posed.proto.binder_pb2 import Status, Transaction

_log = logging.getLogger(__name__)

META_CODES = frozenset({INTERFACE_HASH, INTERFACE_VERSION, PING})
"""Calls that every object answers by itself."""


@dataclass(frozen=True, slots=True)
class Caller:
    """Who makes a call."""

    peer: Peer

    @property
    def uid(self) -> int:
        return self.peer.uid

    @property
    def pid(self) -> int:
        return self.peer.pid


class Stub:
    """Base of an object that can be called: a method a call, named as in the .proto.

    A method is called with (request, caller) and returns the response message; a oneway method's result is not looked
    at. What it raises crosses to the caller: RemoteError with its own code, InvalidArgumentError as ILLEGAL_ARGUMENT,
    any other PosedError as ILLEGAL_STATE; anything else is logged and answered with TRANSACTION_FAILED.
    """

    descriptor: ClassVar[ServiceDescriptor]

    def __new__(cls, *_args: Any, **_kwargs: Any) -> Self:
        # Here, not in __init__, so that a subclass that forgets super().__init__() is checked all the same.
        missing = [
            name for name in interface_of(cls.descriptor).methods_by_name if not callable(getattr(cls, name, None))
        ]
        if missing:
            raise TypeError(f"{cls.__name__} does not implement {', '.join(missing)} of {cls.descriptor.full_name}")
        return super().__new__(cls)

    @property
    def interface(self) -> Interface:
        """The interface it implements."""
        return interface_of(self.descriptor)


def dispatch(stub: Stub, transaction: Transaction, caller: Caller) -> tuple[Status, bytes]:
    """Carry out a call and return its status and serialised response; raises BadTransactionError if it is malformed."""
    if transaction.code in META_CODES:
        _require(bool(transaction.call_id), f"code {transaction.code:#010x} is answered and needs a call_id")
        info = b"" if transaction.code == PING else stub.interface.info.SerializeToString()
        return Status(), info
    method = stub.interface.methods_by_code.get(transaction.code)
    if method is None:
        raise BadTransactionError(
            ExceptionCode.UNSUPPORTED_OPERATION,
            f"{stub.interface.name} version {stub.interface.version} has no method with code {transaction.code}",
        )
    _require(
        method.oneway == (transaction.call_id == 0),
        f"{method.name} is {'oneway and takes no' if method.oneway else 'answered and needs a'} call_id",
    )
    try:
        request = method.request_class.FromString(transaction.payload)
    except DecodeError:
        raise BadTransactionError(
            ExceptionCode.BAD_PARCELABLE, f"the payload of {method.name} is no {method.request_class.__name__}"
        ) from None
    return _invoke(stub, method, request, caller)


class BadTransactionError(RemoteError):
    """A call that no method can be given."""


def _invoke(stub: Stub, method: Method, request: Any, caller: Caller) -> tuple[Status, bytes]:
    try:
        try:
            response = getattr(stub, method.name)(request, caller)
        except PosedError as error:
            if method.oneway:
                # Nobody waits for the answer; without this line it would be lost.
                _log.warning("oneway %s of %s failed: %s", method.name, stub.interface.name, error)
            return status_of(error), b""
        if method.oneway:
            return Status(), b""
        if not isinstance(response, method.response_class):
            raise TypeError(f"{method.name} returned {response!r}, not a {method.response_class.__name__}")
        return Status(), response.SerializeToString()
    except Exception:
        _log.exception("%s of %s failed", method.name, stub.interface.name)
        return Status(exception_code=ExceptionCode.TRANSACTION_FAILED, message="internal error"), b""


def _require(held: bool, otherwise: str) -> None:
    if not held:
        raise BadTransactionError(ExceptionCode.BAD_PARCELABLE, otherwise)
