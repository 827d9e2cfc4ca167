"""The sensors that the service computes itself: which there are, what they need, and what makes their events.

Names, versions, ranges and formulas are those of AOSP's virtual sensors (RotationVectorSensor.cpp, GravitySensor.cpp,
LinearAccelerationSensor.cpp, OrientationSensor.cpp); the detectors are those a HAL would have (sensors-base.h).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol

from posed.events import STANDARD_GRAVITY, EventColumn, FlatEvent, ReportingMode, SensorInfo, SensorType
from posed.fusion.filter import SensorErrors

FUSION_INPUTS = (SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD)
LEAD = SensorType.ACCELEROMETER
"""The input whose events every virtual sensor follows."""

FUSED = frozenset(
    (
        SensorType.ROTATION_VECTOR,
        SensorType.GRAVITY,
        SensorType.LINEAR_ACCELERATION,
        SensorType.ORIENTATION,
        SensorType.POSE_6DOF,
        SensorType.HEADING,
    )
)
"""Those that the filter of the poses carries; each of the others has a computation of its own."""

ACTIVITY_RECOGNITION = "android.permission.ACTIVITY_RECOGNITION"
_VERSION = 3
_ACCELEROMETER_MAX_PERIOD_NS = 50_000_000
_GYROSCOPE_PERIOD_NS = 5_000_000
_MAGNETOMETER_PERIOD_NS = 10_000_000
_DETECTOR_PERIOD_NS = 20_000_000
_MOST_STEPS = 2.0**32


class Computation(Protocol):
    """Makes the events of one virtual sensor from those of its inputs."""

    def take(self, events: Sequence[FlatEvent]) -> EventColumn | None:
        """Take events of any type in time order; return what follows of them, None if nothing does."""

    def restart(self) -> None:
        """Begin anew, as the sensor was off: what came before says nothing of what comes."""


def make_computation(kind: SensorType, errors: SensorErrors) -> Computation:
    """Make the computation of a virtual sensor that is not fused; its module is loaded only now."""
    if kind in (SensorType.GAME_ROTATION_VECTOR, SensorType.GEOMAGNETIC_ROTATION_VECTOR):
        module = import_module("posed.sensors.vectors")
        made: Computation = module.RotationVector(kind, errors)
    elif kind in (SensorType.STEP_DETECTOR, SensorType.STEP_COUNTER):
        made = import_module("posed.sensors.steps").make(kind)
    else:
        made = import_module("posed.sensors.detectors").make(kind)
    return made


@dataclass(frozen=True, slots=True)
class VirtualSensor:
    """A sensor that is computed, and of what."""

    info: SensorInfo
    inputs: tuple[SensorType, ...]

    def input_periods_ns(self, sampling_period_ns: int) -> Mapping[SensorType, int]:
        """Return the period each input needs for this sensor at a period (AOSP SensorFusion::setDelay)."""
        is_continuous = self.info.reporting_mode is ReportingMode.CONTINUOUS
        periods = {
            SensorType.ACCELEROMETER: min(sampling_period_ns, _ACCELEROMETER_MAX_PERIOD_NS)
            if is_continuous
            else _DETECTOR_PERIOD_NS,
            SensorType.GYROSCOPE: _GYROSCOPE_PERIOD_NS,
            SensorType.MAGNETIC_FIELD: _MAGNETOMETER_PERIOD_NS,
        }
        return {kind: periods[kind] for kind in self.inputs}


def virtual_sensors(physical: Sequence[SensorInfo], *, knows_true_north: bool) -> tuple[VirtualSensor, ...]:
    """Return the virtual sensors that these physical ones can carry, but for types that they have themselves."""
    parts = {sensor.type: sensor for sensor in physical if sensor.type in FUSION_INPUTS}
    types = {sensor.type for sensor in physical}
    return tuple(
        VirtualSensor(_info(description, inputs, parts), inputs)
        for description, inputs in _DESCRIPTIONS
        if description.kind not in types
        and all(kind in parts for kind in inputs)
        and (knows_true_north or description.kind is not SensorType.HEADING)
    )


def _info(
    description: "_Description", inputs: Collection[SensorType], parts: Mapping[SensorType, SensorInfo]
) -> SensorInfo:
    lead = parts[LEAD]
    is_continuous = description.mode is ReportingMode.CONTINUOUS
    is_one_shot = description.mode is ReportingMode.ONE_SHOT
    return SensorInfo(
        handle=int(description.kind),
        type=description.kind,
        name=description.name,
        vendor="posed",
        version=description.version,
        max_range=lead.max_range if description.max_range is None else description.max_range,
        resolution=lead.resolution if description.resolution is None else description.resolution,
        power_ma=sum(parts[kind].power_ma for kind in inputs),
        min_delay_us=lead.min_delay_us if is_continuous else -1 if is_one_shot else 0,
        max_delay_us=lead.max_delay_us if is_continuous else 0,
        fifo_max_event_count=lead.fifo_max_event_count if is_continuous else 0,
        reporting_mode=description.mode,
        wake_up=description.wake_up,
        required_permission=description.permission,
    )


@dataclass(frozen=True, slots=True)
class _Description:
    """max_range, resolution: None is the accelerometer's."""

    kind: SensorType
    name: str
    max_range: float | None
    resolution: float | None
    version: int = _VERSION
    mode: ReportingMode = ReportingMode.CONTINUOUS
    wake_up: bool = False
    permission: str = ""


