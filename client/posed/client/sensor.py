"""Sensors and their events as Android's SDK has them (android.hardware.Sensor, SensorEvent, TriggerEvent)."""

import numbers
from dataclasses import dataclass
from typing import ClassVar, Protocol

from posed.errors import InvalidArgumentError
from posed.proto import sensors_pb2

SENSOR_DELAY_FASTEST = 0
SENSOR_DELAY_GAME = 1
SENSOR_DELAY_UI = 2
SENSOR_DELAY_NORMAL = 3

SENSOR_STATUS_NO_CONTACT = -1
SENSOR_STATUS_UNRELIABLE = 0
SENSOR_STATUS_ACCURACY_LOW = 1
SENSOR_STATUS_ACCURACY_MEDIUM = 2
SENSOR_STATUS_ACCURACY_HIGH = 3

_DELAY_US = {
    SENSOR_DELAY_FASTEST: 0,
    SENSOR_DELAY_GAME: 20_000,
    SENSOR_DELAY_UI: 66_667,
    SENSOR_DELAY_NORMAL: 200_000,
}


def period_of_delay_us(rate: int) -> int:
    """Return the period (us) of a SENSOR_DELAY code; any other int is a period already (SensorManager.getDelay).

    Raises InvalidArgumentError for what is no int of 32 bits: no call could carry it.
    """
    return _DELAY_US.get(check_us(rate, 32), rate)


