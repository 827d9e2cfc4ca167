"""A pose as one line: JSON for programs, words for people."""

import json
import math
from typing import Any

from posed.client import Pose, PoseStatus, Position

JSON_KEYS = """\
sequence              index of the pose's grid instant
timestamp_ns          sample time of the newest gyroscope sample in the pose
predicted_ns          how far the quaternion was turned on past it; 0 unless the daemon runs with --aligned
published_ns          when the daemon sent it, CLOCK_BOOTTIME
boot_id               of the daemon, new at every start, hexadecimal
missed                poses of the stream lost just before this one
quaternion            x, y, z, w, device to world (east, magnetic north, up)
azimuth_rad, pitch_rad, roll_rad    as Android's getOrientation
camera_heading_rad    of the back camera, 0 to 2 pi; means nothing where it looks straight up or down
angular_rate_rad_s    x, y, z, device axes
heading_accuracy_rad  one standard deviation
status                list of initialising, at_rest, magnetic_disturbance, gyro_lost, free_fall, gap, bad_sample,
                      heading_free, accelerometer_lost
rate_mode             in force: FASTEST, GAME, UI, NORMAL or CUSTOM
events_fused          since the pose before
filter                name of the orientation filter
position              null, or latitude_deg, longitude_deg, ellipsoidal_height_m, covariance_enu, velocity_enu, source,
                      age_ns"""

_FLAGS = tuple(PoseStatus)
# Within 5 degrees of the vertical a heading says nothing.
_STEEP = math.cos(math.radians(5.0))
_WINDS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


def pose_json(pose: Pose) -> str:
    """Return a pose as one line of JSON (JSON_KEYS); a number that JSON cannot hold is null."""
    return json.dumps(
        {
            "sequence": pose.sequence,
            "timestamp_ns": pose.timestamp_ns,
            "predicted_ns": pose.predicted_ns,
            "published_ns": pose.delivery.published_ns,
            "boot_id": pose.delivery.boot_id.hex(),
            "missed": pose.missed,
            "quaternion": pose.quaternion,
            "azimuth_rad": pose.azimuth,
            "pitch_rad": pose.pitch,
            "roll_rad": pose.roll,
            "camera_heading_rad": pose.camera_heading,
            "angular_rate_rad_s": pose.angular_rate,
            "heading_accuracy_rad": finite_or_none(pose.heading_accuracy),
            "status": status_words(pose.status),
            "rate_mode": pose.rate_mode,
            "events_fused": pose.events_fused,
            "filter": pose.filter,
            "position": _position_json(pose.position),
        },
        allow_nan=False,
    )


def pose_line(pose: Pose) -> str:
    """Return a pose as one line for people, angles in degrees."""
    status = ", ".join(word.replace("_", " ") for word in status_words(pose.status))
    return (
        f"{pose.sequence:6d}  azimuth {bearing_deg(pose.azimuth):5.1f}  pitch {angle_deg(pose.pitch):5.1f}"
        f"  roll {angle_deg(pose.roll):6.1f}  camera {_camera(pose)}"
        f"  ±{math.degrees(pose.heading_accuracy):.1f}°  {status}".rstrip()
    )


def status_words(status: PoseStatus) -> list[str]:
    """Return the names of the status bits that are set, in lower case."""
    return [str(flag.name).lower() for flag in _FLAGS if flag in status]


def bearing_deg(heading: float) -> float:
    """Return a heading (rad) as a compass bearing that rounds to 0.0 to 359.9 degrees."""
    return round(math.degrees(heading), 1) % 360.0


def angle_deg(angle: float) -> float:
    """Return an angle (rad) in degrees that rounds to -179.9 to 180.0, without a negative zero."""
    degrees = round(math.degrees(angle), 1) + 0.0
    return 180.0 if degrees == -180.0 else degrees


def steep_camera(pose: Pose) -> str:
    """Return "up" or "down" if the back camera looks so steeply that it has no heading, else an empty string."""
    x, y, _, _ = pose.quaternion
    screen_up = 1.0 - 2.0 * (x * x + y * y)
    return "" if abs(screen_up) < _STEEP else "down" if screen_up > 0.0 else "up"


def wind(heading: float) -> str:
    """Return the nearest of the eight winds of a heading (rad), such as NE."""
    return _WINDS[round(math.degrees(heading) / 45.0) % 8]


def finite_or_none(value: float) -> float | None:
    """Return the value, None in place of NaN and infinity, which JSON lacks."""
    return value if math.isfinite(value) else None


def _camera(pose: Pose) -> str:
    return f"{steep_camera(pose) or format(bearing_deg(pose.camera_heading), '.1f'):>5}"


def _position_json(position: Position | None) -> dict[str, Any] | None:
    if position is None:
        return None
    return {
        "latitude_deg": position.latitude_deg,
        "longitude_deg": position.longitude_deg,
        "ellipsoidal_height_m": position.ellipsoidal_height_m,
        "covariance_enu": position.covariance_enu,
        "velocity_enu": position.velocity_enu,
        "source": position.source,
        "age_ns": position.age_ns,
    }
