"""What an app may see of a value: multiples of an eighth of the resolution (AOSP SensorDeviceUtils.cpp)."""

from dataclasses import replace

import numpy as np

from posed.events import Float64Array, SensorInfo, SensorType

_RESOLUTION_SHARE = 0.125
_MIN_POWER_MA = 0.001

_THREE_AXES = frozenset(
    (
        SensorType.ACCELEROMETER,
        SensorType.MAGNETIC_FIELD,
        SensorType.GYROSCOPE,
        SensorType.ACCELEROMETER_UNCALIBRATED,
        SensorType.MAGNETIC_FIELD_UNCALIBRATED,
        SensorType.GYROSCOPE_UNCALIBRATED,
    )
)
_OF_RESOLUTION_ONE = frozenset(
    (
        SensorType.SIGNIFICANT_MOTION,
        SensorType.STEP_DETECTOR,
        SensorType.STEP_COUNTER,
        SensorType.TILT_DETECTOR,
        SensorType.WAKE_GESTURE,
        SensorType.GLANCE_GESTURE,
        SensorType.PICK_UP_GESTURE,
        SensorType.WRIST_TILT_GESTURE,
        SensorType.STATIONARY_DETECT,
        SensorType.MOTION_DETECT,
    )
)
_ONE_VALUE = (_OF_RESOLUTION_ONE - {SensorType.STEP_COUNTER}) | {
    SensorType.DEVICE_ORIENTATION,
    SensorType.LIGHT,
    SensorType.PRESSURE,
    SensorType.TEMPERATURE,
    SensorType.PROXIMITY,
    SensorType.RELATIVE_HUMIDITY,
    SensorType.AMBIENT_TEMPERATURE,
    SensorType.HEART_BEAT,
    SensorType.LOW_LATENCY_OFFBODY_DETECT,
    SensorType.HINGE_ANGLE,
}


def as_listed(info: SensorInfo) -> SensorInfo:
    """Return a sensor as the list shows it: sound power, resolution, and a range of whole steps of it."""
    resolution = info.resolution
    if info.type in _THREE_AXES:
        # No part resolves more than 24 bits of its range.
        resolution = max(resolution, 2 * info.max_range / 2**24)
    elif info.type in _OF_RESOLUTION_ONE:
        resolution = 1.0
    max_range = info.max_range
    if resolution > 0 and max_range % resolution:
        max_range = round(max_range / resolution) * resolution
    return replace(info, max_range=max_range, resolution=resolution, power_ma=max(info.power_ma, _MIN_POWER_MA))


class Quantiser:
    """Rounds the values of one sensor; the bias beside uncalibrated values stays as it is.

    Android's framework rounds what the HAL delivers, a batch at a time; here every source does it where it makes or
    reads its samples, for a hundred of them at once: in the daemon that is a tenth of a wake-up.
    """

    def __init__(self, info: SensorInfo) -> None:
        self._step = _RESOLUTION_SHARE * info.resolution
        self._axes = 3 if info.type in _THREE_AXES else int(info.type in _ONE_VALUE)

    def __call__(self, values: Float64Array) -> Float64Array:
        """Return values, float64[n, w], rounded."""
        if not self._axes or not self._step:
            return values
        rounded: Float64Array = np.rint(values / self._step)
        rounded *= self._step
        if values.shape[1] > self._axes:
            rounded[:, self._axes :] = values[:, self._axes :]
        return rounded
