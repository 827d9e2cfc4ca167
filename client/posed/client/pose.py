"""A pose as the client sees it: what the daemon published, and what follows from it."""

import math
import time
from dataclasses import dataclass
from enum import IntFlag

from posed.proto import events_pb2, pose_pb2


class PoseStatus(IntFlag):
    """The status bits of a pose."""

    INITIALISING = 1
    AT_REST = 2
    MAGNETIC_DISTURBANCE = 4
    GYRO_LOST = 8
    FREE_FALL = 16
    GAP = 32
    BAD_SAMPLE = 64
    HEADING_FREE = 128
    ACCELEROMETER_LOST = 256


def boot_time_ns() -> int:
    """Return CLOCK_BOOTTIME now, ns."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


@dataclass(frozen=True, slots=True)
class Delivery:
    """The header around a message: times on CLOCK_BOOTTIME in ns, and how sample time maps to it."""

    boot_id: bytes
    sequence: int
    published_ns: int
    offset_ns: int
    scale: float

    @classmethod
    def of_message(cls, header: events_pb2.DeliveryHeader) -> "Delivery":
        """Return the header that a DeliveryHeader message holds."""
        mapping = header.mapping
        return cls(header.boot_id, header.sequence, header.published_ns, mapping.offset_ns, mapping.scale)

    def to_boot_ns(self, sample_ns: int) -> int:
        """Return the CLOCK_BOOTTIME instant (ns) at which a sample time (ns) stands."""
        return self.offset_ns + (sample_ns if self.scale == 1.0 else round(self.scale * sample_ns))


@dataclass(frozen=True, slots=True)
class Device:
    """The phone that the daemon acts as.

    camera_fov_deg: along the longer side of the image. screen_rotation_deg: 0, 90, 180 or 270 from the natural
    orientation (Display.getRotation).
    """

    profile: str
    camera_fov_deg: float
    screen_rotation_deg: int


@dataclass(frozen=True, slots=True)
class Position:
    """WGS 84 degrees, metres above the ellipsoid, ENU covariance (m2, row-major) and velocity (m/s)."""

    latitude_deg: float
    longitude_deg: float
    ellipsoidal_height_m: float
    covariance_enu: tuple[float, ...]
    velocity_enu: tuple[float, float, float]
    source: str
    age_ns: int | None


@dataclass(frozen=True, slots=True)
class Truth:
    """The true orientation beside a pose: (x, y, z, w), device to world ENU, true north; declination in rad, east +.

    First at the pose's own timestamp, which tells the filter's error; then at its grid instant, which is what a camera
    sees. Positions are in metres from where the motion began. None where unknown.
    """

    delivery: Delivery
    timestamp_ns: int
    quaternion: tuple[float, float, float, float]
    declination: float
    position_enu: tuple[float, float, float] | None
    instant_ns: int
    instant_quaternion: tuple[float, float, float, float] | None
    instant_position_enu: tuple[float, float, float] | None

    @classmethod
    def of_message(cls, message: pose_pb2.TruthMessage) -> "Truth":
        """Return the truth that a TruthMessage holds."""
        truth = message.truth
        return cls(
            Delivery.of_message(message.header),
            truth.timestamp_ns,
            _quaternion(truth.orientation),
            truth.declination,
            _vector(truth.position_enu) if truth.HasField("position_enu") else None,
            truth.instant_ns,
            _quaternion(truth.instant_orientation) if truth.HasField("instant_orientation") else None,
            _vector(truth.instant_position_enu) if truth.HasField("instant_position_enu") else None,
        )


@dataclass(frozen=True, slots=True)
class Pose:
    """One published pose.

    timestamp_ns: sample time. quaternion: (x, y, z, w), device to world (east, magnetic north, up), w >= 0.
    angular_rate: rad/s, device axes. heading_accuracy: rad, one standard deviation. missed: poses of this stream that
    the caller has not seen since the previous one it got. predicted_ns: how far the daemon turned the quaternion on
    past timestamp_ns by the angular rate; 0 unless it aligns poses to their grid instants.
    """

    delivery: Delivery
    timestamp_ns: int
    quaternion: tuple[float, float, float, float]
    angular_rate: tuple[float, float, float]
    heading_accuracy: float
    filter: str
    status: PoseStatus
    rate_mode: str
    events_fused: int
    position: Position | None
    missed: int = 0
    predicted_ns: int = 0

    @classmethod
    def of_message(cls, message: pose_pb2.PoseMessage) -> "Pose":
        """Return the pose that a PoseMessage holds."""
        pose = message.pose
        rate = pose.angular_rate
        return cls(
            Delivery.of_message(message.header),
            pose.timestamp_ns,
            _quaternion(pose.orientation),
            (rate.x, rate.y, rate.z),
            pose.heading_accuracy,
            pose.filter,
            PoseStatus(pose.status),
            pose_pb2.RateMode.Name(pose.rate_mode).removeprefix("RATE_MODE_"),
            pose.events_fused,
            _position(pose.position) if pose.HasField("position") else None,
            predicted_ns=pose.predicted_ns,
        )

    @property
    def sequence(self) -> int:
        """Index of the grid instant the pose stands on."""
        return self.delivery.sequence

    @property
    def age_s(self) -> float:
        """Seconds from the instant the pose is of, its newest sample or what it was turned on to, until now.

        Exact for live, simulated and replayed phones."""
        return (boot_time_ns() - self.delivery.to_boot_ns(self.timestamp_ns + self.predicted_ns)) / 1e9

    @property
    def rotation_matrix(self) -> tuple[float, ...]:
        """Device to world, nine values row by row (SensorManager.getRotationMatrixFromVector)."""
        x, y, z, w = self.quaternion
        return (
            1 - 2 * (y * y + z * z),
            2 * (x * y - z * w),
            2 * (x * z + y * w),
            2 * (x * y + z * w),
            1 - 2 * (x * x + z * z),
            2 * (y * z - x * w),
            2 * (x * z - y * w),
            2 * (y * z + x * w),
            1 - 2 * (x * x + y * y),
        )

    @property
    def azimuth(self) -> float:
        """Heading of the device's y axis, rad, -pi to pi (SensorManager.getOrientation)."""
        r = self.rotation_matrix
        return math.atan2(r[1], r[4])

    @property
    def pitch(self) -> float:
        """Rad, -pi/2 to pi/2; negative with the top edge raised (SensorManager.getOrientation)."""
        return math.asin(max(-1.0, min(1.0, -self.rotation_matrix[7])))

    @property
    def roll(self) -> float:
        """Rad, -pi to pi; positive with the right edge lowered (SensorManager.getOrientation)."""
        r = self.rotation_matrix
        return math.atan2(-r[6], r[8])

    @property
    def camera_heading(self) -> float:
        """Heading of the back camera's optical axis (device -z), rad, 0 to 2 pi; meaningless looking straight down."""
        r = self.rotation_matrix
        return math.atan2(-r[2], -r[5]) % (2 * math.pi)


def _vector(v: pose_pb2.Vector3) -> tuple[float, float, float]:
    return (v.x, v.y, v.z)


def _quaternion(q: pose_pb2.Quaternion) -> tuple[float, float, float, float]:
    return (q.x, q.y, q.z, q.w)


def _position(message: pose_pb2.Position) -> Position:
    velocity = message.velocity_enu
    return Position(
        message.latitude_deg,
        message.longitude_deg,
        message.ellipsoidal_height_m,
        tuple(message.covariance_enu),
        (velocity.x, velocity.y, velocity.z),
        message.source,
        message.age_ns if message.HasField("age_ns") else None,
    )
