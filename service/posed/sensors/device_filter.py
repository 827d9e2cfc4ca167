"""A filter for a device: its parts' noise and delays as filters take them."""

from posed.events import SensorType
from posed.fusion import make_filter
from posed.fusion.filter import OrientationFilter, SensorErrors
from posed.hal.profile import DeviceProfile

_PARTS = (SensorType.GYROSCOPE, SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD)


def device_errors(profile: DeviceProfile) -> SensorErrors:
    """Return the noise and the delays of a device's parts as filters take them."""
    noise = profile.noise
    gyro, acc, mag = (profile.sensors[kind].delay_s for kind in _PARTS)
    return SensorErrors(noise.gyroscope_density, noise.accelerometer_std, noise.magnetic_field_std, gyro, acc, mag)


def make_device_filter(name: str, profile: DeviceProfile) -> OrientationFilter:
    """Make a filter by name for the errors of a device's parts; raises InvalidArgumentError for an unknown name."""
    return make_filter(name, device_errors(profile))
