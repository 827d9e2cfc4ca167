"""What an interface offers, read from its protobuf service, and which versions of it understand each other."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from google.protobuf.descriptor import ServiceDescriptor
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

from posed.binder.status import ExceptionCode, RemoteError
from posed.proto import binder_pb2
from posed.proto.interfaces import HASHES, ONEWAY, VERSIONS

FIRST_CALL = 1
"""Code of the first method of every interface (IBinder.FIRST_CALL_TRANSACTION)."""
INTERFACE_HASH = 0x00FFFFFE
"""Code that asks for the interface hash, as AIDL's getInterfaceHash."""
INTERFACE_VERSION = 0x00FFFFFF
"""Code that asks for the interface version, as AIDL's getInterfaceVersion."""
PING = 0x5F504E47
"""Code of IBinder.PING_TRANSACTION, '_PNG'."""


@dataclass(frozen=True, slots=True)
class Method:
    """One call of an interface."""

    name: str
    code: int
    oneway: bool
    request_class: type[Message]
    response_class: type[Message]


@dataclass(frozen=True, slots=True)
class Interface:
    """One protobuf service as the two sides of a call see it."""

    name: str
    """Full name, such as `posed.ISensorService`."""
    version: int
    hash: str
    """SHA-256, hexadecimal, of the serialised descriptors of the posed .proto files behind it, in order of name."""
    methods_by_name: Mapping[str, Method]
    methods_by_code: Mapping[int, Method]

    @property
    def info(self) -> binder_pb2.InterfaceInfo:
        """The version and hash as they cross."""
        return binder_pb2.InterfaceInfo(version=self.version, hash=self.hash)


@cache
def interface_of(descriptor: ServiceDescriptor) -> Interface:
    """Return the interface that a protobuf service defines."""
    methods = [
        Method(
            name=method.name,
            code=FIRST_CALL + index,
            oneway=method.full_name in ONEWAY,
            request_class=GetMessageClass(method.input_type),
            response_class=GetMessageClass(method.output_type),
        )
        for index, method in enumerate(descriptor.methods)
    ]
    return Interface(
        name=descriptor.full_name,
        version=VERSIONS[descriptor.full_name],
        hash=HASHES[descriptor.full_name],
        methods_by_name={method.name: method for method in methods},
        methods_by_code={method.code: method for method in methods},
    )


def check_version(ours: Interface, theirs: binder_pb2.InterfaceInfo) -> None:
    """Accept a client that was made with this interface or an older one.

    Raises RemoteError: ILLEGAL_ARGUMENT for a version of 0, ILLEGAL_STATE for a newer version or for an equal version
    with another hash.
    """
    if theirs.version == 0:
        raise RemoteError(
            ExceptionCode.ILLEGAL_ARGUMENT,
            f"the client names no version of {ours.name}; versions count from 1: send the one it was made with",
        )
    if theirs.version > ours.version:
        raise RemoteError(
            ExceptionCode.ILLEGAL_STATE,
            f"the client speaks version {theirs.version} of {ours.name}, this daemon only {ours.version}; "
            "restart the daemon from the newer posed",
        )
    if theirs.version == ours.version and theirs.hash != ours.hash:
        raise RemoteError(
            ExceptionCode.ILLEGAL_STATE,
            f"client and daemon both speak version {ours.version} of {ours.name} but not the same one "
            f"(client {theirs.hash[:12] or 'none'}, daemon {ours.hash[:12]}); install the same posed on both sides",
        )
