"""The picture that posed watch draws."""

import dataclasses
import io
import math

import pytest
from rich.console import Console

from posed.cli.live_view import LiveView, bar, tape
from posed.cli.pose_text import bearing_deg, pose_json, pose_line, wind
from posed.client import Pose, PoseStatus, Position, ServiceState
from posed.client.pose import Delivery

_SECOND = 1_000_000_000
_BOOT = b"\x01" * 16
_NO_FLAG = PoseStatus(0)


def _pose(sequence: int, *, boot_id: bytes = _BOOT, status: PoseStatus = _NO_FLAG, missed: int = 0) -> Pose:
    now_ns = sequence * _SECOND // 10
    return Pose(
        delivery=Delivery(boot_id, sequence, now_ns, 0, 1.0),
        timestamp_ns=now_ns - 20_000_000,
        quaternion=(0.0, 0.0, -math.sin(math.pi / 8), math.cos(math.pi / 8)),
        angular_rate=(0.0, math.radians(30), 0.0),
        heading_accuracy=math.radians(3),
        filter="dcm",
        status=status,
        rate_mode="GAME",
        events_fused=15,
        position=None,
        missed=missed,
    )


def _drawn(view: LiveView, state: ServiceState, now_ns: int, *, reason: str = "", width: int = 80) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(view.render(state, reason, now_ns, width))
    return console.export_text()


def test_poses_in_the_picture() -> None:
    view = LiveView()
    view.count_connection()
    for sequence in range(1, 31):
        view.add(_pose(sequence, missed=2 if sequence == 7 else 0))
    text = _drawn(view, ServiceState.CONNECTED, 3 * _SECOND)
    lines = [line.strip("│ ") for line in text.splitlines()]
    assert "connected" in lines
    for words in ("azimuth      45.0° NE", "y   +30.0", "pose rate  10.0 Hz", "poses      30", "missed     2", "20 ms"):
        assert words in text
    for words in ("rate mode  GAME", "±3.0°", "status     ok", "dcm, 15 events", "position   -"):
        assert words in text


def test_a_flat_phone_has_no_camera_heading_and_no_angle_a_negative_zero() -> None:
    flat = dataclasses.replace(_pose(1), quaternion=(0.0, 1e-5, 0.0, 1.0))
    view = LiveView()
    view.add(flat)
    for text in (_drawn(view, ServiceState.CONNECTED, _SECOND), pose_line(flat)):
        assert "down" in text
        assert "-0.0" not in text
    turned_over = dataclasses.replace(flat, quaternion=(0.0, -1.0, 0.0, 1e-5))
    assert "roll  180.0  camera    up" in pose_line(turned_over)


def test_an_ended_recording_is_said_in_the_picture_until_another_daemon_comes() -> None:
    view = LiveView()
    view.add(_pose(1))
    view.note_end("it is over")
    assert "it is over" in _drawn(view, ServiceState.CONNECTED, 3 * _SECOND)
    view.count_connection()
    assert "no pose for 3 s" in _drawn(view, ServiceState.CONNECTED, 3 * _SECOND)


@pytest.mark.parametrize("width", [30, 60, 80, 120])
def test_the_picture_keeps_to_the_terminal(width: int) -> None:
    view = LiveView()
    view.add(_pose(1, status=~_NO_FLAG))
    for line in _drawn(view, ServiceState.CONNECTED, _SECOND, width=width).splitlines():
        assert len(line) == min(width, 80)


def test_where_the_daemon_stands() -> None:
    view = LiveView()
    assert "no daemon has answered yet; 'posed start'" in _drawn(view, ServiceState.CONNECTING, 0)
    view.count_connection()
    assert "connected; waiting for the first pose" in _drawn(view, ServiceState.CONNECTED, 0)
    view.add(_pose(10))
    assert "the daemon died" in _drawn(view, ServiceState.DISCONNECTED, _SECOND)
    ended = _drawn(view, ServiceState.BINDING_DIED, _SECOND, reason="it was told to stop")
    assert "it was told to stop; waiting for another" in ended
    view.count_connection()
    assert "the daemon has returned once" in _drawn(view, ServiceState.CONNECTED, _SECOND)
    assert "connected, but no pose for 4 s" in _drawn(view, ServiceState.CONNECTED, 5 * _SECOND)


def test_the_rate_is_of_one_daemon_and_of_now() -> None:
    view = LiveView()
    assert view.measured_hz() is None
    for sequence in range(10):
        view.add(_pose(sequence))
    assert view.measured_hz() == pytest.approx(10)
    view.add(_pose(200, boot_id=b"\x02" * 16))
    assert view.measured_hz() is None
    for sequence in range(202, 300, 2):
        view.add(_pose(sequence, boot_id=b"\x02" * 16))
    assert view.measured_hz() == pytest.approx(5)


def test_the_middle_of_the_tape_is_the_heading() -> None:
    for tick, letter in ((0, "N"), (90, "E"), (180, "S"), (270, "W")):
        for turns in (-1, 0, 1):
            text = tape(math.radians(tick + 360 * turns), 49).plain
            assert (len(text), text[24]) == (49, letter)
    assert tape(math.radians(28), 49).plain[24 - 7] == "N"


def test_a_bar_points_to_its_side() -> None:
    assert bar(0.0, 5).plain == "──┃──"
    assert bar(1.0, 5).plain == "──━━┃"
    assert bar(-7.0, 5).plain == "┃━━──"


@pytest.mark.parametrize(
    ("degrees", "bearing", "letters"), [(0, 0.0, "N"), (-45, 315.0, "NW"), (359.97, 0.0, "N"), (112, 112.0, "E")]
)
def test_bearings(degrees: float, bearing: float, letters: str) -> None:
    assert (bearing_deg(math.radians(degrees)), wind(math.radians(degrees))) == (bearing, letters)


def test_flags_and_what_json_lacks() -> None:
    pose = dataclasses.replace(
        _pose(3, status=PoseStatus.AT_REST | PoseStatus.GAP),
        heading_accuracy=math.inf,
        position=Position(40.0, 22.0, 60.0, (0.0,) * 9, (0.0, 0.0, 0.0), "fixed", None),
    )
    text = pose_json(pose)
    assert '"status": ["at_rest", "gap"]' in text
    assert '"heading_accuracy_rad": null' in text
    assert '"age_ns": null' in text
    assert pose_line(pose).endswith("at rest, gap")
