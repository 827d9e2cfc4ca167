"""What flows from a daemon to its clients: poses, truth, sensor events, statistics."""

import csv
import io
import json
import math
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from posed.client import (
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    SENSOR_DELAY_UI,
    Device,
    Pose,
    PoseClient,
    Sensor,
    SensorEvent,
    SensorManager,
    Truth,
)
from posed.errors import InvalidArgumentError, ServiceUnavailableError
from posed.fusion import DEFAULT_FILTER

Eventually = Callable[[Callable[[], object]], None]

_EVENTS_PER_S = {
    SENSOR_DELAY_NORMAL: 25,
    SENSOR_DELAY_UI: 45,
    SENSOR_DELAY_GAME: 150,
    SENSOR_DELAY_FASTEST: 350,
}


class Collector:
    """A listener that notes what it gets and when it has enough."""

    def __init__(self, enough: int = 1) -> None:
        self.events: list[SensorEvent] = []
        self.accuracies: list[tuple[str, int]] = []
        self.flushed: list[Sensor] = []
        self.has_enough = threading.Event()
        self.has_flushed = threading.Event()
        self._enough = enough

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.events.append(event)
        if len(self.events) >= self._enough:
            self.has_enough.set()

    def on_accuracy_changed(self, sensor: Sensor, accuracy: int) -> None:
        assert not [event for event in self.events if event.sensor == sensor], "accuracy comes before the first event"
        self.accuracies.append((sensor.string_type, accuracy))

    def on_flush_completed(self, sensor: Sensor) -> None:
        self.flushed.append(sensor)
        self.has_flushed.set()


def _recording(path: Path, seconds: float) -> Path:
    """Write a phone lying level, then turning about its vertical at 20 degrees a second."""
    rows = ["sensor,timestamp_ns,x,y,z"]
    for k in range(int(seconds * 200)):
        t = k / 200
        turning = t > 2
        heading = math.radians(20) * max(0.0, t - 2)
        rows.append(f"gyroscope,{k * 5_000_000},0,0,{math.radians(20) * turning!r}")
        if k % 2 == 0:
            rows.append(f"accelerometer,{k * 5_000_000 + 1_000_000},0,0,9.80665")
        if k % 4 == 0:
            x, y = 25 * math.sin(heading), 25 * math.cos(heading)
            rows.append(f"magnetic_field,{k * 5_000_000 + 2_000_000},{x!r},{y!r},-40")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize("mode", list(_EVENTS_PER_S))
def test_poses_come_on_their_grid_with_the_events_of_table_2(desk: Any, mode: int) -> None:
    desk.serve("--source", "sim:look-around")
    with PoseClient(mode, every=True) as client:
        poses = [client.next_pose(timeout_s=5) for _ in range(25)]
    assert all(isinstance(pose, Pose) for pose in poses)
    first, last = poses[0], poses[-1]
    sequences = [p.sequence for p in poses]
    assert sorted(set(sequences)) == sequences
    # None, but where the machine is so busy that an instant passes.
    assert sum(p.missed for p in poses) == last.sequence - first.sequence - 24
    assert all(math.isclose(math.hypot(*p.quaternion), 1, abs_tol=1e-9) and p.quaternion[3] >= 0 for p in poses)
    fused = sum(p.events_fused for p in poses[5:]) / (20 * 0.1)
    assert fused == pytest.approx(_EVENTS_PER_S[mode], rel=0.1)
    assert {p.rate_mode for p in poses} == {{0: "FASTEST", 1: "GAME", 2: "UI", 3: "NORMAL"}[mode]}
    assert {p.filter for p in poses} == {DEFAULT_FILTER}
    assert 0 < last.heading_accuracy < math.pi
    assert last.position is None
    assert last.age_s < 5


def test_clients_of_two_filters_get_the_poses_of_each_at_the_same_instants(desk: Any) -> None:
    desk.serve("--source", "sim:look-around", "--filter", "dcm-adaptive,dcm")
    truths: list[Truth] = []
    with (
        PoseClient(SENSOR_DELAY_GAME, every=True) as first,
        PoseClient(SENSOR_DELAY_GAME, filter="dcm", every=True, on_truth=truths.append) as second,
    ):
        poses = {client: [client.next_pose(timeout_s=5) for _ in range(15)] for client in (first, second)}
    names = [{pose.filter for pose in given if pose is not None} for given in poses.values()]
    assert names == [{"dcm-adaptive"}, {"dcm"}]
    instants = [{p.sequence: p.timestamp_ns for p in given if p is not None} for given in poses.values()]
    shared = instants[0].keys() & instants[1].keys()
    assert len(shared) >= 10
    assert [instants[0][sequence] for sequence in shared] == [instants[1][sequence] for sequence in shared]
    assert truths


