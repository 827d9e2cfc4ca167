"""The sensors that the service computes, on the simulated phone, against how it was really moved."""

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from posed.clock import VirtualClock
from posed.errors import InvalidArgumentError
from posed.events import EventColumn, FilterStatus, Orientation, Position, ReportingMode, SensorType
from posed.hal import open_source
from posed.hal.profile import load_profile
from posed.sensors import Client, SensorService, device_errors, make_device_filter
from posed.sensors.connection import SensorEventConnection
from posed.sensors.declination import declination_at
from posed.sensors.detectors import DeviceOrientation, Persistence, Rule, SignificantMotion, Tilt
from posed.sensors.fused_events import heading, orientation_angles
from posed.sensors.steps import Gait, StepFinder
from posed.sensors.virtual import ACTIVITY_RECOGNITION

_DECLINATION = math.radians(5.5)
_WALKER = Client("walker", permissions=frozenset((ACTIVITY_RECOGNITION,)), target_sdk=35)


class Phone:
    """A simulated phone under a script, and one listener."""

    def __init__(self, script: str, profile: str = "patonis2018") -> None:
        loaded = load_profile(profile)
        self.clock = VirtualClock(10_000_000_000)
        self.source = open_source(f"sim:{script}", loaded, self.clock)
        self.service = SensorService(
            self.source,
            make_device_filter("dcm-adaptive", loaded),
            self.clock,
            declination=lambda: _DECLINATION,
            errors=device_errors(loaded),
        )
        self.connection = self.service.connect(_WALKER)

    def listen(self, *kinds: SensorType, period_us: int = 20_000) -> None:
        for kind in kinds:
            self.service.enable(self.connection, int(kind), period_us, 0)

    def run(self, seconds: float) -> dict[SensorType, EventColumn]:
        """Return all events of so many seconds, by type."""
        return taken(self.service, self.connection, self.clock, seconds)


def taken(
    service: SensorService, connection: SensorEventConnection, clock: VirtualClock, seconds: float
) -> dict[SensorType, EventColumn]:
    found: dict[SensorType, list[EventColumn]] = {}
    for _ in range(round(10 * seconds)):
        clock.advance_to(clock.now_ns() + 100_000_000)
        service.advance()
        while (chunk := connection.take(1000)).columns:
            for handle, column in chunk.columns.items():
                found.setdefault(SensorType(handle), []).append(column)
    return {kind: EventColumn.concatenate(columns) for kind, columns in found.items()}


def _error_deg(one: Sequence[float], other: Sequence[float]) -> float:
    return math.degrees(2 * math.acos(min(1.0, abs(float(np.dot(one, other))))))


def test_orientation_heading_and_pose_follow_the_rotation_vector() -> None:
    phone = Phone("look-around")
    kinds = (SensorType.ROTATION_VECTOR, SensorType.ORIENTATION, SensorType.HEADING, SensorType.POSE_6DOF)
    phone.listen(*kinds)
    events = phone.run(8)
    stamps = events[SensorType.ROTATION_VECTOR].timestamp_ns.tolist()
    assert all(events[kind].timestamp_ns.tolist() == stamps for kind in kinds)
    before: list[float] | None = None
    for row, quaternion in enumerate(events[SensorType.ROTATION_VECTOR].values[:, :4].tolist()):
        assert events[SensorType.ORIENTATION].values[row].tolist() == pytest.approx(orientation_angles(quaternion))
        x, y, z, w = quaternion
        north, east = 1 - 2 * (x * x + z * z), 2 * (x * y - w * z)
        expected = math.degrees(math.atan2(east, north) + _DECLINATION) % 360
        assert events[SensorType.HEADING].values[row, 0] == pytest.approx(expected)
        pose = events[SensorType.POSE_6DOF].values[row].tolist()
        assert len(pose) == 15
        assert (pose[:4], pose[4:7], pose[11:14], pose[14]) == (quaternion, [0, 0, 0], [0, 0, 0], row)
        if before is not None:
            assert _error_deg(quaternion, before) == pytest.approx(_error_deg(pose[7:11], (0, 0, 0, 1)), abs=1e-4)
        before = quaternion
    accuracy = np.degrees(events[SensorType.ROTATION_VECTOR].values[:, 4])
    assert events[SensorType.HEADING].values[:, 1] == pytest.approx(accuracy)


