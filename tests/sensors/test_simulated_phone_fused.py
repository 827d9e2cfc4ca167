"""The simulated tablet of Patonis et al. 2018 through the whole pipeline, against its own truth."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError
from posed.evaluation.measures import heading_error, to_magnetic_north, total_error
from posed.events import Pose, RateMode
from posed.hal import open_source
from posed.hal.profile import load_profile
from posed.sensors import SensorService, make_device_filter

_SECTION_S = 5
_HOLD_S = 4


class _Run:
    """A simulated phone under one script, its poses and their errors in degrees."""

    def __init__(self, script: str, mode: RateMode, seed: int) -> None:
        profile = load_profile("patonis2018")
        self._clock = VirtualClock(1_000_000_000)
        self._start_ns = self._clock.now_ns()
        self._source = open_source(f"sim:{script}", profile, self._clock, seed=seed)
        self._service = SensorService(self._source, make_device_filter("dcm", profile), self._clock)
        self.set_mode(mode)

    def set_mode(self, mode: RateMode) -> None:
        self._service.register_pose("test", 100_000, mode.sampling_period_us)

    def poses(self, seconds: float) -> Iterator[tuple[float, Pose]]:
        """Yield (seconds since the start, pose) of the next seconds."""
        self._clock.advance_to(self._clock.now_ns() + int(seconds * 1e9))
        self._service.advance()
        for pose in self._service.take_poses():
            yield (pose.instant_ns - self._start_ns) / 1e9, pose

    def pair(self, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
        truth = self._source.truth(pose.orientation.timestamp_ns)
        assert truth is not None
        true = to_magnetic_north(np.array([truth.quaternion]), truth.declination)
        return np.array([pose.orientation.quaternion]), true

    def total_deg(self, pose: Pose) -> float:
        return math.degrees(float(total_error(*self.pair(pose))[0]))

    def heading_deg(self, pose: Pose) -> float:
        return math.degrees(float(heading_error(*self.pair(pose))[0]))


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("mode", [RateMode.GAME, RateMode.FASTEST])
@pytest.mark.parametrize("script", ["turn-x", "turn-y", "turn-z"])
def test_each_of_the_24_orientations_of_table_3_is_found_through_the_singular_ones(
    script: str, mode: RateMode, seed: int
) -> None:
    run = _Run(script, mode, seed)
    held: dict[int, list[float]] = {}
    for seconds, pose in run.poses(8 * _SECTION_S):
        error = run.total_deg(pose)
        assert error < 5.0, f"flipped at {seconds} s"
        section, into = divmod(seconds, _SECTION_S)
        if 3.0 <= into <= _HOLD_S:
            held.setdefault(int(section), []).append(error)
    assert len(held) == 8
    assert max(max(errors) for errors in held.values()) <= 1.5


@pytest.mark.parametrize("script", ["look-around", "pan"])
def test_changing_the_mode_live_takes_effect_within_a_second_and_makes_no_heading_jump(script: str) -> None:
    run = _Run(script, RateMode.NORMAL, 0)
    # Away from every sensor's grid, so that a sample at the rate before is under way.
    before = [pose for _, pose in run.poses(10.13)][-1]
    for mode in (RateMode.FASTEST, RateMode.UI, RateMode.GAME, RateMode.NORMAL, RateMode.UI, RateMode.FASTEST):
        run.set_mode(mode)
        changed = [pose for _, pose in run.poses(1)]
        assert changed[-1].rate_mode is mode
        for pose in changed:
            # The phone moves meanwhile: a jump is a change of the error, not of the heading.
            assert abs(run.heading_deg(pose) - run.heading_deg(before)) <= 0.5
            before = pose
        settled = [pose for _, pose in run.poses(4)]
        events = sum(pose.events_fused for pose in settled) / 4
        assert events == pytest.approx({"NORMAL": 25, "UI": 45, "GAME": 150, "FASTEST": 350}[mode.name], rel=0.05)
        before = settled[-1]


def test_filters_side_by_side_get_the_same_events_and_give_what_each_gives_alone() -> None:
    profile = load_profile("patonis2018")

    def poses(names: list[str], asked: list[tuple[str, RateMode]]) -> dict[str, list[Pose]]:
        clock = VirtualClock(1_000_000_000)
        first, *beside = (make_device_filter(name, profile) for name in names)
        service = SensorService(open_source("sim:look-around", profile, clock), first, clock, beside=beside)
        for name, mode in asked:
            service.register_pose(name, 100_000, mode.sampling_period_us, name)
        given: dict[str, list[Pose]] = {}
        for _ in range(50):
            clock.advance_to(clock.now_ns() + 100_000_000)
            service.advance()
            for pose in service.take_poses():
                given.setdefault(pose.filter_name, []).append(pose)
        return given

    both = poses(["dcm-adaptive", "dcm"], [("dcm-adaptive", RateMode.NORMAL), ("dcm", RateMode.GAME)])
    # The faster of the two sets the rate for both, and both say so.
    assert both == poses(["dcm-adaptive"], [("dcm-adaptive", RateMode.GAME)]) | poses(["dcm"], [("dcm", RateMode.GAME)])
    assert [p.sequence for p in both["dcm"]] == [p.sequence for p in both["dcm-adaptive"]]
    assert both["dcm"][-1].orientation != both["dcm-adaptive"][-1].orientation


def test_who_asks_late_for_a_filter_beside_finds_it_as_old_as_the_first() -> None:
    profile = load_profile("patonis2018")

    def last_of_dcm(asked_at_s: int) -> Pose:
        clock = VirtualClock(1_000_000_000)
        first, beside = (make_device_filter(name, profile) for name in ("dcm-adaptive", "dcm"))
        service = SensorService(open_source("sim:look-around", profile, clock), first, clock, beside=[beside])
        service.register_pose("first", 100_000, 0)
        for second in range(20):
            if second == asked_at_s:
                service.register_pose("late", 100_000, 0, "dcm")
            clock.advance_to(clock.now_ns() + 1_000_000_000)
            service.advance()
            poses = service.take_poses()
        return next(pose for pose in reversed(poses) if pose.filter_name == "dcm")

    assert last_of_dcm(asked_at_s=19) == last_of_dcm(asked_at_s=0)


def test_a_pose_stream_can_move_to_another_filter_and_only_to_one_that_runs() -> None:
    profile = load_profile("patonis2018")
    clock = VirtualClock(1_000_000_000)
    filters = [make_device_filter(name, profile) for name in ("dcm-adaptive", "dcm")]
    service = SensorService(open_source("sim:still", profile, clock), filters[0], clock, beside=filters[1:])
    service.register_pose("a", 100_000, 0)
    with pytest.raises(InvalidArgumentError, match=r"'vqf' does not run here, only dcm-adaptive, dcm; name it"):
        service.register_pose("a", 100_000, 0, "vqf")
    for name in ("dcm-adaptive", "dcm"):
        service.register_pose("a", 100_000, 0, name)
        clock.advance_to(clock.now_ns() + 1_000_000_000)
        service.advance()
        assert {pose.filter_name for pose in service.take_poses()} == {name}
    service.unregister_pose("a")
    assert service.next_deadline_ns() is None


def test_a_replay_bound_again_after_a_pause_has_its_first_pose_at_once(tmp_path: Path) -> None:
    recording = tmp_path / "still.csv"
    rows = [
        (sensor, at_ms * 1_000_000, values)
        for at_ms in range(0, 10_000, 20)
        for sensor, values in (
            ("accelerometer", (0.0, 0.0, 9.81)),
            ("gyroscope", (0.0, 0.0, 0.0)),
            ("magnetic_field", (0.0, 22.0, -43.0)),
        )
    ]
    lines = (f"{sensor},{at_ns},{','.join(map(str, values))}\n" for sensor, at_ns, values in rows)
    recording.write_text("sensor,timestamp_ns,x,y,z\n" + "".join(lines))
    clock = VirtualClock(1_000_000_000)
    profile = load_profile("patonis2018")
    source = open_source(f"replay:{recording}", profile, clock)
    service = SensorService(source, make_device_filter("dcm", profile), clock)

    def poses_of(milliseconds: int) -> list[int]:
        clock.advance_to(clock.now_ns() + milliseconds * 1_000_000)
        service.advance()
        return [pose.sequence for pose in service.take_poses()]

    service.register_pose("first", 100_000, 0)
    assert poses_of(1050) == list(range(11))
    service.unregister_pose("first")
    assert poses_of(60_000) == []
    service.register_pose("second", 100_000, 0)
    assert poses_of(200) == [11, 12]
