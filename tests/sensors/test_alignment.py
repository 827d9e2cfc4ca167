"""Poses turned on to their grid instants."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posed.clock import VirtualClock
from posed.events import FilterStatus, Orientation, Pose
from posed.hal import open_source
from posed.hal.profile import load_profile
from posed.sensors import SensorService, make_device_filter
from posed.sensors.alignment import aligned

_PROFILE = load_profile("patonis2018")


def _turning(
    quaternion: tuple[float, ...], rate: tuple[float, ...], status: FilterStatus = FilterStatus.OK
) -> Orientation:
    x, y, z, w = quaternion
    return Orientation(1_000_000_000, (x, y, z, w), (rate[0], rate[1], rate[2]), 0.1, status)


@given(st.floats(-math.pi, math.pi), st.floats(-8.0, 8.0), st.integers(1, 500_000_000))
def test_a_constant_turn_is_followed_exactly(start: float, rate: float, ahead_ns: int) -> None:
    there = (0.0, 0.0, math.sin(0.5 * start), math.cos(0.5 * start))
    found, predicted_ns = aligned(_turning(there, (0.0, 0.0, rate)), 1_000_000_000 + ahead_ns)
    wanted = 0.5 * (start + rate * ahead_ns * 1e-9)
    assert predicted_ns == ahead_ns
    assert found.timestamp_ns == 1_000_000_000
    assert found.quaternion[3] >= 0.0
    assert abs(found.quaternion[2] * math.sin(wanted) + found.quaternion[3] * math.cos(wanted)) == pytest.approx(1.0)
    assert math.hypot(*found.quaternion) == pytest.approx(1.0)


def test_the_turn_is_about_the_devices_own_axes() -> None:
    half = math.sqrt(0.5)
    # Turned left by 90 degrees, then about its own x axis by 90: (qz * qx).
    found, _ = aligned(_turning((0.0, 0.0, half, half), (math.pi, 0.0, 0.0)), 1_500_000_000)
    assert found.quaternion == pytest.approx((0.5, 0.5, 0.5, 0.5))


@pytest.mark.parametrize("instant_ns", [1_000_000_000, 999_999_999, 1_500_000_001])
def test_an_instant_that_the_rate_says_nothing_of_changes_nothing(instant_ns: int) -> None:
    orientation = _turning((0.0, 0.0, 0.0, 1.0), (1.0, 2.0, 3.0))
    assert aligned(orientation, instant_ns) == (orientation, 0)


def test_a_lost_gyroscope_predicts_nothing() -> None:
    orientation = _turning((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), FilterStatus.GYRO_LOST)
    assert aligned(orientation, 1_050_000_000) == (orientation, 0)


def _poses(align: bool) -> tuple[list[Pose], list[float]]:
    """Return the poses of a phone that pans, from sensors at NORMAL, and how far each is off at its instant, rad."""
    clock = VirtualClock()
    source = open_source("sim:pan", _PROFILE, clock, seed=3)
    service = SensorService(source, make_device_filter("dcm", _PROFILE), clock, aligned=align)
    service.register_pose("test", 100_000, 200_000)
    poses: list[Pose] = []
    for second in range(1, 21):
        clock.advance_to(second * 1_000_000_000)
        service.advance()
        poses += service.take_poses()
    off = []
    for pose in poses:
        truth = source.truth(pose.instant_ns)
        assert truth is not None
        off.append(2.0 * math.acos(min(1.0, abs(float(np.dot(truth.quaternion, pose.orientation.quaternion))))))
    return poses, off


def test_aligned_poses_do_not_lag() -> None:
    held, held_off = _poses(False)
    turned, turned_off = _poses(True)
    assert [pose.sequence for pose in held] == [pose.sequence for pose in turned]
    assert {pose.predicted_ns for pose in held} == {0}
    for pose in turned:
        assert pose.predicted_ns == pose.instant_ns - pose.orientation.timestamp_ns
        assert 0 <= pose.predicted_ns <= 210_000_000
    assert max(pose.predicted_ns for pose in turned) > 90_000_000
    # What was turned on is the pose alone: the filter behind it goes on as it would.
    assert [pose.orientation.angular_rate for pose in held] == [pose.orientation.angular_rate for pose in turned]
    assert np.median(turned_off[20:]) < 0.5 * np.median(held_off[20:])