@pytest.mark.parametrize(
    ("quaternion", "azimuth", "pitch", "roll"),
    [
        ((0, 0, 0, 1), 0, 0, 0),
        ((0, 0, -math.sqrt(0.5), math.sqrt(0.5)), 90, 0, 0),
        ((0, 0, math.sqrt(0.5), math.sqrt(0.5)), 270, 0, 0),
        ((math.sqrt(0.5), 0, 0, math.sqrt(0.5)), 0, -90, 0),
        ((0.258819, 0, 0, 0.9659258), 0, -30, 0),
        ((0, 0.258819, 0, 0.9659258), 0, 0, -30),
        ((0, 1, 0, 0), 180, -180, 0),
        ((0.5, -0.5, 0.5, 0.5), 0, 0, 90),
    ],
)
def test_the_deprecated_orientation_has_its_own_signs_and_ranges(
    quaternion: tuple[float, float, float, float], azimuth: float, pitch: float, roll: float
) -> None:
    found = orientation_angles(quaternion)
    if abs(roll) == 90:
        assert found[2] == pytest.approx(roll, abs=1e-4)  # azimuth and pitch are one there
        return
    differences = [(a - b + 180) % 360 - 180 for a, b in zip(found, (azimuth, pitch, roll), strict=True)]
    assert differences == pytest.approx([0, 0, 0], abs=1e-4)


