"""Who asks for events: the package it says it is, the user and process the kernel says it is, and what it may."""

from dataclasses import dataclass, replace

from posed.events import SensorInfo, SensorType

HIGH_SAMPLING_RATE_SENSORS = "android.permission.HIGH_SAMPLING_RATE_SENSORS"
CAPPED_SAMPLING_PERIOD_US = 5_000
"""The fastest that a client without the permission may ask (SensorService.h, 200 Hz)."""

_CAPPING_SDK = 31
_ACTIVITY_RECOGNITION_SDK = 29
_CAPPED_TYPES = frozenset(
    (
        SensorType.ACCELEROMETER,
        SensorType.MAGNETIC_FIELD,
        SensorType.GYROSCOPE,
        SensorType.ACCELEROMETER_UNCALIBRATED,
        SensorType.MAGNETIC_FIELD_UNCALIBRATED,
        SensorType.GYROSCOPE_UNCALIBRATED,
    )
)


@dataclass(frozen=True, slots=True)
class Client:
    """One process as Android's package manager would know it.

    target_sdk: the Android API level it was written for, 0 for a program that names none: a shell, uncapped.
    """

    package_name: str = "unknown"
    uid: int = 0
    pid: int = 0
    target_sdk: int = 0
    permissions: frozenset[str] = frozenset()

    def is_rate_capped(self, sensor: SensorInfo) -> bool:
        """Return whether 200 Hz is the most it gets of a sensor (SensorService::isRateCappedBasedOnPermission)."""
        return (
            sensor.type in _CAPPED_TYPES
            and self.target_sdk >= _CAPPING_SDK
            and HIGH_SAMPLING_RATE_SENSORS not in self.permissions
        )

    def may_use(self, sensor: SensorInfo) -> bool:
        """Return whether it has the permission that a sensor needs (SensorService::canAccessSensor).

        The permission of step sensors is as old as Android 10: programs written for what was before need none.
        """
        needs = sensor.required_permission
        return not needs or needs in self.permissions or self.target_sdk < _ACTIVITY_RECOGNITION_SDK

    def sees(self, sensor: SensorInfo) -> SensorInfo:
        """Return a sensor as this client's list shows it: with the cap's period if it is capped."""
        if sensor.min_delay_us < CAPPED_SAMPLING_PERIOD_US and self.is_rate_capped(sensor):
            return replace(sensor, min_delay_us=CAPPED_SAMPLING_PERIOD_US)
        return sensor