def test_a_client_of_a_filter_that_does_not_run_is_told_which_do(desk: Any) -> None:
    desk.serve("--source", "sim:still", "--filter", "dcm,dcm-adaptive")
    with PoseClient(filter="vqf") as client, pytest.raises(ServiceUnavailableError, match="only dcm, dcm-adaptive"):
        client.wait_connected(5)
    assert "filter dcm,dcm-adaptive" in desk.posed("status").stdout
    watched = desk.posed("watch", "--filter", "dcm-adaptive", "--json", "--count", "1")
    assert json.loads(watched.stdout)["filter"] == "dcm-adaptive"


def test_the_fastest_client_sets_the_mode_and_the_others_are_told(desk: Any, eventually: Eventually) -> None:
    desk.serve("--source", "sim:still")
    with PoseClient(SENSOR_DELAY_NORMAL) as slow:
        slow.wait_connected(5)
        assert slow.rate_mode == "NORMAL"
        with PoseClient(SENSOR_DELAY_FASTEST) as fast:
            fast.wait_connected(5)
            eventually(lambda: slow.rate_mode == "FASTEST")
        eventually(lambda: slow.rate_mode == "NORMAL")
        slow.set_rate_mode(SENSOR_DELAY_UI)
        assert slow.rate_mode == "UI"
        eventually(lambda: slow.latest() is not None and slow.latest().rate_mode == "UI")


