"""The envelope: calls and replies to bytes, never more than a parcel may hold."""

from posed.binder.status import ExceptionCode, TransactionTooLargeError
from posed.proto.binder_pb2 import Parcel, Reply, Status, Transaction

MAX_PARCEL_BYTES = 64 * 1024
"""Largest parcel sent; the sockets' own limit lies above it, because libzmq drops what exceeds it without a word."""


def encode_transaction(call_id: int, target: str, code: int, payload: bytes) -> bytes:
    """Return a call as a parcel; raises TransactionTooLargeError above MAX_PARCEL_BYTES."""
    transaction = Transaction(call_id=call_id, target=target, code=code, payload=payload)
    data = Parcel(transaction=transaction).SerializeToString()
    if len(data) > MAX_PARCEL_BYTES:
        raise TransactionTooLargeError(
            f"a call of {target!r} takes {len(data)} bytes, a parcel can have {MAX_PARCEL_BYTES}; send it in parts"
        )
    return data


def encode_reply(call_id: int, status: Status, payload: bytes = b"") -> bytes:
    """Return a reply as a parcel; one above MAX_PARCEL_BYTES becomes a TRANSACTION_FAILED status."""
    data = Parcel(reply=Reply(call_id=call_id, status=status, payload=payload)).SerializeToString()
    if len(data) <= MAX_PARCEL_BYTES:
        return data
    failed = Status(
        exception_code=ExceptionCode.TRANSACTION_FAILED,
        message=f"the reply takes {len(data)} bytes, a parcel can have {MAX_PARCEL_BYTES}; ask for less at once",
    )
    return Parcel(reply=Reply(call_id=call_id, status=failed)).SerializeToString()
