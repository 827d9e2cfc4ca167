"""The SDK: poses and sensor events of a running posed, in Android's vocabulary."""

from posed.client.binding import ServiceState
from posed.client.event_stream import EventStream
from posed.client.handler import Handler
from posed.client.package import ACTIVITY_RECOGNITION, HIGH_SAMPLING_RATE_SENSORS, Package
from posed.client.pose import Device, Pose, PoseStatus, Position, Truth
from posed.client.pose_client import PoseClient
from posed.client.sensor import (
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    SENSOR_DELAY_UI,
    SENSOR_STATUS_ACCURACY_HIGH,
    SENSOR_STATUS_ACCURACY_LOW,
    SENSOR_STATUS_ACCURACY_MEDIUM,
    SENSOR_STATUS_NO_CONTACT,
    SENSOR_STATUS_UNRELIABLE,
    DynamicSensorCallback,
    Sensor,
    SensorEvent,
    SensorEventListener,
    TriggerEvent,
    TriggerEventListener,
)
from posed.client.sensor_manager import SensorManager

__all__ = [
    "ACTIVITY_RECOGNITION",
    "HIGH_SAMPLING_RATE_SENSORS",
    "SENSOR_DELAY_FASTEST",
    "SENSOR_DELAY_GAME",
    "SENSOR_DELAY_NORMAL",
    "SENSOR_DELAY_UI",
    "SENSOR_STATUS_ACCURACY_HIGH",
    "SENSOR_STATUS_ACCURACY_LOW",
    "SENSOR_STATUS_ACCURACY_MEDIUM",
    "SENSOR_STATUS_NO_CONTACT",
    "SENSOR_STATUS_UNRELIABLE",
    "Device",
    "DynamicSensorCallback",
    "EventStream",
    "Handler",
    "Package",
    "Pose",
    "PoseClient",
    "PoseStatus",
    "Position",
    "Sensor",
    "SensorEvent",
    "SensorEventListener",
    "SensorManager",
    "ServiceState",
    "TriggerEvent",
    "TriggerEventListener",
    "Truth",
]
