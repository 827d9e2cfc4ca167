"""What moves through the service: sensors, batches of their events, poses and truth.

What is made anew for every batch or pose is not frozen: setting the fields of a frozen dataclass goes through
object.__setattr__ and costs the daemon a tenth of its time. None of it is changed once it is made.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from functools import lru_cache
from itertools import repeat
from operator import itemgetter

import numpy as np
import numpy.typing as npt

Int64Array = npt.NDArray[np.int64]
Float64Array = npt.NDArray[np.float64]

STANDARD_GRAVITY = 9.80665
"""m/s2, Android's SensorManager.STANDARD_GRAVITY."""


class SensorType(IntEnum):
    """Android's sensor types (hardware/sensors-base.h); which of them there are is the source's affair."""

    ACCELEROMETER = 1
    MAGNETIC_FIELD = 2
    ORIENTATION = 3
    GYROSCOPE = 4
    LIGHT = 5
    PRESSURE = 6
    TEMPERATURE = 7
    PROXIMITY = 8
    GRAVITY = 9
    LINEAR_ACCELERATION = 10
    ROTATION_VECTOR = 11
    RELATIVE_HUMIDITY = 12
    AMBIENT_TEMPERATURE = 13
    MAGNETIC_FIELD_UNCALIBRATED = 14
    GAME_ROTATION_VECTOR = 15
    GYROSCOPE_UNCALIBRATED = 16
    SIGNIFICANT_MOTION = 17
    STEP_DETECTOR = 18
    STEP_COUNTER = 19
    GEOMAGNETIC_ROTATION_VECTOR = 20
    HEART_RATE = 21
    TILT_DETECTOR = 22
    WAKE_GESTURE = 23
    GLANCE_GESTURE = 24
    PICK_UP_GESTURE = 25
    WRIST_TILT_GESTURE = 26
    DEVICE_ORIENTATION = 27
    POSE_6DOF = 28
    STATIONARY_DETECT = 29
    MOTION_DETECT = 30
    HEART_BEAT = 31
    DYNAMIC_SENSOR_META = 32
    LOW_LATENCY_OFFBODY_DETECT = 34
    ACCELEROMETER_UNCALIBRATED = 35
    HINGE_ANGLE = 36
    HEAD_TRACKER = 37
    HEADING = 42

    @property
    def string_type(self) -> str:
        """Android's string type, such as `android.sensor.accelerometer`."""
        return f"android.sensor.{self.name.lower()}"


class ReportingMode(IntEnum):
    """Android's reporting modes."""

    CONTINUOUS = 0
    ON_CHANGE = 1
    ONE_SHOT = 2
    SPECIAL_TRIGGER = 3


class RateMode(IntEnum):
    """Android's SENSOR_DELAY codes; CUSTOM is a period that is none of the four."""

    FASTEST = 0
    GAME = 1
    UI = 2
    NORMAL = 3
    CUSTOM = 4

    @property
    def sampling_period_us(self) -> int:
        """The period Android sends for the code, in microseconds (CUSTOM has none and raises KeyError)."""
        return _MODE_PERIOD_US[self]

    @classmethod
    def of_period(cls, sampling_period_us: int) -> "RateMode":
        """Return the mode that asks for this period (us), CUSTOM if none does."""
        for mode, period_us in _MODE_PERIOD_US.items():
            if period_us == sampling_period_us:
                return mode
        return cls.CUSTOM


_MODE_PERIOD_US = {RateMode.FASTEST: 0, RateMode.GAME: 20_000, RateMode.UI: 66_667, RateMode.NORMAL: 200_000}


@dataclass(frozen=True, slots=True)
class SensorInfo:
    """One sensor as Android's `Sensor` describes it; ranges and resolution in the sensor's own unit."""

    handle: int
    type: SensorType
    name: str
    vendor: str
    version: int
    max_range: float
    resolution: float
    power_ma: float
    min_delay_us: int
    max_delay_us: int
    fifo_reserved_event_count: int = 0
    fifo_max_event_count: int = 0
    reporting_mode: ReportingMode = ReportingMode.CONTINUOUS
    wake_up: bool = False
    required_permission: str = ""
    """Android's name of the permission that its events need, such as android.permission.ACTIVITY_RECOGNITION."""
    is_dynamic: bool = False
    """True if it came while the phone ran, and may go again."""
    has_additional_info: bool = False
    supports_data_injection: bool = False

    @property
    def flags(self) -> int:
        """Android's flag bits (hardware/sensors.h): wake-up, reporting mode and what is supported."""
        bits = (
            (self.wake_up, 0x1),
            (self.supports_data_injection, 0x10),
            (self.is_dynamic, 0x20),
            (self.has_additional_info, 0x40),
        )
        return sum(bit for is_set, bit in bits if is_set) | self.reporting_mode << 1


