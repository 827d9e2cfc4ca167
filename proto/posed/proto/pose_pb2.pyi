from posed.proto import binder_pb2 as _binder_pb2
from posed.proto import events_pb2 as _events_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class RateMode(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    RATE_MODE_FASTEST: _ClassVar[RateMode]
    RATE_MODE_GAME: _ClassVar[RateMode]
    RATE_MODE_UI: _ClassVar[RateMode]
    RATE_MODE_NORMAL: _ClassVar[RateMode]
    RATE_MODE_CUSTOM: _ClassVar[RateMode]
RATE_MODE_FASTEST: RateMode
RATE_MODE_GAME: RateMode
RATE_MODE_UI: RateMode
RATE_MODE_NORMAL: RateMode
RATE_MODE_CUSTOM: RateMode

class PoseRequest(_message.Message):
    __slots__ = ("listener", "pose_period_us", "sampling_period_us", "filter")
    LISTENER_FIELD_NUMBER: _ClassVar[int]
    POSE_PERIOD_US_FIELD_NUMBER: _ClassVar[int]
    SAMPLING_PERIOD_US_FIELD_NUMBER: _ClassVar[int]
    FILTER_FIELD_NUMBER: _ClassVar[int]
    listener: str
    pose_period_us: int
    sampling_period_us: int
    filter: str
    def __init__(self, listener: _Optional[str] = ..., pose_period_us: _Optional[int] = ..., sampling_period_us: _Optional[int] = ..., filter: _Optional[str] = ...) -> None: ...

class UnregisterPoseRequest(_message.Message):
    __slots__ = ("listener",)
    LISTENER_FIELD_NUMBER: _ClassVar[int]
    listener: str
    def __init__(self, listener: _Optional[str] = ...) -> None: ...

class PoseRegistration(_message.Message):
    __slots__ = ("pose_topic", "truth_topic", "configuration", "device")
    POSE_TOPIC_FIELD_NUMBER: _ClassVar[int]
    TRUTH_TOPIC_FIELD_NUMBER: _ClassVar[int]
    CONFIGURATION_FIELD_NUMBER: _ClassVar[int]
    DEVICE_FIELD_NUMBER: _ClassVar[int]
    pose_topic: bytes
    truth_topic: bytes
    configuration: PoseConfiguration
    device: Device
    def __init__(self, pose_topic: _Optional[bytes] = ..., truth_topic: _Optional[bytes] = ..., configuration: _Optional[_Union[PoseConfiguration, _Mapping]] = ..., device: _Optional[_Union[Device, _Mapping]] = ...) -> None: ...

class Device(_message.Message):
    __slots__ = ("profile", "camera_fov_deg", "screen_rotation_deg")
    PROFILE_FIELD_NUMBER: _ClassVar[int]
    CAMERA_FOV_DEG_FIELD_NUMBER: _ClassVar[int]
    SCREEN_ROTATION_DEG_FIELD_NUMBER: _ClassVar[int]
    profile: str
    camera_fov_deg: float
    screen_rotation_deg: int
    def __init__(self, profile: _Optional[str] = ..., camera_fov_deg: _Optional[float] = ..., screen_rotation_deg: _Optional[int] = ...) -> None: ...

class PoseConfiguration(_message.Message):
    __slots__ = ("rate_mode", "sampling_period_us", "filter")
    RATE_MODE_FIELD_NUMBER: _ClassVar[int]
    SAMPLING_PERIOD_US_FIELD_NUMBER: _ClassVar[int]
    FILTER_FIELD_NUMBER: _ClassVar[int]
    rate_mode: RateMode
    sampling_period_us: int
    filter: str
    def __init__(self, rate_mode: _Optional[_Union[RateMode, str]] = ..., sampling_period_us: _Optional[int] = ..., filter: _Optional[str] = ...) -> None: ...

class PoseMessage(_message.Message):
    __slots__ = ("header", "pose")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    header: _events_pb2.DeliveryHeader
    pose: Pose
    def __init__(self, header: _Optional[_Union[_events_pb2.DeliveryHeader, _Mapping]] = ..., pose: _Optional[_Union[Pose, _Mapping]] = ...) -> None: ...

class Pose(_message.Message):
    __slots__ = ("timestamp_ns", "orientation", "angular_rate", "heading_accuracy", "filter", "status", "rate_mode", "events_fused", "position", "predicted_ns")
    TIMESTAMP_NS_FIELD_NUMBER: _ClassVar[int]
    ORIENTATION_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_RATE_FIELD_NUMBER: _ClassVar[int]
    HEADING_ACCURACY_FIELD_NUMBER: _ClassVar[int]
    FILTER_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    RATE_MODE_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FUSED_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    PREDICTED_NS_FIELD_NUMBER: _ClassVar[int]
    timestamp_ns: int
    orientation: Quaternion
    angular_rate: Vector3
    heading_accuracy: float
    filter: str
    status: int
    rate_mode: RateMode
    events_fused: int
    position: Position
    predicted_ns: int
    def __init__(self, timestamp_ns: _Optional[int] = ..., orientation: _Optional[_Union[Quaternion, _Mapping]] = ..., angular_rate: _Optional[_Union[Vector3, _Mapping]] = ..., heading_accuracy: _Optional[float] = ..., filter: _Optional[str] = ..., status: _Optional[int] = ..., rate_mode: _Optional[_Union[RateMode, str]] = ..., events_fused: _Optional[int] = ..., position: _Optional[_Union[Position, _Mapping]] = ..., predicted_ns: _Optional[int] = ...) -> None: ...

class Quaternion(_message.Message):
    __slots__ = ("x", "y", "z", "w")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    W_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    w: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ..., w: _Optional[float] = ...) -> None: ...

