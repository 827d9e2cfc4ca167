"""How a call ends: Android's exception codes, and the errors of a call."""

from enum import IntEnum

from posed.errors import InvalidArgumentError, PosedError
from posed.proto.binder_pb2 import Status


class ExceptionCode(IntEnum):
    """The codes with which android.os.Parcel writes an exception."""

    SECURITY = -1
    BAD_PARCELABLE = -2
    ILLEGAL_ARGUMENT = -3
    NULL_POINTER = -4
    ILLEGAL_STATE = -5
    UNSUPPORTED_OPERATION = -7
    SERVICE_SPECIFIC = -8
    TRANSACTION_FAILED = -129


class RemoteError(PosedError):
    """A call was answered with an exception; raised by a handler, it answers the caller with that code.

    exception_code: an ExceptionCode, or a plain int where the other side sent one that has no name here.
    service_specific_error: the service's own code, with SERVICE_SPECIFIC only.
    """

    def __init__(self, exception_code: int, message: str, service_specific_error: int = 0) -> None:
        super().__init__(message)
        self.exception_code = ExceptionCode(exception_code) if exception_code in _KNOWN else exception_code
        self.service_specific_error = service_specific_error


class DeadObjectError(PosedError):
    """The process at the other end is gone, or not there yet."""


class TransactionTooLargeError(PosedError):
    """A call does not fit into a parcel; nothing was sent."""


class TransactionTimeoutError(PosedError):
    """A call was not answered in time; whether it was carried out is not known."""


def status_of(error: PosedError) -> Status:
    """Return the status with which an error raised by a handler crosses to the caller."""
    # An error can quote a request of nearly the parcel limit; quoted whole, the answer would not fit in turn.
    # File names that are not UTF-8 come with surrogates, which no protobuf string takes.
    message = str(error)[:_MESSAGE_LIMIT].encode(errors="replace").decode()
    if isinstance(error, RemoteError):
        return Status(
            exception_code=error.exception_code, message=message, service_specific_error=error.service_specific_error
        )
    code = ExceptionCode.ILLEGAL_ARGUMENT if isinstance(error, InvalidArgumentError) else ExceptionCode.ILLEGAL_STATE
    return Status(exception_code=code, message=message)


def raise_for(status: Status) -> None:
    """Raise RemoteError unless the status says that the call succeeded."""
    if status.exception_code != 0:
        raise RemoteError(status.exception_code, status.message, status.service_specific_error)


_KNOWN = frozenset(ExceptionCode)
_MESSAGE_LIMIT = 2000