def _detector(
    kind: SensorType,
    name: str,
    mode: ReportingMode,
    max_range: float = 1.0,
    *,
    wake_up: bool = False,
    permission: str = "",
) -> tuple[_Description, tuple[SensorType, ...]]:
    return _Description(kind, name, max_range, 1.0, 1, mode, wake_up, permission), (LEAD,)


_ACCELEROMETER, _GYROSCOPE, _MAGNETOMETER = FUSION_INPUTS
_DESCRIPTIONS: tuple[tuple[_Description, tuple[SensorType, ...]], ...] = (
    (_Description(SensorType.GRAVITY, "Gravity Sensor", 2 * STANDARD_GRAVITY, None), FUSION_INPUTS),
    (_Description(SensorType.LINEAR_ACCELERATION, "Linear Acceleration Sensor", None, None), FUSION_INPUTS),
    (_Description(SensorType.ROTATION_VECTOR, "Rotation Vector Sensor", 1.0, 2.0**-24), FUSION_INPUTS),
    (_Description(SensorType.ORIENTATION, "Orientation Sensor", 360.0, 2.0**-8, 1), FUSION_INPUTS),
    (
        _Description(SensorType.GAME_ROTATION_VECTOR, "Game Rotation Vector Sensor", 1.0, 2.0**-24),
        (_ACCELEROMETER, _GYROSCOPE),
    ),
    (
        _Description(SensorType.GEOMAGNETIC_ROTATION_VECTOR, "GeoMag Rotation Vector Sensor", 1.0, 2.0**-24),
        (_ACCELEROMETER, _MAGNETOMETER),
    ),
    _detector(SensorType.SIGNIFICANT_MOTION, "Significant Motion", ReportingMode.ONE_SHOT, wake_up=True),
    _detector(
        SensorType.STEP_DETECTOR, "Step Detector", ReportingMode.SPECIAL_TRIGGER, permission=ACTIVITY_RECOGNITION
    ),
    _detector(
        SensorType.STEP_COUNTER, "Step Counter", ReportingMode.ON_CHANGE, _MOST_STEPS, permission=ACTIVITY_RECOGNITION
    ),
    _detector(SensorType.TILT_DETECTOR, "Tilt Detector", ReportingMode.SPECIAL_TRIGGER, wake_up=True),
    _detector(SensorType.DEVICE_ORIENTATION, "Device Orientation", ReportingMode.ON_CHANGE, 3.0),
    (_Description(SensorType.POSE_6DOF, "Pose 6DoF", 1.0, 2.0**-24, 1), FUSION_INPUTS),
    _detector(SensorType.STATIONARY_DETECT, "Stationary Detect", ReportingMode.ONE_SHOT),
    _detector(SensorType.MOTION_DETECT, "Motion Detect", ReportingMode.ONE_SHOT),
    (_Description(SensorType.HEADING, "Heading Sensor", 360.0, 2.0**-8, 1), FUSION_INPUTS),
)
