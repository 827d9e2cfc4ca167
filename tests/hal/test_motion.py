"""Motion scripts: smooth, at human speed, and of one piece."""

import math

import numpy as np
import pytest

from posed.errors import InvalidArgumentError
from posed.events import Float64Array
from posed.hal import motion, rotation
from posed.hal.motion import MotionScript, make_script, script_names

NAMES = script_names()
STEP_S = 1e-3


@pytest.fixture(params=NAMES)
def script(request: pytest.FixtureRequest) -> MotionScript:
    return make_script(request.param, 7)


def times(start: float, end: float) -> Float64Array:
    return start + STEP_S * np.arange(round((end - start) / STEP_S), dtype=np.float64)


def matrix(quaternion: Float64Array) -> Float64Array:
    """The textbook's rotation matrices, float64[n, 3, 3]: an oracle apart from posed.hal.rotation."""
    x, y, z, w = quaternion.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def test_names() -> None:
    held = {"look-around", "returns", "compass", "pan", "walk", "shake"}
    assert set(NAMES) == {"still", "turn-x", "turn-y", "turn-z", "magnet", *held}
    with pytest.raises(InvalidArgumentError, match=r"'wlak' is unknown; allowed: look-around, .*; did you mean walk\?"):
        make_script("wlak", 0)


def test_attitude_is_smooth_and_of_human_speed(script: MotionScript) -> None:
    # Long enough to hold a whole round of every script.
    attitude = script.attitude(times(0.0, 330.0))
    np.testing.assert_allclose(np.linalg.norm(attitude, axis=1), 1.0, rtol=1e-12)
    rate = rotation.increments(attitude) / STEP_S
    assert np.linalg.norm(rate, axis=1).max() <= math.radians(300)
    # A jump of the rate would be an acceleration of a thousandfold, a jump of the acceleration one step here.
    acceleration = np.diff(rate, axis=0) / STEP_S
    assert np.abs(acceleration).max() < 60.0
    assert np.abs(np.diff(acceleration, axis=0)).max() < 1.0


def test_acceleration_is_the_second_derivative_of_the_position(script: MotionScript) -> None:
    t = times(STEP_S, 330.0)
    position, acceleration = script.position(t), script.acceleration(t)
    second = (position[2:] - 2.0 * position[1:-1] + position[:-2]) / STEP_S**2
    np.testing.assert_allclose(second, acceleration[1:-1], atol=0.01)
    assert np.abs(np.diff(acceleration, axis=0)).max() < 0.5


def test_motion_begins_at_the_origin_and_never_ends(script: MotionScript) -> None:
    np.testing.assert_allclose(script.position(np.zeros(1)), 0.0, atol=1e-12)
    month = times(2.6e6, 2.6e6 + 2.0)
    assert np.isfinite(script.attitude(month)).all()
    assert np.abs(script.position(month)).max() < 100.0


def test_a_seed_makes_the_motion() -> None:
    t = times(0.0, 60.0)
    for name in NAMES:
        np.testing.assert_array_equal(make_script(name, 3).attitude(t), make_script(name, 3).attitude(t))
    assert (make_script("look-around", 3).attitude(t) != make_script("look-around", 4).attitude(t)).any()


def test_one_instant_or_many_give_the_same(script: MotionScript) -> None:
    t = np.array([0.0, 3.3, 9.7, 41.0])
    each = np.concatenate([script.attitude(t[i : i + 1]) for i in range(len(t))])
    np.testing.assert_allclose(script.attitude(t), each, atol=1e-14)


@pytest.mark.parametrize(("name", "axis", "sense"), [("turn-x", 0, 1.0), ("turn-y", 1, -1.0), ("turn-z", 2, -1.0)])
def test_turn_rests_at_eight_sections_of_45_degrees(name: str, axis: int, sense: float) -> None:
    script = make_script(name, 0)
    holds = np.linspace(0.0, 40.0, 9)
    start = matrix(script.attitude(np.zeros(1)))[0]
    attitude = script.attitude(holds + 2.0)
    np.testing.assert_array_equal(script.attitude(holds), script.attitude(holds + 3.99))
    for section, turned in enumerate(matrix(attitude)):
        angle = sense * section * math.pi / 4
        wanted = np.zeros((1, 3))
        wanted[0, axis] = angle
        np.testing.assert_allclose(start.T @ turned, matrix(rotation.from_rotation_vector(wanted))[0], atol=1e-12)
    np.testing.assert_allclose(matrix(attitude)[8], start, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        # Table 3 of Patonis 2018, section 3 of the turns about x and y, section 2 of the one about z: columns x, y, z.
        ("turn-x", [[-0.9712, -0.2379, 0.0100], [0.0324, -0.0907, 0.9953], [-0.2359, 0.9670, 0.0958]]),
        ("turn-y", [[-0.0274, -0.0149, 0.9995], [0.2218, -0.9751, -0.0085], [0.9747, 0.2214, 0.0300]]),
        ("turn-z", [[-0.8729, 0.4878, 0.0108], [-0.4878, -0.8730, 0.0022], [0.0105, -0.0034, 0.9999]]),
    ],
)
def test_turn_goes_the_way_of_the_papers_table(name: str, columns: list[list[float]]) -> None:
    script = make_script(name, 0)
    turned = matrix(script.attitude(np.array([7.0 if name == "turn-z" else 12.0])))[0]
    # Set by hand in the paper: within 6 degrees.
    np.testing.assert_allclose(turned.T, columns, atol=math.sin(math.radians(6)))


