from posed.proto import binder_pb2 as _binder_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class GetServiceRequest(_message.Message):
    __slots__ = ("name", "interface")
    NAME_FIELD_NUMBER: _ClassVar[int]
    INTERFACE_FIELD_NUMBER: _ClassVar[int]
    name: str
    interface: _binder_pb2.InterfaceInfo
    def __init__(self, name: _Optional[str] = ..., interface: _Optional[_Union[_binder_pb2.InterfaceInfo, _Mapping]] = ...) -> None: ...

class ServiceInfo(_message.Message):
    __slots__ = ("interface", "boot_id")
    INTERFACE_FIELD_NUMBER: _ClassVar[int]
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    interface: _binder_pb2.InterfaceInfo
    boot_id: bytes
    def __init__(self, interface: _Optional[_Union[_binder_pb2.InterfaceInfo, _Mapping]] = ..., boot_id: _Optional[bytes] = ...) -> None: ...

class BindRequest(_message.Message):
    __slots__ = ("auto_create", "connection", "package_name", "target_sdk", "permissions")
    AUTO_CREATE_FIELD_NUMBER: _ClassVar[int]
    CONNECTION_FIELD_NUMBER: _ClassVar[int]
    PACKAGE_NAME_FIELD_NUMBER: _ClassVar[int]
    TARGET_SDK_FIELD_NUMBER: _ClassVar[int]
    PERMISSIONS_FIELD_NUMBER: _ClassVar[int]
    auto_create: bool
    connection: str
    package_name: str
    target_sdk: int
    permissions: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, auto_create: bool = ..., connection: _Optional[str] = ..., package_name: _Optional[str] = ..., target_sdk: _Optional[int] = ..., permissions: _Optional[_Iterable[str]] = ...) -> None: ...

class StopRequest(_message.Message):
    __slots__ = ("force",)
    FORCE_FIELD_NUMBER: _ClassVar[int]
    force: bool
    def __init__(self, force: bool = ...) -> None: ...

class StopReply(_message.Message):
    __slots__ = ("stopping", "bound_clients")
    STOPPING_FIELD_NUMBER: _ClassVar[int]
    BOUND_CLIENTS_FIELD_NUMBER: _ClassVar[int]
    stopping: bool
    bound_clients: int
    def __init__(self, stopping: bool = ..., bound_clients: _Optional[int] = ...) -> None: ...

class BindingDied(_message.Message):
    __slots__ = ("reason",)
    REASON_FIELD_NUMBER: _ClassVar[int]
    reason: str
    def __init__(self, reason: _Optional[str] = ...) -> None: ...

class ServiceStatus(_message.Message):
    __slots__ = ("boot_id", "pid", "uptime_ns", "started", "bound_clients", "connections", "source", "profile", "filter", "version")
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    PID_FIELD_NUMBER: _ClassVar[int]
    UPTIME_NS_FIELD_NUMBER: _ClassVar[int]
    STARTED_FIELD_NUMBER: _ClassVar[int]
    BOUND_CLIENTS_FIELD_NUMBER: _ClassVar[int]
    CONNECTIONS_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    PROFILE_FIELD_NUMBER: _ClassVar[int]
    FILTER_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    pid: int
    uptime_ns: int
    started: bool
    bound_clients: int
    connections: int
    source: str
    profile: str
    filter: str
    version: str
    def __init__(self, boot_id: _Optional[bytes] = ..., pid: _Optional[int] = ..., uptime_ns: _Optional[int] = ..., started: bool = ..., bound_clients: _Optional[int] = ..., connections: _Optional[int] = ..., source: _Optional[str] = ..., profile: _Optional[str] = ..., filter: _Optional[str] = ..., version: _Optional[str] = ...) -> None: ...
