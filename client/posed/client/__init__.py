"""The SDK: poses and sensor events of a running posed, in Android's vocabulary."""

from posed.client.pose import Device, Pose, PoseStatus, Position, Truth
from posed.client.pose_client import PoseClient
from posed.client.sensor import (
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    SENSOR_DELAY_UI,
    Sensor,
    SensorEvent,
    SensorEventListener,
)
from posed.client.sensor_manager import SensorManager
from posed.client.service import ServiceState

__all__ = [
    "SENSOR_DELAY_FASTEST",
    "SENSOR_DELAY_GAME",
    "SENSOR_DELAY_NORMAL",
    "SENSOR_DELAY_UI",
    "Device",
    "Pose",
    "PoseClient",
    "PoseStatus",
    "Position",
    "Sensor",
    "SensorEvent",
    "SensorEventListener",
    "SensorManager",
    "ServiceState",
    "Truth",
]
