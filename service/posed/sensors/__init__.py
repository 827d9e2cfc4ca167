"""Android's sensor service without sockets: catalogue, arbitration, FIFOs, fused sensors and the pose grid."""

from posed.sensors.client import Client
from posed.sensors.connection import EventChunk, SensorEventConnection
from posed.sensors.device_filter import device_errors, make_device_filter
from posed.sensors.service import SensorService

__all__ = ["Client", "EventChunk", "SensorEventConnection", "SensorService", "device_errors", "make_device_filter"]