def test_pose_rates_have_streams_of_their_own(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    with PoseClient(every=True) as ten, PoseClient(SENSOR_DELAY_FASTEST, pose_rate_hz=100, every=True) as hundred:
        slow = [ten.next_pose(timeout_s=5) for _ in range(10)]
        fast = [hundred.next_pose(timeout_s=5) for _ in range(50)]
        for poses, period_ms in ((slow, 100), (fast, 10)):
            instants_ms = [pose.sequence * period_ms for pose in poses]
            assert sorted(set(instants_ms)) == instants_ms
            # A pose is as old as the gyroscope sample before its instant.
            lasted_ms = (poses[-1].timestamp_ns - poses[0].timestamp_ns) / 1e6
            assert instants_ms[-1] - instants_ms[0] == pytest.approx(lasted_ms, abs=25)
        hundred.set_pose_rate(20)
        after = hundred.next_pose(timeout_s=5)
        assert after.sequence < fast[-1].sequence
    with pytest.raises(InvalidArgumentError, match="201"):
        PoseClient(pose_rate_hz=201)


def test_a_position_stated_to_the_daemon_is_in_every_pose(desk: Any) -> None:
    desk.serve("--source", "sim:still", "--position", "40.6265,22.9591,72.5")
    with PoseClient() as client:
        position = client.next_pose(timeout_s=5).position
    assert position is not None
    assert (position.latitude_deg, position.longitude_deg) == (40.6265, 22.9591)
    assert (position.ellipsoidal_height_m, position.source, position.age_ns) == (72.5, "fixed", None)


def test_the_truth_stream_stands_beside_the_poses(desk: Any) -> None:
    desk.serve("--source", "sim:turn-z")
    truths: dict[int, Truth] = {}
    with PoseClient(every=True, on_truth=lambda truth: truths.setdefault(truth.delivery.sequence, truth)) as client:
        pose = client.next_pose(timeout_s=5)
        while pose is not None and not (pose.sequence in truths and pose.sequence > 20):
            pose = client.next_pose(timeout_s=5)
    assert pose is not None
    truth = truths[pose.sequence]
    assert truth.timestamp_ns == pose.timestamp_ns
    assert 0 <= truth.instant_ns - truth.timestamp_ns <= 25_000_000
    assert truth.instant_quaternion == pytest.approx(truth.quaternion, abs=0.05)
    assert truth.instant_position_enu == truth.position_enu == (0.0, 0.0, 0.0)
    dot = abs(sum(a * b for a, b in zip(truth.quaternion, pose.quaternion, strict=True)))
    # The truth is against true north, the pose against magnetic north.
    assert math.degrees(2 * math.acos(min(1, dot))) == pytest.approx(math.degrees(truth.declination), abs=3)


def test_a_client_learns_what_phone_it_is(desk: Any) -> None:
    desk.serve("--source", "sim:still", "--profile", "modern")
    with PoseClient() as client:
        client.wait_connected(5)
        assert client.device == Device("modern", 67.0, 0)


def test_the_sensor_list_is_the_profiles_with_the_fused_sensors_behind(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    with SensorManager() as manager:
        sensors = manager.get_sensor_list()
        assert [s.string_type.removeprefix("android.sensor.") for s in sensors] == [
            "accelerometer",
            "magnetic_field",
            "gyroscope",
            "light",
            "pressure",
            "proximity",
            "magnetic_field_uncalibrated",
            "gyroscope_uncalibrated",
            "accelerometer_uncalibrated",
            "gravity",
            "linear_acceleration",
            "rotation_vector",
            "orientation",
            "game_rotation_vector",
            "geomagnetic_rotation_vector",
            "significant_motion",
            "step_detector",
            "step_counter",
            "tilt_detector",
            "device_orientation",
            "pose_6dof",
            "stationary_detect",
            "motion_detect",
        ]
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert gyroscope is not None
        assert (gyroscope.min_delay, gyroscope.max_delay, gyroscope.resolution) == (5000, 200000, 2.66316e-4)
        assert manager.get_default_sensor(999) is None


def test_events_come_in_time_order_one_by_one_or_in_batches(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    streaming, batched = Collector(100), Collector(100)
    with SensorManager() as manager, SensorManager() as other:
        for listener, sensors, latency_us in ((streaming, manager, 0), (batched, other, 100_000)):
            for kind in (Sensor.TYPE_ACCELEROMETER, Sensor.TYPE_GYROSCOPE):
                sensor = sensors.get_default_sensor(kind)
                assert sensors.register_listener(listener, sensor, SENSOR_DELAY_FASTEST, latency_us)
                assert not sensors.register_listener(listener, sensor, SENSOR_DELAY_GAME)
        for listener in (streaming, batched):
            assert listener.has_enough.wait(10)
        for kind in (Sensor.TYPE_ACCELEROMETER, Sensor.TYPE_GYROSCOPE):
            times = [e.timestamp for e in streaming.events if e.sensor.type == kind]
            assert times == sorted(set(times))
        assert sorted(streaming.accuracies) == [("android.sensor.accelerometer", 3), ("android.sensor.gyroscope", 3)]
        statistics = manager.get_statistics()
        assert {s.handle: s.configured_period_ns for s in statistics.sensors} == {1: 10_000_000, 4: 5_000_000}
        assert sum(listener.events_dropped for listener in statistics.listeners) == 0


def test_a_flush_answers_the_listener_that_asked(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    asking, other = Collector(), Collector()
    with SensorManager() as manager:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert not manager.flush(asking)
        for listener in (asking, other):
            assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_GAME, 1_000_000)
        assert manager.flush(asking)
        assert asking.has_flushed.wait(5)
        assert asking.flushed == [gyroscope]
        assert other.flushed == []


def test_what_is_unregistered_stays_silent_and_can_be_registered_anew(desk: Any, eventually: Eventually) -> None:
    desk.serve("--source", "sim:still")
    listener = Collector()
    with SensorManager() as manager:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_FASTEST)
        assert listener.has_enough.wait(5)
        manager.unregister_listener(listener)
        seen = len(listener.events)
        eventually(lambda: not manager.get_statistics().sensors)
        assert len(listener.events) == seen
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_GAME)
        eventually(lambda: len(listener.events) > seen)


def test_a_listener_that_raises_harms_neither_itself_nor_others(desk: Any) -> None:
    desk.serve("--source", "sim:still")

    class Broken:
        calls = 0
        thrice = threading.Event()

        def on_sensor_changed(self, event: SensorEvent) -> None:
            self.calls += 1
            if self.calls >= 3:
                self.thrice.set()
            raise RuntimeError("on purpose")

    broken, sound = Broken(), Collector(10)
    with SensorManager() as manager:
        gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
        for listener in (broken, sound):
            assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_FASTEST)
        assert broken.thrice.wait(5)
        assert sound.has_enough.wait(5)


