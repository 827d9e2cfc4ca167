from posed.proto import binder_pb2 as _binder_pb2
from posed.proto import events_pb2 as _events_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SensorList(_message.Message):
    __slots__ = ("sensors",)
    SENSORS_FIELD_NUMBER: _ClassVar[int]
    sensors: _containers.RepeatedCompositeFieldContainer[SensorInfo]
    def __init__(self, sensors: _Optional[_Iterable[_Union[SensorInfo, _Mapping]]] = ...) -> None: ...

class SensorInfo(_message.Message):
    __slots__ = ("handle", "type", "string_type", "name", "vendor", "version", "max_range", "resolution", "power_ma", "min_delay_us", "max_delay_us", "fifo_reserved_event_count", "fifo_max_event_count", "reporting_mode", "wake_up", "required_permission", "is_dynamic", "has_additional_info", "supports_data_injection", "id")
    HANDLE_FIELD_NUMBER: _ClassVar[int]
    TYPE_FIELD_NUMBER: _ClassVar[int]
    STRING_TYPE_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    VENDOR_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    MAX_RANGE_FIELD_NUMBER: _ClassVar[int]
    RESOLUTION_FIELD_NUMBER: _ClassVar[int]
    POWER_MA_FIELD_NUMBER: _ClassVar[int]
    MIN_DELAY_US_FIELD_NUMBER: _ClassVar[int]
    MAX_DELAY_US_FIELD_NUMBER: _ClassVar[int]
    FIFO_RESERVED_EVENT_COUNT_FIELD_NUMBER: _ClassVar[int]
    FIFO_MAX_EVENT_COUNT_FIELD_NUMBER: _ClassVar[int]
    REPORTING_MODE_FIELD_NUMBER: _ClassVar[int]
    WAKE_UP_FIELD_NUMBER: _ClassVar[int]
    REQUIRED_PERMISSION_FIELD_NUMBER: _ClassVar[int]
    IS_DYNAMIC_FIELD_NUMBER: _ClassVar[int]
    HAS_ADDITIONAL_INFO_FIELD_NUMBER: _ClassVar[int]
    SUPPORTS_DATA_INJECTION_FIELD_NUMBER: _ClassVar[int]
    ID_FIELD_NUMBER: _ClassVar[int]
    handle: int
    type: int
    string_type: str
    name: str
    vendor: str
    version: int
    max_range: float
    resolution: float
    power_ma: float
    min_delay_us: int
    max_delay_us: int
    fifo_reserved_event_count: int
    fifo_max_event_count: int
    reporting_mode: int
    wake_up: bool
    required_permission: str
    is_dynamic: bool
    has_additional_info: bool
    supports_data_injection: bool
    id: int
    def __init__(self, handle: _Optional[int] = ..., type: _Optional[int] = ..., string_type: _Optional[str] = ..., name: _Optional[str] = ..., vendor: _Optional[str] = ..., version: _Optional[int] = ..., max_range: _Optional[float] = ..., resolution: _Optional[float] = ..., power_ma: _Optional[float] = ..., min_delay_us: _Optional[int] = ..., max_delay_us: _Optional[int] = ..., fifo_reserved_event_count: _Optional[int] = ..., fifo_max_event_count: _Optional[int] = ..., reporting_mode: _Optional[int] = ..., wake_up: bool = ..., required_permission: _Optional[str] = ..., is_dynamic: bool = ..., has_additional_info: bool = ..., supports_data_injection: bool = ..., id: _Optional[int] = ...) -> None: ...

class EnableSensorRequest(_message.Message):
    __slots__ = ("listener", "handle", "sampling_period_us", "max_report_latency_us", "decimate")
    LISTENER_FIELD_NUMBER: _ClassVar[int]
    HANDLE_FIELD_NUMBER: _ClassVar[int]
    SAMPLING_PERIOD_US_FIELD_NUMBER: _ClassVar[int]
    MAX_REPORT_LATENCY_US_FIELD_NUMBER: _ClassVar[int]
    DECIMATE_FIELD_NUMBER: _ClassVar[int]
    listener: str
    handle: int
    sampling_period_us: int
    max_report_latency_us: int
    decimate: bool
    def __init__(self, listener: _Optional[str] = ..., handle: _Optional[int] = ..., sampling_period_us: _Optional[int] = ..., max_report_latency_us: _Optional[int] = ..., decimate: bool = ...) -> None: ...

class DisableSensorRequest(_message.Message):
    __slots__ = ("listener", "handle")
    LISTENER_FIELD_NUMBER: _ClassVar[int]
    HANDLE_FIELD_NUMBER: _ClassVar[int]
    listener: str
    handle: int
    def __init__(self, listener: _Optional[str] = ..., handle: _Optional[int] = ...) -> None: ...

class FlushRequest(_message.Message):
    __slots__ = ("listener",)
    LISTENER_FIELD_NUMBER: _ClassVar[int]
    listener: str
    def __init__(self, listener: _Optional[str] = ...) -> None: ...

class DynamicSensorCallbackRequest(_message.Message):
    __slots__ = ("callback",)
    CALLBACK_FIELD_NUMBER: _ClassVar[int]
    callback: str
    def __init__(self, callback: _Optional[str] = ...) -> None: ...

class SetEnvironmentRequest(_message.Message):
    __slots__ = ("type", "value")
    TYPE_FIELD_NUMBER: _ClassVar[int]
    VALUE_FIELD_NUMBER: _ClassVar[int]
    type: int
    value: float
    def __init__(self, type: _Optional[int] = ..., value: _Optional[float] = ...) -> None: ...

