"""Events, poses and truth as they cross the wire."""

from collections.abc import Iterable
from functools import lru_cache
from typing import cast

from posed.clock import TimeMap
from posed.events import Pose, Position, SensorInfo, Truth
from posed.proto import events_pb2, pose_pb2, sensors_pb2
from posed.sensors import EventChunk


@lru_cache
def pose_topic(period_us: int, filter_name: str) -> bytes:
    """Return the topic of a filter's poses of one period, zero byte included."""
    return f"pose/{period_us}/{filter_name}\0".encode("ascii")


@lru_cache
def truth_topic(period_us: int, filter_name: str) -> bytes:
    """Return the topic of the truth beside a filter's poses of one period, zero byte included."""
    return f"truth/{period_us}/{filter_name}\0".encode("ascii")


def delivery_header(boot_id: bytes, sequence: int, published_ns: int, mapping: TimeMap) -> events_pb2.DeliveryHeader:
    """Return the header of a message sent at `published_ns` (CLOCK_BOOTTIME)."""
    return events_pb2.DeliveryHeader(
        boot_id=boot_id,
        sequence=sequence,
        published_ns=published_ns,
        mapping=events_pb2.TimeMapping(offset_ns=mapping.offset_ns, scale=mapping.scale),
    )


class PoseEncoder:
    """Poses as bytes, made in one message that is kept with its parts: making them anew takes twice the time."""

    def __init__(self, boot_id: bytes) -> None:
        self._message = pose_pb2.PoseMessage()
        self._header = self._message.header
        self._header.boot_id = boot_id
        self._mapping = self._header.mapping
        self._pose = self._message.pose
        self._quaternion = self._pose.orientation
        self._rate = self._pose.angular_rate
        self._has_position = False

    def encode(self, pose: Pose, published_ns: int, mapping: TimeMap) -> bytes:
        """Return the message of a pose sent at `published_ns` (CLOCK_BOOTTIME)."""
        header = self._header
        header.sequence = pose.sequence
        header.published_ns = published_ns
        self._mapping.offset_ns = mapping.offset_ns
        self._mapping.scale = mapping.scale
        orientation = pose.orientation
        message = self._pose
        message.timestamp_ns = orientation.timestamp_ns
        quaternion = self._quaternion
        quaternion.x, quaternion.y, quaternion.z, quaternion.w = orientation.quaternion
        rate = self._rate
        rate.x, rate.y, rate.z = orientation.angular_rate
        message.heading_accuracy = orientation.heading_accuracy
        message.filter = pose.filter_name
        message.status = int(orientation.status)
        message.rate_mode = cast("pose_pb2.RateMode", pose.rate_mode)
        message.events_fused = pose.events_fused
        message.predicted_ns = pose.predicted_ns
        if pose.position is not None:
            message.position.CopyFrom(_position(pose.position, orientation.timestamp_ns))
            self._has_position = True
        elif self._has_position:
            message.ClearField("position")
            self._has_position = False
        return self._message.SerializeToString()


def truth(truth: Truth, instant_ns: int, at_instant: Truth | None) -> pose_pb2.Truth:
    """Return the truth at a pose's sample time, and at its grid instant, as a message."""
    message = pose_pb2.Truth(
        timestamp_ns=truth.timestamp_ns,
        orientation=_quaternion(truth),
        declination=truth.declination,
        position_enu=_position_enu(truth),
        instant_ns=instant_ns,
    )
    if at_instant is not None:
        message.instant_orientation.CopyFrom(_quaternion(at_instant))
        position = _position_enu(at_instant)
        if position is not None:
            message.instant_position_enu.CopyFrom(position)
    return message


def sensor_events(header: events_pb2.DeliveryHeader, chunk: EventChunk, dropped: int) -> events_pb2.SensorEvents:
    """Return a chunk of one listener's events as its message."""
    return events_pb2.SensorEvents(
        header=header,
        columns=[
            events_pb2.SensorColumn(
                handle=handle,
                timestamp_ns=column.timestamp_ns.tolist(),
                values=column.values.ravel().tolist(),
                accuracy=[int(column.accuracy[0])]
                if (column.accuracy == column.accuracy[0]).all()
                else column.accuracy.tolist(),
            )
            for handle, column in chunk.columns.items()
        ],
        flush_completes=chunk.flush_completes,
        events_dropped=dropped,
    )


def sensor_list(sensors: Iterable[SensorInfo]) -> sensors_pb2.SensorList:
    """Return the sensor list as its message."""
    return sensors_pb2.SensorList(
        sensors=[
            sensors_pb2.SensorInfo(
                handle=sensor.handle,
                type=int(sensor.type),
                string_type=sensor.type.string_type,
                name=sensor.name,
                vendor=sensor.vendor,
                version=sensor.version,
                max_range=sensor.max_range,
                resolution=sensor.resolution,
                power_ma=sensor.power_ma,
                min_delay_us=sensor.min_delay_us,
                max_delay_us=sensor.max_delay_us,
                fifo_reserved_event_count=sensor.fifo_reserved_event_count,
                fifo_max_event_count=sensor.fifo_max_event_count,
                reporting_mode=int(sensor.reporting_mode),
                wake_up=sensor.wake_up,
                required_permission=sensor.required_permission,
                is_dynamic=sensor.is_dynamic,
                has_additional_info=sensor.has_additional_info,
                supports_data_injection=sensor.supports_data_injection,
                id=-1 if sensor.is_dynamic else 0,
            )
            for sensor in sensors
        ]
    )


def _position(position: Position, timestamp_ns: int) -> pose_pb2.Position:
    east, north, up = position.velocity_enu
    message = pose_pb2.Position(
        latitude_deg=position.latitude_deg,
        longitude_deg=position.longitude_deg,
        ellipsoidal_height_m=position.height_m,
        covariance_enu=position.covariance_enu,
        velocity_enu=pose_pb2.Vector3(x=east, y=north, z=up),
        source=position.source,
    )
    if position.timestamp_ns is not None:
        message.age_ns = timestamp_ns - position.timestamp_ns
    return message


def _quaternion(truth: Truth) -> pose_pb2.Quaternion:
    x, y, z, w = truth.quaternion
    return pose_pb2.Quaternion(x=x, y=y, z=z, w=w)


def _position_enu(truth: Truth) -> pose_pb2.Vector3 | None:
    if truth.position_enu is None:
        return None
    east, north, up = truth.position_enu
    return pose_pb2.Vector3(x=east, y=north, z=up)
