"""Sensors and their events as Android's SDK has them (android.hardware.Sensor, SensorEvent)."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

from posed.proto import sensors_pb2

SENSOR_DELAY_FASTEST = 0
SENSOR_DELAY_GAME = 1
SENSOR_DELAY_UI = 2
SENSOR_DELAY_NORMAL = 3

_DELAY_US = {
    SENSOR_DELAY_FASTEST: 0,
    SENSOR_DELAY_GAME: 20_000,
    SENSOR_DELAY_UI: 66_667,
    SENSOR_DELAY_NORMAL: 200_000,
}


def period_of_delay_us(rate: int) -> int:
    """Return the period (us) of a SENSOR_DELAY code; any other int is a period already (SensorManager.getDelay)."""
    return _DELAY_US.get(rate, rate)


@dataclass(frozen=True, slots=True)
class Sensor:
    """One sensor; ranges and resolution in its own unit, delays in microseconds, power in mA."""

    TYPE_ALL: ClassVar[int] = -1
    TYPE_ACCELEROMETER: ClassVar[int] = 1
    TYPE_MAGNETIC_FIELD: ClassVar[int] = 2
    TYPE_GYROSCOPE: ClassVar[int] = 4
    TYPE_GRAVITY: ClassVar[int] = 9
    TYPE_LINEAR_ACCELERATION: ClassVar[int] = 10
    TYPE_ROTATION_VECTOR: ClassVar[int] = 11
    TYPE_MAGNETIC_FIELD_UNCALIBRATED: ClassVar[int] = 14
    TYPE_GYROSCOPE_UNCALIBRATED: ClassVar[int] = 16
    TYPE_ACCELEROMETER_UNCALIBRATED: ClassVar[int] = 35

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
    max_delay: int
    fifo_reserved_event_count: int
    fifo_max_event_count: int
    reporting_mode: int
    is_wake_up_sensor: bool

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


class SensorEventListener(Protocol):
    """What register_listener takes; on_accuracy_changed and on_flush_completed may be left out."""

    def on_sensor_changed(self, event: SensorEvent) -> None:
        """Take one event."""
