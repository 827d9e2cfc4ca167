"""The fused sensors, computed at accelerometer events and keeping their timestamps (AOSP RotationVectorSensor.cpp,
GravitySensor.cpp, LinearAccelerationSensor.cpp)."""

from collections.abc import Mapping, Sequence

import numpy as np

from posed.events import STANDARD_GRAVITY, EventColumn, Orientation, SensorInfo, SensorType

_VERSION = 3
_ACCELEROMETER_MAX_PERIOD_NS = 50_000_000
_GYROSCOPE_PERIOD_NS = 5_000_000
_MAGNETOMETER_PERIOD_NS = 10_000_000


def virtual_sensors(physical: Sequence[SensorInfo]) -> tuple[SensorInfo, ...]:
    """Return the fused sensors that these physical ones can carry; none unless all three kinds are there."""
    inputs = {s.type: s for s in physical if s.type in FUSION_INPUTS}
    if len(inputs) < len(FUSION_INPUTS):
        return ()
    accelerometer = inputs[SensorType.ACCELEROMETER]
    power_ma = sum(sensor.power_ma for sensor in inputs.values())

    def sensor(kind: SensorType, name: str, max_range: float, resolution: float) -> SensorInfo:
        return SensorInfo(
            handle=int(kind),
            type=kind,
            name=name,
            vendor="posed",
            version=_VERSION,
            max_range=max_range,
            resolution=resolution,
            power_ma=power_ma,
            min_delay_us=accelerometer.min_delay_us,
            max_delay_us=accelerometer.max_delay_us,
            fifo_max_event_count=accelerometer.fifo_max_event_count,
        )

    return (
        sensor(SensorType.GRAVITY, "Gravity Sensor", 2 * STANDARD_GRAVITY, accelerometer.resolution),
        sensor(
            SensorType.LINEAR_ACCELERATION,
            "Linear Acceleration Sensor",
            accelerometer.max_range,
            accelerometer.resolution,
        ),
        sensor(SensorType.ROTATION_VECTOR, "Rotation Vector Sensor", 1.0, 2.0**-24),
    )


FUSION_INPUTS = (SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD)


LEAD = SensorType.ACCELEROMETER
"""The input whose events the fused sensors follow."""


def input_periods_ns(sampling_period_ns: int) -> Mapping[SensorType, int]:
    """Return the period each input needs for a fused sensor at this period (AOSP SensorFusion::setDelay)."""
    return {
        SensorType.ACCELEROMETER: min(sampling_period_ns, _ACCELEROMETER_MAX_PERIOD_NS),
        SensorType.GYROSCOPE: _GYROSCOPE_PERIOD_NS,
        SensorType.MAGNETIC_FIELD: _MAGNETOMETER_PERIOD_NS,
    }


class VirtualEvents:
    """Fused events of one stretch of accelerometer events, gathered one by one."""

    def __init__(self) -> None:
        self._timestamps: list[int] = []
        self._rotation: list[tuple[float, ...]] = []
        self._gravity: list[tuple[float, ...]] = []
        self._linear: list[tuple[float, ...]] = []

    def add(self, timestamp_ns: int, acceleration: tuple[float, float, float], orientation: Orientation) -> None:
        """Compute the fused events of one accelerometer event (m/s2, device frame)."""
        x, y, z, w = orientation.quaternion
        # Third row of the rotation matrix: up in device axes.
        gravity = (
            STANDARD_GRAVITY * 2 * (x * z - w * y),
            STANDARD_GRAVITY * 2 * (y * z + w * x),
            STANDARD_GRAVITY * (1 - 2 * (x * x + y * y)),
        )
        ax, ay, az = acceleration
        self._timestamps.append(timestamp_ns)
        self._rotation.append((x, y, z, w, orientation.heading_accuracy))
        self._gravity.append(gravity)
        self._linear.append((ax - gravity[0], ay - gravity[1], az - gravity[2]))

    def columns(self) -> dict[int, EventColumn]:
        """Return one column a fused sensor, by handle; none if nothing was added."""
        if not self._timestamps:
            return {}
        timestamps = np.array(self._timestamps, np.int64)
        accuracy = np.full(len(timestamps), 3, np.int8)
        return {
            int(kind): EventColumn(timestamps, np.array(rows), accuracy)
            for kind, rows in (
                (SensorType.GRAVITY, self._gravity),
                (SensorType.LINEAR_ACCELERATION, self._linear),
                (SensorType.ROTATION_VECTOR, self._rotation),
            )
        }
