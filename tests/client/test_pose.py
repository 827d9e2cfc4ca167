"""What follows from a pose's quaternion, against the values Android's formulas give."""

import dataclasses
import math

import pytest

from posed.client import PoseClient
from posed.client.pose import Delivery, Pose, PoseStatus, boot_time_ns
from posed.client.sensor import period_of_delay_us
from posed.errors import InvalidArgumentError
from posed.events import FilterStatus
from posed.proto import events_pb2, pose_pb2

_H = math.sqrt(0.5)
_S15, _C15 = math.sin(math.radians(15)), math.cos(math.radians(15))


def _pose(quaternion: tuple[float, float, float, float], **delivery: object) -> Pose:
    header = {"boot_id": b"b", "sequence": 7, "published_ns": 0, "offset_ns": 0, "scale": 1.0} | delivery
    return Pose(Delivery(**header), 10, quaternion, (0, 0, 0), 0.1, "dcm", PoseStatus(0), "GAME", 1, None)


def test_the_status_bits_are_those_that_the_filters_set() -> None:
    ours = {status.name: int(status) for status in PoseStatus}
    assert ours == {status.name: int(status) for status in FilterStatus if status}


@pytest.mark.parametrize(
    ("quaternion", "azimuth", "pitch", "roll"),
    [
        ((0, 0, 0, 1), 0, 0, 0),
        ((0, 0, -_H, _H), 90, 0, 0),
        ((0, 0, _H, _H), -90, 0, 0),
        ((_S15, 0, 0, _C15), 0, -30, 0),
        ((-_S15, 0, 0, _C15), 0, 30, 0),
        ((0, _S15, 0, _C15), 0, 0, 30),
        ((0, -_S15, 0, _C15), 0, 0, -30),
        ((0, 1, 0, 0), 0, 0, 180),
        ((0.5, -0.5, 0.5, 0.5), -90, 0, -90),
    ],
)
def test_angles_are_those_of_get_orientation(
    quaternion: tuple[float, float, float, float], azimuth: float, pitch: float, roll: float
) -> None:
    pose = _pose(quaternion)
    found = [math.degrees(angle) for angle in (pose.azimuth, pose.pitch, pose.roll)]
    assert found == pytest.approx([azimuth, pitch, roll], abs=1e-9)


@pytest.mark.parametrize(("heading", "turn"), [(0, 0), (90, -90), (180, 180), (270, 90)])
def test_the_camera_of_an_upright_phone_looks_where_it_is_turned(heading: float, turn: float) -> None:
    half = math.radians(turn) / 2
    # Upright: a quarter turn about x; then about the vertical.
    upright = (_H * math.cos(half), _H * math.sin(half), _H * math.sin(half), _H * math.cos(half))
    assert math.degrees(_pose(upright).camera_heading) % 360 == pytest.approx(heading, abs=1e-9)


def test_the_rotation_matrix_is_a_rotation_by_rows() -> None:
    r = _pose((0, 0, -_H, _H)).rotation_matrix
    # Facing east: the device's y axis points east, its x axis south.
    assert r == pytest.approx((0, 1, 0, -1, 0, 0, 0, 0, 1))


def test_sample_time_maps_to_boot_time_by_offset_and_scale() -> None:
    assert _pose((0, 0, 0, 1), offset_ns=5).delivery.to_boot_ns(10) == 15
    assert _pose((0, 0, 0, 1), offset_ns=5, scale=0.1).delivery.to_boot_ns(1000) == 105


def test_a_message_becomes_a_pose_with_nothing_lost() -> None:
    message = pose_pb2.PoseMessage(
        header=events_pb2.DeliveryHeader(
            boot_id=b"x", sequence=3, published_ns=99, mapping=events_pb2.TimeMapping(offset_ns=1, scale=2.0)
        ),
        pose=pose_pb2.Pose(
            timestamp_ns=-5,
            orientation=pose_pb2.Quaternion(x=0.1, y=0.2, z=0.3, w=0.9),
            angular_rate=pose_pb2.Vector3(x=1, y=2, z=3),
            heading_accuracy=0.5,
            filter="dcm",
            status=6,
            rate_mode=pose_pb2.RATE_MODE_UI,
            events_fused=45,
            position=pose_pb2.Position(latitude_deg=1, longitude_deg=2, ellipsoidal_height_m=3, source="fixed"),
        ),
    )
    pose = Pose.of_message(message)
    assert (pose.sequence, pose.timestamp_ns, pose.quaternion) == (3, -5, (0.1, 0.2, 0.3, 0.9))
    assert pose.status == PoseStatus.AT_REST | PoseStatus.MAGNETIC_DISTURBANCE
    assert (pose.rate_mode, pose.events_fused, pose.missed) == ("UI", 45, 0)
    assert pose.position is not None
    assert (pose.position.source, pose.position.age_ns) == ("fixed", None)
    assert pose.delivery == Delivery(b"x", 3, 99, 1, 2.0)


@pytest.mark.parametrize(("asked", "period_us"), [(0, 0), (1, 20_000), (2, 66_667), (3, 200_000), (4, 4), (-1, -1)])
def test_rate_codes_become_periods_and_anything_else_is_one(asked: int, period_us: int) -> None:
    assert period_of_delay_us(asked) == period_us


@pytest.mark.parametrize("pose_rate_hz", ["ten", None, 0.5, 201])
def test_a_pose_rate_that_is_none_is_refused(pose_rate_hz: float) -> None:
    with pytest.raises(InvalidArgumentError, match="is no rate"):
        PoseClient(pose_rate_hz=pose_rate_hz)


def test_the_age_of_a_pose_turned_on_counts_from_where_it_was_turned_to() -> None:
    pose = _pose((0, 0, 0, 1), offset_ns=boot_time_ns())
    turned_on = dataclasses.replace(pose, predicted_ns=2_000_000_000)
    assert turned_on.age_s - pose.age_s == pytest.approx(-2.0, abs=1.0)