class DumpRequest(_message.Message):
    __slots__ = ("offset",)
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    offset: int
    def __init__(self, offset: _Optional[int] = ...) -> None: ...

class DumpReply(_message.Message):
    __slots__ = ("text", "more")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    MORE_FIELD_NUMBER: _ClassVar[int]
    text: str
    more: bool
    def __init__(self, text: _Optional[str] = ..., more: bool = ...) -> None: ...

class Statistics(_message.Message):
    __slots__ = ("timestamp_ns", "process_cpu_ns", "source_cpu_ns", "filter_cpu_ns", "wakeups", "events_fused", "poses_published", "poses_skipped", "lateness_p50_ms", "lateness_p99_ms", "sensors", "listeners", "parcels_refused", "source_ended", "filters_compiled")
    TIMESTAMP_NS_FIELD_NUMBER: _ClassVar[int]
    PROCESS_CPU_NS_FIELD_NUMBER: _ClassVar[int]
    SOURCE_CPU_NS_FIELD_NUMBER: _ClassVar[int]
    FILTER_CPU_NS_FIELD_NUMBER: _ClassVar[int]
    WAKEUPS_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FUSED_FIELD_NUMBER: _ClassVar[int]
    POSES_PUBLISHED_FIELD_NUMBER: _ClassVar[int]
    POSES_SKIPPED_FIELD_NUMBER: _ClassVar[int]
    LATENESS_P50_MS_FIELD_NUMBER: _ClassVar[int]
    LATENESS_P99_MS_FIELD_NUMBER: _ClassVar[int]
    SENSORS_FIELD_NUMBER: _ClassVar[int]
    LISTENERS_FIELD_NUMBER: _ClassVar[int]
    PARCELS_REFUSED_FIELD_NUMBER: _ClassVar[int]
    SOURCE_ENDED_FIELD_NUMBER: _ClassVar[int]
    FILTERS_COMPILED_FIELD_NUMBER: _ClassVar[int]
    timestamp_ns: int
    process_cpu_ns: int
    source_cpu_ns: int
    filter_cpu_ns: int
    wakeups: int
    events_fused: int
    poses_published: int
    poses_skipped: int
    lateness_p50_ms: float
    lateness_p99_ms: float
    sensors: _containers.RepeatedCompositeFieldContainer[SensorStatistics]
    listeners: _containers.RepeatedCompositeFieldContainer[ListenerStatistics]
    parcels_refused: int
    source_ended: bool
    filters_compiled: bool
    def __init__(self, timestamp_ns: _Optional[int] = ..., process_cpu_ns: _Optional[int] = ..., source_cpu_ns: _Optional[int] = ..., filter_cpu_ns: _Optional[int] = ..., wakeups: _Optional[int] = ..., events_fused: _Optional[int] = ..., poses_published: _Optional[int] = ..., poses_skipped: _Optional[int] = ..., lateness_p50_ms: _Optional[float] = ..., lateness_p99_ms: _Optional[float] = ..., sensors: _Optional[_Iterable[_Union[SensorStatistics, _Mapping]]] = ..., listeners: _Optional[_Iterable[_Union[ListenerStatistics, _Mapping]]] = ..., parcels_refused: _Optional[int] = ..., source_ended: bool = ..., filters_compiled: bool = ...) -> None: ...

class SensorStatistics(_message.Message):
    __slots__ = ("handle", "requested_period_us", "configured_period_ns", "max_report_latency_us", "registrations", "events")
    HANDLE_FIELD_NUMBER: _ClassVar[int]
    REQUESTED_PERIOD_US_FIELD_NUMBER: _ClassVar[int]
    CONFIGURED_PERIOD_NS_FIELD_NUMBER: _ClassVar[int]
    MAX_REPORT_LATENCY_US_FIELD_NUMBER: _ClassVar[int]
    REGISTRATIONS_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    handle: int
    requested_period_us: int
    configured_period_ns: int
    max_report_latency_us: int
    registrations: int
    events: int
    def __init__(self, handle: _Optional[int] = ..., requested_period_us: _Optional[int] = ..., configured_period_ns: _Optional[int] = ..., max_report_latency_us: _Optional[int] = ..., registrations: _Optional[int] = ..., events: _Optional[int] = ...) -> None: ...

class ListenerStatistics(_message.Message):
    __slots__ = ("uid", "pid", "listener", "events_sent", "events_dropped", "events_cached", "package_name", "events_received")
    UID_FIELD_NUMBER: _ClassVar[int]
    PID_FIELD_NUMBER: _ClassVar[int]
    LISTENER_FIELD_NUMBER: _ClassVar[int]
    EVENTS_SENT_FIELD_NUMBER: _ClassVar[int]
    EVENTS_DROPPED_FIELD_NUMBER: _ClassVar[int]
    EVENTS_CACHED_FIELD_NUMBER: _ClassVar[int]
    PACKAGE_NAME_FIELD_NUMBER: _ClassVar[int]
    EVENTS_RECEIVED_FIELD_NUMBER: _ClassVar[int]
    uid: int
    pid: int
    listener: str
    events_sent: int
    events_dropped: int
    events_cached: int
    package_name: str
    events_received: int
    def __init__(self, uid: _Optional[int] = ..., pid: _Optional[int] = ..., listener: _Optional[str] = ..., events_sent: _Optional[int] = ..., events_dropped: _Optional[int] = ..., events_cached: _Optional[int] = ..., package_name: _Optional[str] = ..., events_received: _Optional[int] = ...) -> None: ...
