from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DeliveryHeader(_message.Message):
    __slots__ = ("boot_id", "sequence", "published_ns", "mapping")
    BOOT_ID_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    PUBLISHED_NS_FIELD_NUMBER: _ClassVar[int]
    MAPPING_FIELD_NUMBER: _ClassVar[int]
    boot_id: bytes
    sequence: int
    published_ns: int
    mapping: TimeMapping
    def __init__(self, boot_id: _Optional[bytes] = ..., sequence: _Optional[int] = ..., published_ns: _Optional[int] = ..., mapping: _Optional[_Union[TimeMapping, _Mapping]] = ...) -> None: ...

class TimeMapping(_message.Message):
    __slots__ = ("offset_ns", "scale")
    OFFSET_NS_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    offset_ns: int
    scale: float
    def __init__(self, offset_ns: _Optional[int] = ..., scale: _Optional[float] = ...) -> None: ...

class SensorEvents(_message.Message):
    __slots__ = ("header", "columns", "flush_completes", "events_dropped")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    FLUSH_COMPLETES_FIELD_NUMBER: _ClassVar[int]
    EVENTS_DROPPED_FIELD_NUMBER: _ClassVar[int]
    header: DeliveryHeader
    columns: _containers.RepeatedCompositeFieldContainer[SensorColumn]
    flush_completes: _containers.RepeatedScalarFieldContainer[int]
    events_dropped: int
    def __init__(self, header: _Optional[_Union[DeliveryHeader, _Mapping]] = ..., columns: _Optional[_Iterable[_Union[SensorColumn, _Mapping]]] = ..., flush_completes: _Optional[_Iterable[int]] = ..., events_dropped: _Optional[int] = ...) -> None: ...

class SensorColumn(_message.Message):
    __slots__ = ("handle", "timestamp_ns", "values", "accuracy")
    HANDLE_FIELD_NUMBER: _ClassVar[int]
    TIMESTAMP_NS_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    ACCURACY_FIELD_NUMBER: _ClassVar[int]
    handle: int
    timestamp_ns: _containers.RepeatedScalarFieldContainer[int]
    values: _containers.RepeatedScalarFieldContainer[float]
    accuracy: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, handle: _Optional[int] = ..., timestamp_ns: _Optional[_Iterable[int]] = ..., values: _Optional[_Iterable[float]] = ..., accuracy: _Optional[_Iterable[int]] = ...) -> None: ...
