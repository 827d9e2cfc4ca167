"""Aligned poses: an orientation turned on from its newest gyroscope sample to the instant it is published for."""

from dataclasses import replace
from math import cos, sin, sqrt

from posed.events import FilterStatus, Orientation

LONGEST_PREDICTION_NS = 500_000_000
"""A filter gives its gyroscope up as lost after as long; a rate that old tells nothing of now."""


def aligned(orientation: Orientation, instant_ns: int) -> tuple[Orientation, int]:
    """Return the orientation turned on to `instant_ns` by its own angular rate, and by how much time (ns).

    The rate is taken as constant. The timestamp stays that of the newest sample. An instant before it or more than
    0.5 s behind it, or a lost gyroscope, leaves the orientation as it is: 0 ns.
    """
    ahead_ns = instant_ns - orientation.timestamp_ns
    if not 0 < ahead_ns <= LONGEST_PREDICTION_NS or orientation.status & FilterStatus.GYRO_LOST:
        return orientation, 0
    rx, ry, rz = (0.5e-9 * ahead_ns * rate for rate in orientation.angular_rate)
    half = sqrt(rx * rx + ry * ry + rz * rz)
    scale = sin(half) / half if half > 1e-9 else 1.0
    bx, by, bz, bw = scale * rx, scale * ry, scale * rz, cos(half)
    ax, ay, az, aw = orientation.quaternion
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    w = aw * bw - ax * bx - ay * by - az * bz
    norm = sqrt(x * x + y * y + z * z + w * w)
    if w < 0.0:
        norm = -norm
    return replace(orientation, quaternion=(x / norm, y / norm, z / norm, w / norm)), ahead_ns
