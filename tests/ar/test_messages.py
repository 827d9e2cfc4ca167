"""What the page is sent."""

import dataclasses
import datetime
import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from posed.ar.declination import wmm_declination_deg
from posed.ar.stream import ServiceFeed, observer_message, pose_message, truth_message
from posed.client import Pose, Position, Truth
from posed.client.pose import Delivery, PoseStatus
from posed.hal.sensor_model import THESSALONIKI

_MAX_FRAME_BYTES = 400
_YEAR_NS = 365 * 86_400 * 10**9
_part = st.floats(-1, 1)
_quaternions = st.tuples(_part, _part, _part, _part)
_deliveries = st.builds(
    Delivery,
    boot_id=st.just(bytes(16)),
    sequence=st.integers(0, 10**9),
    published_ns=st.integers(0, _YEAR_NS),
    offset_ns=st.integers(-_YEAR_NS, _YEAR_NS),
    scale=st.floats(0.02, 10),
)
_poses = st.builds(
    Pose,
    delivery=_deliveries,
    timestamp_ns=st.integers(0, _YEAR_NS),
    quaternion=_quaternions,
    angular_rate=st.tuples(*[st.floats(-40, 40)] * 3),
    heading_accuracy=st.floats(0, math.pi),
    filter=st.just("dcm"),
    status=st.sampled_from([PoseStatus(0), PoseStatus(127)]),
    rate_mode=st.sampled_from(["NORMAL", "FASTEST"]),
    events_fused=st.integers(0, 10_000),
    position=st.none(),
    missed=st.integers(0, 10_000),
    predicted_ns=st.integers(0, 10**9),
)
_metres = st.floats(-1e5, 1e5)
_truths = st.builds(
    Truth,
    delivery=_deliveries,
    timestamp_ns=st.integers(0, _YEAR_NS),
    quaternion=_quaternions,
    declination=st.floats(-math.pi, math.pi),
    position_enu=st.none(),
    instant_ns=st.integers(0, _YEAR_NS),
    instant_quaternion=_quaternions,
    instant_position_enu=st.none() | st.tuples(_metres, _metres, _metres),
)


@given(pose=_poses, truth=_truths)
def test_a_frame_is_small_and_rounds_by_less_than_can_be_seen(pose: Pose, truth: Truth) -> None:
    p, t = pose_message(pose), truth_message(truth)
    frame = json.dumps({"i": 10**7, "p": p, "t": t}, separators=(",", ":"))
    assert len(frame.encode()) < _MAX_FRAME_BYTES
    assert max(abs(a - b) for a, b in zip(p["q"], pose.quaternion, strict=True)) <= 5.001e-7
    assert abs(p["t"] * 1e6 - pose.delivery.to_boot_ns(pose.timestamp_ns + pose.predicted_ns)) <= 600
    assert abs(t["t"] * 1e6 - truth.delivery.to_boot_ns(truth.instant_ns)) <= 600
    assert abs(math.radians(p["a"]) - pose.heading_accuracy) < 1e-4
    assert abs(math.radians(t["d"]) - truth.declination) < 1e-5


def test_the_observer_comes_with_the_declination_of_his_place() -> None:
    o = observer_message(Position(40.6265, 22.9591, 72.5, (0.0,) * 9, (0.0, 0.0, 0.0), "stated", None))
    assert (o["latitude"], o["longitude"], o["height"], o["source"]) == (40.6265, 22.9591, 72.5, "stated")
    assert o["wmm_declination_deg"] == wmm_declination_deg(40.6265, 22.9591, datetime.date.today())


def test_a_daemon_that_knows_no_position_takes_the_one_before_back() -> None:
    told: list[tuple[str, Any]] = []
    feed = ServiceFeed("GAME", auto_create=False)
    feed._publish = lambda key, value: told.append((key, value))
    here = Position(40.6265, 22.9591, 72.5, (0.0,) * 9, (0.0, 0.0, 0.0), "stated", None)
    pose = Pose(
        Delivery(bytes(16), 1, 0, 0, 1.0), 0, (0, 0, 0, 1), (0, 0, 0), 0.1, "dcm", PoseStatus(0), "GAME", 1, None
    )
    for position in (None, here, here, None):
        feed._take_pose(dataclasses.replace(pose, position=position))
    observers = [value for key, value in told if key == "o"]
    assert [observer and observer["latitude"] for observer in observers] == [40.6265, None]


def test_with_each_connection_the_observer_is_taken_back_and_told_anew() -> None:
    told: list[tuple[str, Any]] = []
    feed = ServiceFeed("GAME", auto_create=False)
    feed._publish = lambda key, value: told.append((key, value))
    here = Position(40.6265, 22.9591, 72.5, (0.0,) * 9, (0.0, 0.0, 0.0), "stated", None)
    pose = Pose(
        Delivery(bytes(16), 1, 0, 0, 1.0), 0, (0, 0, 0, 1), (0, 0, 0), 0.1, "dcm", PoseStatus(0), "GAME", 1, here
    )
    for _ in range(2):
        feed._connected()
        feed._take_pose(pose)
    observers = [value for key, value in told if key == "o"]
    # The count sets equal places apart, lest the second be taken for the first and not sent.
    assert [observer and observer["n"] for observer in observers] == [None, 1, None, 2]
    assert [value["n"] for key, value in told if key == "s"] == [1, 2]


def test_the_age_of_a_predicted_pose_counts_from_the_instant_it_was_predicted_for() -> None:
    delivery = Delivery(bytes(16), 1, 10**9, 5 * 10**6, 1.0)
    pose = Pose(delivery, 10**9, (0, 0, 0, 1), (0, 0, 0), 0.1, "dcm", PoseStatus(0), "GAME", 1, None)
    ahead = dataclasses.replace(pose, predicted_ns=20 * 10**6)
    assert pose_message(ahead)["t"] - pose_message(pose)["t"] == 20


def test_the_declination_is_that_of_the_world_magnetic_model() -> None:
    # The simulated phone's field is the model's at Thessaloniki, written down on its own.
    here = wmm_declination_deg(40.6265, 22.9591, datetime.date(2025, 1, 1))
    assert abs(here - math.degrees(THESSALONIKI.declination)) < 0.3
    # Westward in Boston, eastward in Auckland; and it drifts.
    assert -15 < wmm_declination_deg(42.36, -71.06, datetime.date(2026, 6, 1)) < -13
    assert 19 < wmm_declination_deg(-36.85, 174.76, datetime.date(2026, 6, 1)) < 21
    assert wmm_declination_deg(40.6265, 22.9591, datetime.date(2029, 12, 31)) > here
    # Beyond its last year the model is better than nothing.
    assert abs(wmm_declination_deg(40.6265, 22.9591, datetime.date(2032, 2, 29)) - here) < 2