def check_us(duration_us: int, bits: int) -> int:
    """Return a period or latency (us); raises InvalidArgumentError if it is no int of so many bits."""
    if not isinstance(duration_us, numbers.Integral) or not -(2 ** (bits - 1)) <= duration_us < 2 ** (bits - 1):
        raise InvalidArgumentError(f"{duration_us!r} is no period or latency in us; give an int of {bits} bits")
    return duration_us


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor; ranges and resolution in its own unit, delays in microseconds, power in mA."""

    TYPE_ALL: ClassVar[int] = -1
    TYPE_ACCELEROMETER: ClassVar[int] = 1
    TYPE_MAGNETIC_FIELD: ClassVar[int] = 2
    TYPE_ORIENTATION: ClassVar[int] = 3
    TYPE_GYROSCOPE: ClassVar[int] = 4
    TYPE_LIGHT: ClassVar[int] = 5
    TYPE_PRESSURE: ClassVar[int] = 6
    TYPE_TEMPERATURE: ClassVar[int] = 7
    TYPE_PROXIMITY: ClassVar[int] = 8
    TYPE_GRAVITY: ClassVar[int] = 9
    TYPE_LINEAR_ACCELERATION: ClassVar[int] = 10
    TYPE_ROTATION_VECTOR: ClassVar[int] = 11
    TYPE_RELATIVE_HUMIDITY: ClassVar[int] = 12
    TYPE_AMBIENT_TEMPERATURE: ClassVar[int] = 13
    TYPE_MAGNETIC_FIELD_UNCALIBRATED: ClassVar[int] = 14
    TYPE_GAME_ROTATION_VECTOR: ClassVar[int] = 15
    TYPE_GYROSCOPE_UNCALIBRATED: ClassVar[int] = 16
    TYPE_SIGNIFICANT_MOTION: ClassVar[int] = 17
    TYPE_STEP_DETECTOR: ClassVar[int] = 18
    TYPE_STEP_COUNTER: ClassVar[int] = 19
    TYPE_GEOMAGNETIC_ROTATION_VECTOR: ClassVar[int] = 20
    TYPE_HEART_RATE: ClassVar[int] = 21
    TYPE_TILT_DETECTOR: ClassVar[int] = 22
    TYPE_WAKE_GESTURE: ClassVar[int] = 23
    TYPE_GLANCE_GESTURE: ClassVar[int] = 24
    TYPE_PICK_UP_GESTURE: ClassVar[int] = 25
    TYPE_WRIST_TILT_GESTURE: ClassVar[int] = 26
    TYPE_DEVICE_ORIENTATION: ClassVar[int] = 27
    TYPE_POSE_6DOF: ClassVar[int] = 28
    TYPE_STATIONARY_DETECT: ClassVar[int] = 29
    TYPE_MOTION_DETECT: ClassVar[int] = 30
    TYPE_HEART_BEAT: ClassVar[int] = 31
    TYPE_DYNAMIC_SENSOR_META: ClassVar[int] = 32
    TYPE_LOW_LATENCY_OFFBODY_DETECT: ClassVar[int] = 34
    TYPE_ACCELEROMETER_UNCALIBRATED: ClassVar[int] = 35
    TYPE_HINGE_ANGLE: ClassVar[int] = 36
    TYPE_HEAD_TRACKER: ClassVar[int] = 37
    TYPE_HEADING: ClassVar[int] = 42

    REPORTING_MODE_CONTINUOUS: ClassVar[int] = 0
    REPORTING_MODE_ON_CHANGE: ClassVar[int] = 1
    REPORTING_MODE_ONE_SHOT: ClassVar[int] = 2
    REPORTING_MODE_SPECIAL_TRIGGER: ClassVar[int] = 3

    handle: int
    type: int
    string_type: str
    name: str
    vendor: str
    version: int
    maximum_range: float
    resolution: float
    power: float
    min_delay: int
    """Shortest period; 0 for an on-change or special-trigger sensor, -1 for a one-shot sensor."""
    max_delay: int
    """Longest period; 0 where there is none."""
    fifo_reserved_event_count: int
    fifo_max_event_count: int
    """0 for a sensor that cannot batch."""
    reporting_mode: int
    is_wake_up_sensor: bool
    is_dynamic_sensor: bool = False
    is_additional_info_supported: bool = False
    is_data_injection_supported: bool = False
    id: int = 0
    """0 for a static sensor; -1: type and name together are unique."""
    required_permission: str = ""

    @classmethod
    def of_message(cls, message: sensors_pb2.SensorInfo) -> "Sensor":
        """Return the sensor that a SensorInfo message describes."""
        return cls(
            handle=message.handle,
            type=message.type,
            string_type=message.string_type,
            name=message.name,
            vendor=message.vendor,
            version=message.version,
            maximum_range=message.max_range,
            resolution=message.resolution,
            power=message.power_ma,
            min_delay=message.min_delay_us,
            max_delay=message.max_delay_us,
            fifo_reserved_event_count=message.fifo_reserved_event_count,
            fifo_max_event_count=message.fifo_max_event_count,
            reporting_mode=message.reporting_mode,
            is_wake_up_sensor=message.wake_up,
            is_dynamic_sensor=message.is_dynamic,
            is_additional_info_supported=message.has_additional_info,
            is_data_injection_supported=message.supports_data_injection,
            id=message.id,
            required_permission=message.required_permission,
        )


@dataclass(frozen=True, slots=True)
class SensorEvent:
    """One event: a fresh object each time, so it may be kept (Android reuses one).

    timestamp: sample time, ns. values: in the sensor's unit. accuracy: SENSOR_STATUS, -1 to 3.
    """

    sensor: Sensor
    timestamp: int
    values: tuple[float, ...]
    accuracy: int


@dataclass(frozen=True, slots=True)
class TriggerEvent:
    """What a one-shot sensor reports: sample time (ns) and values, in the sensor's unit."""

    sensor: Sensor
    timestamp: int
    values: tuple[float, ...]


class SensorEventListener(Protocol):
    """What register_listener takes; on_accuracy_changed(sensor, accuracy) and on_flush_completed(sensor) may be left
    out."""

    def on_sensor_changed(self, event: SensorEvent) -> None:
        """Take one event."""


class TriggerEventListener(Protocol):
    """What request_trigger_sensor takes."""

    def on_trigger(self, event: TriggerEvent) -> None:
        """Take the one event; the request is over."""


class DynamicSensorCallback(Protocol):
    """What register_dynamic_sensor_callback takes; either method may be left out."""

    def on_dynamic_sensor_connected(self, sensor: Sensor) -> None:
        """Take note of a sensor that came."""

    def on_dynamic_sensor_disconnected(self, sensor: Sensor) -> None:
        """Take note of a sensor that went."""