@dataclass(slots=True)
class EventColumn:
    """The events of one sensor, oldest first.

    timestamp_ns: int64[n], sample time. values: float64[n, w], the sensor's unit. accuracy: int8[n], Android's
    SENSOR_STATUS.
    """

    timestamp_ns: Int64Array
    values: Float64Array
    accuracy: npt.NDArray[np.int8]

    def __len__(self) -> int:
        return len(self.timestamp_ns)

    def __getitem__(self, rows: slice) -> "EventColumn":
        return EventColumn(self.timestamp_ns[rows], self.values[rows], self.accuracy[rows])

    @staticmethod
    def of_rows(timestamps: "Sequence[int]", rows: "Sequence[Sequence[float]]") -> "EventColumn":
        """Make a column, at least one row, of high accuracy (Android's SENSOR_STATUS_ACCURACY_HIGH)."""
        accuracy = np.full(len(timestamps), 3, np.int8)
        return EventColumn(np.array(timestamps, np.int64), np.array(rows, np.float64), accuracy)

    @staticmethod
    def concatenate(parts: "Sequence[EventColumn]") -> "EventColumn":
        """Join columns of one sensor, given in time order."""
        if len(parts) == 1:
            return parts[0]
        return EventColumn(
            np.concatenate([part.timestamp_ns for part in parts]),
            np.concatenate([part.values for part in parts]),
            np.concatenate([part.accuracy for part in parts]),
        )


FlatEvent = tuple[int, int, float, float, float]
"""One three-axis event as the filters walk them: sensor type, sample time (ns), x, y, z."""


@dataclass(slots=True)
class EventBatch:
    """What one drain of a source yields: a column a sensor handle, and the flushes completed behind them."""

    columns: Mapping[int, EventColumn] = field(default_factory=dict)
    flush_completes: Sequence[int] = ()
    """Handles whose flush completed, in the order asked; each stands behind every event of its handle here."""
    connected: Sequence[SensorInfo] = ()
    """Dynamic sensors that came; their handles are new and are never given to another."""
    disconnected: Sequence[int] = ()
    """Handles of dynamic sensors that went."""

    def __len__(self) -> int:
        return sum(len(column) for column in self.columns.values())

    def flat(self, sensor_types: Mapping[int, SensorType]) -> list[FlatEvent]:
        """Return the events of the handles in `sensor_types` in one order: by time, ties by handle.

        Only the first three values of an event are kept. A list, because a live batch has a few dozen events: making
        and sorting arrays costs three times as much.
        """
        events: list[FlatEvent] = []
        for handle in sorted(self.columns.keys() & sensor_types.keys()):
            column = self.columns[handle]
            x, y, z, *_ = column.values.T.tolist()
            events += zip(repeat(int(sensor_types[handle])), column.timestamp_ns.tolist(), x, y, z)
        events.sort(key=_time_of)
        return events


_time_of = itemgetter(1)


class FilterStatus(IntFlag):
    """What a filter knows about the worth of its orientation."""

    OK = 0
    INITIALISING = 1
    """Gravity or north has not been seen yet (or not since a gap)."""
    AT_REST = 2
    MAGNETIC_DISTURBANCE = 4
    """The magnetometer is being rejected; heading runs on the gyroscope."""
    GYRO_LOST = 8
    """No gyroscope sample for 0.5 s; accelerometer and magnetometer alone."""
    FREE_FALL = 16
    """The last accelerometer sample was below 1 m/s2 and not used."""
    GAP = 32
    """A time gap was bridged or a sample was out of order since the last pose."""
    BAD_SAMPLE = 64
    """A NaN, infinite or degenerate sample was rejected since the last pose."""
    HEADING_FREE = 128
    """No magnetometer sample that could be used for 1 s, or none wanted.

    Heading runs on the gyroscope, from north if it was ever seen."""
    ACCELEROMETER_LOST = 256
    """No accelerometer sample that could be used for 0.5 s: the tilt runs on the gyroscope."""


@lru_cache
def filter_status(bits: int) -> FilterStatus:
    """Return the flags of these bits, kept: making them goes through a good deal of Python."""
    return FilterStatus(bits)


@dataclass(slots=True)
class Orientation:
    """A filter's answer at one instant.

    quaternion: (x, y, z, w), device to world (ENU, magnetic north), w >= 0. angular_rate: rad/s, device frame, bias
    removed. heading_accuracy: rad, one standard deviation.
    """

    timestamp_ns: int
    quaternion: tuple[float, float, float, float]
    angular_rate: tuple[float, float, float]
    heading_accuracy: float
    status: FilterStatus


@dataclass(frozen=True, slots=True)
class Position:
    """Where the phone is: degrees (WGS 84), metres above the ellipsoid, ENU covariance (m2, row-major, 9 values)."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    covariance_enu: tuple[float, ...] = (0.0,) * 9
    velocity_enu: tuple[float, float, float] = (0.0, 0.0, 0.0)
    source: str = "fixed"
    timestamp_ns: int | None = None
    """Sample time of the fix; None for a position that was stated and does not age."""


@dataclass(slots=True)
class Pose:
    """The fused pose of one grid instant, all in sample time.

    sequence: index of the grid instant since the first sample. instant_ns: the grid instant. orientation.timestamp_ns:
    newest gyroscope sample fused. predicted_ns: how far the orientation was turned on past that by its angular rate, to
    the grid instant if poses are aligned, else 0.
    """

    sequence: int
    instant_ns: int
    period_us: int
    orientation: Orientation
    filter_name: str
    rate_mode: RateMode
    events_fused: int
    position: Position | None = None
    predicted_ns: int = 0


@dataclass(frozen=True, slots=True)
class Truth:
    """Where the phone really points: quaternion (x, y, z, w), device to world ENU, **true** north.

    declination: rad, east positive; magnetic heading = true heading - declination.
    position_enu: metres from where the motion began, None where unknown.
    """

    timestamp_ns: int
    quaternion: tuple[float, float, float, float]
    declination: float
    position_enu: tuple[float, float, float] | None = None