def test_the_game_rotation_vector_turns_as_the_phone_does_from_a_north_of_its_own() -> None:
    phone = Phone("look-around")
    phone.listen(SensorType.GAME_ROTATION_VECTOR)
    column = phone.run(20)[SensorType.GAME_ROTATION_VECTOR]
    assert column.values.shape[1] == 4
    errors = []
    for timestamp_ns, quaternion in zip(column.timestamp_ns.tolist(), column.values.tolist(), strict=True):
        truth = phone.source.truth(timestamp_ns)
        assert truth is not None
        x, y, z, w = truth.quaternion
        a, b, c, d = quaternion
        # estimate * truth^-1, in world axes: constant about the vertical, nothing about the horizontal.
        errors.append(
            (
                -d * x + a * w - b * z + c * y,
                -d * y + a * z + b * w - c * x,
                math.atan2(-d * z - a * y + b * x + c * w, d * w + a * x + b * y + c * z),
            )
        )
    settled = np.array(errors[len(errors) // 4 :])
    assert np.degrees(2 * np.abs(settled[:, :2])).max() < 1.5
    headings = np.degrees(2 * np.unwrap(settled[:, 2], period=math.pi))
    assert np.ptp(headings) < 2.0


def test_the_geomagnetic_rotation_vector_finds_north_without_a_gyroscope() -> None:
    phone = Phone("still")
    phone.listen(SensorType.GEOMAGNETIC_ROTATION_VECTOR)
    column = phone.run(10)[SensorType.GEOMAGNETIC_ROTATION_VECTOR]
    assert column.values.shape[1] == 5
    gyroscope = next(sensor for sensor in phone.service.all_sensors if sensor.info.type is SensorType.GYROSCOPE)
    assert not gyroscope.requests
    half = _DECLINATION / 2
    truth = phone.source.truth(int(column.timestamp_ns[-1]))
    assert truth is not None
    x, y, z, w = truth.quaternion
    cosine, sine = math.cos(half), math.sin(half)
    magnetic = (cosine * x - sine * y, cosine * y + sine * x, cosine * z + sine * w, cosine * w - sine * z)
    assert _error_deg(column.values[-1, :4].tolist(), magnetic) < 3.0


def test_a_sensor_of_its_own_filter_wakes_only_what_it_needs_and_leaves_the_pose_alone() -> None:
    phone = Phone("look-around")
    phone.listen(SensorType.GAME_ROTATION_VECTOR)
    phone.run(2)
    active = {sensor.info.type for sensor in phone.service.active_sensors}
    assert active == {SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.GAME_ROTATION_VECTOR}
    assert phone.service.events_fused == 0


def _walked(phone: Phone, seconds: float) -> float:
    """Return the steps that the script's body made: one a bounce, 1.8 a second while it walks."""
    start_ns = phone.clock.now_ns() - round(seconds * 1e9)
    t = np.arange(start_ns, phone.clock.now_ns(), 5_000_000)
    truths = [phone.source.truth(int(at)) for at in t]
    east, north = np.array([truth.position_enu[:2] for truth in truths if truth and truth.position_enu]).T
    speed = np.hypot(np.diff(east), np.diff(north)) / 0.005
    return float(1.8 * 0.005 * np.count_nonzero(speed > 0.5 * speed.max()))


def test_the_steps_of_a_walk_are_told_and_counted() -> None:
    phone = Phone("walk")
    phone.listen(SensorType.STEP_DETECTOR, SensorType.STEP_COUNTER)
    events = phone.run(60)
    steps = len(events[SensorType.STEP_DETECTOR])
    assert steps == pytest.approx(_walked(phone, 60), rel=0.05)
    counts = events[SensorType.STEP_COUNTER].values[:, 0]
    assert (counts[0], counts[-1]) == (0, steps)
    assert (np.diff(counts) > 0).all()
    intervals = np.diff(events[SensorType.STEP_DETECTOR].timestamp_ns) / 1e9
    assert np.median(intervals) == pytest.approx(1 / 1.8, abs=0.03)


def test_the_counter_goes_on_from_where_it_was() -> None:
    phone = Phone("walk")
    phone.listen(SensorType.STEP_COUNTER)
    before = phone.run(20)[SensorType.STEP_COUNTER].values[-1, 0]
    assert before > 10
    phone.service.disable(phone.connection, int(SensorType.STEP_COUNTER))
    phone.run(5)
    phone.listen(SensorType.STEP_COUNTER)
    assert phone.run(1)[SensorType.STEP_COUNTER].values[0, 0] == before


@pytest.mark.parametrize("script", ["still", "look-around", "turn-x", "turn-y", "shake"])
def test_a_phone_that_is_not_carried_makes_no_steps_and_no_significant_motion(script: str) -> None:
    phone = Phone(script)
    phone.listen(SensorType.STEP_DETECTOR)
    significant = phone.service.connect()
    phone.service.enable(significant, int(SensorType.SIGNIFICANT_MOTION), 0, 0)
    assert phone.run(40) == {}
    assert not significant.take(1000).columns


def test_step_sensors_need_the_permission_and_old_programs_do_not() -> None:
    phone = Phone("walk")
    nosy = phone.service.connect(Client("nosy", target_sdk=35))
    with pytest.raises(InvalidArgumentError, match=r"nosy lacks .*ACTIVITY_RECOGNITION"):
        phone.service.enable(nosy, int(SensorType.STEP_DETECTOR), 0, 0)
    old = phone.service.connect(Client("old", target_sdk=28))
    phone.service.enable(old, int(SensorType.STEP_DETECTOR), 0, 0)


def _fires_after(phone: Phone, kind: SensorType, seconds: float) -> float | None:
    begun_ns = phone.clock.now_ns()
    phone.listen(kind)
    events = phone.run(seconds)
    if kind not in events:
        return None
    assert events[kind].values.tolist() == [[1.0]]
    assert kind not in {sensor.info.type for sensor in phone.service.active_sensors}
    return (int(events[kind].timestamp_ns[0]) - begun_ns) / 1e9


def test_a_still_phone_is_stationary_after_five_seconds_and_not_in_motion() -> None:
    after = _fires_after(Phone("still"), SensorType.STATIONARY_DETECT, 15)
    assert after is not None
    assert 5 <= after <= 10
    assert _fires_after(Phone("still"), SensorType.MOTION_DETECT, 15) is None


def test_a_walk_is_motion_and_significant_and_not_stationary() -> None:
    for kind, latest in ((SensorType.MOTION_DETECT, 10), (SensorType.SIGNIFICANT_MOTION, 12)):
        after = _fires_after(Phone("walk"), kind, 20)
        assert after is not None
        assert 5 <= after <= latest
    assert _fires_after(Phone("walk"), SensorType.STATIONARY_DETECT, 20) is None


def _held(rule: object, *spells: tuple[float, tuple[float, float, float]]) -> list[tuple[float, float]]:
    """Return what a rule reports of accelerations held for so many seconds each, with when, s."""
    assert callable(rule)
    found, at_ns = [], 0
    for seconds, acceleration in spells:
        for _ in range(round(50 * seconds)):
            value = rule(at_ns, acceleration)
            if value is not None:
                found.append((at_ns / 1e9, value))
            at_ns += 20_000_000
    return found


def _raised(degrees: float) -> tuple[float, float, float]:
    angle = math.radians(degrees)
    return 0.0, 9.81 * math.sin(angle), 9.81 * math.cos(angle)


def test_a_tilt_is_the_mean_of_two_seconds_turned_by_35_degrees_and_each_is_told_once() -> None:
    assert _held(Tilt(), (5, _raised(0)), (10, _raised(34))) == []
    told = _held(Tilt(), (5, _raised(0)), (10, _raised(40)), (10, _raised(0)))
    assert [value for _, value in told] == [1.0, 1.0]
    assert 5 < told[0][0] <= 7.1
    assert 15 < told[1][0] <= 17.1


def test_the_device_orientation_is_told_at_first_and_at_each_steady_change() -> None:
    told = _held(
        DeviceOrientation(),
        (2, (0.0, 9.81, 0.0)),
        (0.3, (9.81, 0.0, 0.0)),  # too short to count
        (2, (0.0, 9.81, 0.0)),
        (2, (9.81, 0.0, 0.5)),
        (2, (0.0, 0.0, 9.81)),  # flat: stays
        (2, (0.0, -9.81, 0.0)),
        (2, (-9.81, 0.0, 0.0)),
        (2, (-6.9, 6.9, 0.0)),  # on the corner: stays
    )
    assert [value for _, value in told] == [0, 1, 2, 3]
    assert [value for _, value in _held(DeviceOrientation(), (3, (0.0, 0.0, 9.81)))] == [0]


def test_a_tilt_is_of_two_seconds_whatever_the_rate_was_before() -> None:
    tilt, at_ns, told = Tilt(), 0, []
    for rate_hz, seconds, degrees in ((400, 5, 0), (50, 3, 0), (50, 10, 40)):
        for _ in range(rate_hz * seconds):
            at_ns += round(1e9 / rate_hz)
            if tilt(at_ns, _raised(degrees)) is not None:
                told.append(at_ns / 1e9)
    assert len(told) == 1
    assert 8 < told[0] <= 10.1


def test_persistence_begins_anew_when_it_is_broken() -> None:
    still, moved = (0.0, 0.0, 9.81), (1.5, 0.0, 9.81)
    assert _held(Persistence(moving=False, seconds=5), (4, still), (0.2, moved), (4, still)) == []
    assert _held(SignificantMotion(), (30, still)) == []


@pytest.mark.parametrize(
    ("make", "held"),
    [
        (lambda: Persistence(moving=False, seconds=5), [(0.0, 0.0, 9.81)]),
        (lambda: Persistence(moving=True, seconds=5), [(1.5, 0.0, 9.81), (-1.5, 0.0, 9.81)]),
        (SignificantMotion, [(0.0, 0.0, 8.0), (0.0, 0.0, 12.0)]),
    ],
)
def test_persistence_does_not_count_across_a_gap(
    make: Callable[[], Rule], held: Sequence[tuple[float, float, float]]
) -> None:
    def told(rule: Rule, begun_s: float, seconds: float) -> list[float]:
        samples = [(begun_s + index * 0.02, held[index % len(held)]) for index in range(round(seconds * 50))]
        return [at_s for at_s, sample in samples if rule(round(1e9 * at_s), sample) is not None]

    (needed_s, *_) = told(make(), 0.0, 12.0)
    rule = make()
    assert told(rule, 0.0, needed_s) == []
    (first_s, *_) = told(rule, 3600.0, 12.0)
    assert first_s == pytest.approx(3600.0 + needed_s)
    # A sample or two that are lost are no gap.
    rule = make()
    assert told(rule, 0.0, needed_s) == []
    assert told(rule, needed_s + 0.4, 0.02) == [needed_s + 0.4]


def _steps_of(intervals_s: Sequence[float]) -> int:
    """Return how many of the peaks at these intervals are steps."""
    gait = Gait()
    instants_s = itertools.accumulate(intervals_s, initial=1.0)
    return sum(len(gait.take(round(1e9 * at_s))) for at_s in instants_s)


@pytest.mark.parametrize(
    ("intervals_s", "steps"),
    [
        ([0.55] * 20, 21),
        ([0.43, 0.65] * 10, 21),  # the legs of one with the phone in a pocket
        ([0.43, 0.15, 0.5] * 10, 21),  # a second peak at every other step
        ([0.55] * 6 + [1.1] + [0.55] * 6, 14),  # a step that was not seen
        ([0.55] * 6 + [2.0] + [0.55] * 6, 14),  # a stop
        ([0.55] * 6 + [2.0, 0.55, 0.55], 7),
        ([0.4, 0.8] * 10, 0),
        ([0.4, 0.85, 0.6] * 5, 0),
        ([1.2] * 12, 0),
        ([0.32] * 12, 0),
        ([0.55] * 2, 0),
    ],
)
def test_peaks_at_a_walkers_intervals_alone_are_steps(intervals_s: list[float], steps: int) -> None:
    assert _steps_of(intervals_s) == steps


def test_the_first_steps_of_a_usual_walk_are_told_within_two_seconds() -> None:
    gait, told = Gait(), []
    for step in range(10):
        told += [(0.55 * step, at_ns / 1e9) for at_ns in gait.take(round(550_000_000 * step))]
    assert [at_s for _, at_s in told] == pytest.approx([0.55 * step for step in range(10)])
    assert max(told_s - at_s for told_s, at_s in told) < 2.0


@pytest.mark.parametrize("bad", ["nan", "inf", "1e200"])
def test_what_is_no_measurement_stops_no_detector(tmp_path: Path, bad: str) -> None:
    rows = ["sensor,timestamp_ns,x,y,z"]
    for k in range(2000):
        bounce = bad if k % 400 == 399 else f"{9.81 + 3 * math.sin(2 * math.pi * k / 55):.6f}"
        rows += [f"accelerometer,{10_000_000 * k},0,{bounce},0", f"gyroscope,{10_000_000 * k},0,0,0"]
        rows += [f"magnetic_field,{10_000_000 * k},0,-40,-20"]
    (tmp_path / "walk.csv").write_text("\n".join(rows) + "\n")
    profile, clock = load_profile("modern"), VirtualClock(10_000_000_000)
    source = open_source(f"replay:{tmp_path}/walk.csv", profile, clock)
    service = SensorService(source, make_device_filter("dcm-adaptive", profile), clock, errors=device_errors(profile))
    connection = service.connect(_WALKER)
    kinds = (
        SensorType.STEP_COUNTER,
        SensorType.TILT_DETECTOR,
        SensorType.DEVICE_ORIENTATION,
        SensorType.STATIONARY_DETECT,
        SensorType.MOTION_DETECT,
        SensorType.SIGNIFICANT_MOTION,
    )
    for kind in kinds:
        service.enable(connection, int(kind), 0, 0)
    events = taken(service, connection, clock, 21)
    assert events[SensorType.STEP_COUNTER].values[-1, 0] == pytest.approx(36, abs=2)
    assert events[SensorType.DEVICE_ORIENTATION].values.tolist() == [[0.0]]
    assert {SensorType.MOTION_DETECT, SensorType.SIGNIFICANT_MOTION} <= set(events)
    assert not {SensorType.TILT_DETECTOR, SensorType.STATIONARY_DETECT} & set(events)


def test_an_azimuth_stays_below_360_in_single_precision() -> None:
    for turned in (0.0, 1e-18, 1e-9, 5e-8, 1e-6, -1e-9):
        quaternion = (0.0, 0.0, turned, math.sqrt(1 - turned * turned))
        told = orientation_angles(quaternion)[0], heading(_orientation(quaternion), 0.0)[0]
        assert all(0 <= float(np.float32(azimuth)) < 360 for azimuth in told)
        assert all(min(azimuth, 360 - azimuth) < 2e-4 for azimuth in told)


def _orientation(quaternion: tuple[float, float, float, float]) -> Orientation:
    return Orientation(0, quaternion, (0.0, 0.0, 0.0), 0.1, FilterStatus.OK)


_WALKS = {
    "InHand": 365,
    "FrontPocket": 277,
    "BackPocket": 314,
    "Purse": 288,
    "NeckPouch": 282,
    "Armband": 295,
}
"""Steps that were counted in the walks of one of the Oxford step counter set, by where the phone was."""


@pytest.mark.parametrize("place", _WALKS)
def test_the_steps_of_real_walks_are_found_wherever_the_phone_is(data_dir: Path, place: str) -> None:
    path = data_dir / "step-counting" / f"Samsung_Carmelo_Hard_{place}_1" / "accelerometer.csv.gz"
    samples = np.loadtxt(path, delimiter=",", usecols=(0, 2, 3, 4), comments="#")
    finder = StepFinder()
    sizes = np.linalg.norm(samples[:, 1:], axis=1).tolist()
    found = sum(len(finder.take(int(at_ns), size)) for at_ns, size in zip(samples[:, 0], sizes, strict=True))
    assert found == pytest.approx(_WALKS[place], rel=0.02)


def test_true_north_is_known_where_the_position_is() -> None:
    assert declination_at(None) is None
    declination = declination_at(Position(40.6265, 22.9591, 60.0))
    assert declination is not None
    assert math.degrees(declination()) == pytest.approx(5.4, abs=0.6)
    phone = Phone("still")
    blind = SensorService(phone.source, make_device_filter("dcm", load_profile("patonis2018")), phone.clock)
    assert SensorType.HEADING not in {sensor.type for sensor in blind.sensors}
    assert SensorType.HEADING in {sensor.type for sensor in phone.service.sensors}


def test_the_list_tells_modes_and_wake_up_as_android_does() -> None:
    listed = {sensor.type: sensor for sensor in Phone("still").service.sensors}
    modes = {
        SensorType.SIGNIFICANT_MOTION: (ReportingMode.ONE_SHOT, True, -1),
        SensorType.STATIONARY_DETECT: (ReportingMode.ONE_SHOT, False, -1),
        SensorType.MOTION_DETECT: (ReportingMode.ONE_SHOT, False, -1),
        SensorType.TILT_DETECTOR: (ReportingMode.SPECIAL_TRIGGER, True, 0),
        SensorType.STEP_DETECTOR: (ReportingMode.SPECIAL_TRIGGER, False, 0),
        SensorType.STEP_COUNTER: (ReportingMode.ON_CHANGE, False, 0),
        SensorType.DEVICE_ORIENTATION: (ReportingMode.ON_CHANGE, False, 0),
    }
    for kind, (mode, wake_up, min_delay_us) in modes.items():
        assert (listed[kind].reporting_mode, listed[kind].wake_up, listed[kind].min_delay_us) == (
            mode,
            wake_up,
            min_delay_us,
        )
