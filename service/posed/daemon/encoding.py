"""Events, poses and truth as they cross the wire."""

from collections.abc import Iterable
from typing import cast

from posed.clock import TimeMap
from posed.events import Pose, Position, SensorInfo, Truth
from posed.proto import events_pb2, pose_pb2, sensors_pb2
from posed.sensors import EventChunk


def pose_topic(period_us: int) -> bytes:
    """Return the topic of the poses of one period, zero byte included."""
    return b"pose/%d\0" % period_us


def truth_topic(period_us: int) -> bytes:
    """Return the topic of the truth beside the poses of one period, zero byte included."""
    return b"truth/%d\0" % period_us


def delivery_header(boot_id: bytes, sequence: int, published_ns: int, mapping: TimeMap) -> events_pb2.DeliveryHeader:
    """Return the header of a message sent at `published_ns` (CLOCK_BOOTTIME)."""
    return events_pb2.DeliveryHeader(
        boot_id=boot_id,
        sequence=sequence,
        published_ns=published_ns,
        mapping=events_pb2.TimeMapping(offset_ns=mapping.offset_ns, scale=mapping.scale),
    )


def pose(pose: Pose) -> pose_pb2.Pose:
    """Return a pose as its message."""
    orientation = pose.orientation
    x, y, z, w = orientation.quaternion
    wx, wy, wz = orientation.angular_rate
    message = pose_pb2.Pose(
        timestamp_ns=orientation.timestamp_ns,
        orientation=pose_pb2.Quaternion(x=x, y=y, z=z, w=w),
        angular_rate=pose_pb2.Vector3(x=wx, y=wy, z=wz),
        heading_accuracy=orientation.heading_accuracy,
        filter=pose.filter_name,
        status=int(orientation.status),
        rate_mode=cast("pose_pb2.RateMode", pose.rate_mode),
        events_fused=pose.events_fused,
    )
    if pose.position is not None:
        message.position.CopyFrom(_position(pose.position, orientation.timestamp_ns))
    return message


def truth(truth: Truth) -> pose_pb2.Truth:
    """Return a truth as its message."""
    x, y, z, w = truth.quaternion
    message = pose_pb2.Truth(
        timestamp_ns=truth.timestamp_ns,
        orientation=pose_pb2.Quaternion(x=x, y=y, z=z, w=w),
        declination=truth.declination,
    )
    if truth.position_enu is not None:
        east, north, up = truth.position_enu
        message.position_enu.CopyFrom(pose_pb2.Vector3(x=east, y=north, z=up))
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