def test_gravity_and_linear_acceleration_add_up_to_the_accelerometer(desk: Any) -> None:
    desk.serve("--source", "sim:still")
    listener = Collector(60)
    with SensorManager() as manager:
        for kind in (Sensor.TYPE_ACCELEROMETER, Sensor.TYPE_GRAVITY, Sensor.TYPE_LINEAR_ACCELERATION):
            assert manager.register_listener(listener, manager.get_default_sensor(kind), SENSOR_DELAY_GAME)
        assert listener.has_enough.wait(5)
    at: dict[int, dict[int, SensorEvent]] = {}
    for event in listener.events:
        at.setdefault(event.timestamp, {})[event.sensor.type] = event
    complete = [found for found in at.values() if len(found) == 3]
    assert len(complete) >= 5
    for found in complete:
        gravity, linear = found[Sensor.TYPE_GRAVITY].values, found[Sensor.TYPE_LINEAR_ACCELERATION].values
        total = [a + b for a, b in zip(gravity, linear, strict=True)]
        assert total == pytest.approx(found[Sensor.TYPE_ACCELEROMETER].values, abs=1e-4)
        assert math.hypot(*gravity) == pytest.approx(9.80665, abs=1e-4)


def test_the_poses_of_a_fast_replay_equal_those_of_fuse(desk: Any, tmp_path: Path) -> None:
    recording = _recording(tmp_path / "turn.csv", 20)
    last = _replay_and_compare(desk, recording)
    assert math.degrees(last.azimuth) % 360 == pytest.approx(-20 * 18 % 360, abs=5)


def test_a_replay_at_its_end_says_so(desk: Any, tmp_path: Path) -> None:
    # Long enough for a subscription to arrive while it plays.
    desk.serve("--source", f"replay:{_recording(tmp_path / 'short.csv', 40)}", "--speed", "10")
    with PoseClient(every=True) as client:
        assert _poses_to_the_end(client)
    assert json.loads(desk.posed("status", "--json").stdout)["source_ended"] is True
    assert "(at its end)" in desk.posed("status").stdout


def test_the_poses_of_a_replayed_trial_equal_those_of_fuse(desk: Any, data_dir: Path) -> None:
    trials = sorted((data_dir / "smartphone-attitude" / "trials").iterdir())
    _replay_and_compare(desk, trials[0])


def _poses_to_the_end(client: PoseClient) -> list[Pose]:
    """Return a replay's poses, until none has come for longer than a busy machine holds one up."""
    received: list[Pose] = []
    while (pose := client.next_pose(timeout_s=3 if received else 10)) is not None:
        received.append(pose)
    return received


def _replay_and_compare(desk: Any, recording: Path) -> Pose:
    """Compare every pose that a client gets at ten times real time with the one of `posed fuse`; return the last."""
    fused = desk.posed("fuse", str(recording), "--mode", "GAME")
    assert fused.returncode == 0, fused.stderr
    assert desk.posed("fuse", str(recording), "--mode", "GAME").stdout == fused.stdout
    expected = {int(row["sequence"]): row for row in csv.DictReader(io.StringIO(fused.stdout))}
    desk.serve("--source", f"replay:{recording}", "--speed", "10")
    with PoseClient(SENSOR_DELAY_GAME, every=True) as client:
        received = _poses_to_the_end(client)
    assert len(received) > len(expected) / 2
    for pose in received:
        row = expected[pose.sequence]
        assert (pose.timestamp_ns, pose.quaternion, pose.angular_rate) == (
            int(row["timestamp_ns"]),
            tuple(float(row[name]) for name in ("qx", "qy", "qz", "qw")),
            tuple(float(row[name]) for name in ("wx", "wy", "wz")),
        )
        assert (pose.heading_accuracy, int(pose.status), pose.rate_mode, pose.events_fused, pose.filter) == (
            float(row["heading_accuracy_rad"]),
            int(row["status"]),
            row["rate_mode"],
            int(row["events_fused"]),
            row["filter"],
        )
    return received[-1]