def test_still_lies_flat_towards_the_north() -> None:
    np.testing.assert_array_equal(make_script("still", 0).attitude(np.array([0.0, 1e5])), [[0, 0, 0, 1], [0, 0, 0, 1]])


@pytest.mark.parametrize("name", ["look-around", "returns", "compass", "pan", "walk", "shake"])
def test_camera_comes_to_look_at_every_target(name: str) -> None:
    script = make_script(name, 5)
    camera = -matrix(script.attitude(times(0.0, 330.0)[::20]))[:, :, 2]
    assert script.targets
    for target in script.targets:
        level = math.cos(target.elevation)
        wanted = [level * math.sin(target.heading), level * math.cos(target.heading), math.sin(target.elevation)]
        nearest = math.degrees(math.acos((camera @ wanted).max()))
        assert nearest < (17.0 if name == "walk" else 3.0), target.name


@pytest.mark.parametrize("name", ["look-around", "walk", "shake"])
def test_phone_is_held_upright(name: str) -> None:
    up_of_screen = matrix(make_script(name, 5).attitude(times(0.0, 330.0)[::20]))[:, 2, 1]
    assert np.median(up_of_screen) > 0.95


def test_look_around_returns() -> None:
    script = make_script("look-around", 5)
    camera = -matrix(script.attitude(times(0.0, 330.0)[::100]))[:, :, 2]
    north = camera[:, 1] > math.cos(math.radians(5))
    assert np.count_nonzero(np.diff(north.astype(int)) == 1) >= 3


def test_returns_looks_at_each_of_three_targets_twenty_times() -> None:
    script = make_script("returns", 5)
    camera = -matrix(script.attitude(times(0.0, 331.0)[::100]))[:, :, 2]
    assert len(script.targets) == 3
    for target in script.targets:
        level = math.cos(target.elevation)
        towards = [level * math.sin(target.heading), level * math.cos(target.heading), math.sin(target.elevation)]
        on_target = camera @ towards > math.cos(math.radians(5))
        assert np.count_nonzero(np.diff(on_target.astype(int)) == 1) == 20


@pytest.mark.parametrize(("name", "degrees_per_s"), [("compass", 15.0), ("pan", 100.0)])
def test_a_pan_turns_right_at_one_rate(name: str, degrees_per_s: float) -> None:
    rotations = matrix(make_script(name, 5).attitude(times(8.0, 80.0)[::1000]))
    heading = np.unwrap(np.arctan2(-rotations[:, 0, 2], -rotations[:, 1, 2]))
    rate = np.degrees(heading[-1] - heading[0]) / (len(heading) - 1)
    assert rate == pytest.approx(degrees_per_s, abs=0.1)


def test_walk_makes_1_8_steps_a_second_at_walking_speed() -> None:
    script = make_script("walk", 1)
    t = times(6.0, 10.0)[::10]
    vertical = script.acceleration(t)[:, 2]
    spectrum = np.abs(np.fft.rfft(vertical, 8192))
    assert np.fft.rfftfreq(8192, 10 * STEP_S)[spectrum.argmax()] == pytest.approx(1.8, abs=0.1)
    position = script.position(times(4.6, 7.4))
    assert np.linalg.norm(position[-1] - position[0]) / 2.8 == pytest.approx(1.3, abs=0.1)


def test_shake_is_quiet_and_then_strong() -> None:
    script = make_script("shake", 1)
    strength = np.linalg.norm(script.acceleration(times(0.0, 8.0)), axis=1)
    assert strength[:5000].max() < 0.5
    assert strength.max() > 8.0


def test_magnet_comes_and_goes() -> None:
    script = make_script("magnet", 1)
    disturbance = script.disturbance(times(0.0, 40.0))
    assert disturbance is not None
    strength = np.linalg.norm(disturbance, axis=1)
    assert strength[:7000].max() < 0.1
    assert strength.max() > 20.0
    assert np.abs(np.diff(disturbance, axis=0)).max() < 1.0
    assert all(make_script(name, 1).disturbance(np.zeros(1)) is None for name in NAMES if name != "magnet")


def test_the_walk_is_integrated_by_the_rule_of_gauss_and_legendre() -> None:
    nodes, weights = np.polynomial.legendre.leggauss(6)
    np.testing.assert_allclose(motion._GAUSS_NODES, nodes, rtol=1e-15)
    np.testing.assert_allclose(motion._GAUSS_WEIGHTS, weights, rtol=1e-15)