class Vector3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Position(_message.Message):
    __slots__ = ("latitude_deg", "longitude_deg", "ellipsoidal_height_m", "covariance_enu", "velocity_enu", "source", "age_ns")
    LATITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    LONGITUDE_DEG_FIELD_NUMBER: _ClassVar[int]
    ELLIPSOIDAL_HEIGHT_M_FIELD_NUMBER: _ClassVar[int]
    COVARIANCE_ENU_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_ENU_FIELD_NUMBER: _ClassVar[int]
    SOURCE_FIELD_NUMBER: _ClassVar[int]
    AGE_NS_FIELD_NUMBER: _ClassVar[int]
    latitude_deg: float
    longitude_deg: float
    ellipsoidal_height_m: float
    covariance_enu: _containers.RepeatedScalarFieldContainer[float]
    velocity_enu: Vector3
    source: str
    age_ns: int
    def __init__(self, latitude_deg: _Optional[float] = ..., longitude_deg: _Optional[float] = ..., ellipsoidal_height_m: _Optional[float] = ..., covariance_enu: _Optional[_Iterable[float]] = ..., velocity_enu: _Optional[_Union[Vector3, _Mapping]] = ..., source: _Optional[str] = ..., age_ns: _Optional[int] = ...) -> None: ...

class TruthMessage(_message.Message):
    __slots__ = ("header", "truth")
    HEADER_FIELD_NUMBER: _ClassVar[int]
    TRUTH_FIELD_NUMBER: _ClassVar[int]
    header: _events_pb2.DeliveryHeader
    truth: Truth
    def __init__(self, header: _Optional[_Union[_events_pb2.DeliveryHeader, _Mapping]] = ..., truth: _Optional[_Union[Truth, _Mapping]] = ...) -> None: ...

class Truth(_message.Message):
    __slots__ = ("timestamp_ns", "orientation", "declination", "position_enu", "instant_ns", "instant_orientation", "instant_position_enu")
    TIMESTAMP_NS_FIELD_NUMBER: _ClassVar[int]
    ORIENTATION_FIELD_NUMBER: _ClassVar[int]
    DECLINATION_FIELD_NUMBER: _ClassVar[int]
    POSITION_ENU_FIELD_NUMBER: _ClassVar[int]
    INSTANT_NS_FIELD_NUMBER: _ClassVar[int]
    INSTANT_ORIENTATION_FIELD_NUMBER: _ClassVar[int]
    INSTANT_POSITION_ENU_FIELD_NUMBER: _ClassVar[int]
    timestamp_ns: int
    orientation: Quaternion
    declination: float
    position_enu: Vector3
    instant_ns: int
    instant_orientation: Quaternion
    instant_position_enu: Vector3
    def __init__(self, timestamp_ns: _Optional[int] = ..., orientation: _Optional[_Union[Quaternion, _Mapping]] = ..., declination: _Optional[float] = ..., position_enu: _Optional[_Union[Vector3, _Mapping]] = ..., instant_ns: _Optional[int] = ..., instant_orientation: _Optional[_Union[Quaternion, _Mapping]] = ..., instant_position_enu: _Optional[_Union[Vector3, _Mapping]] = ...) -> None: ...
