"""Error measures against turns that are known, and truth between its samples."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posed.errors import InvalidArgumentError
from posed.evaluation.measures import (
    heading_error,
    inclination_error,
    nearest_truth,
    quaternion_error,
    rmse,
    slerp_truth,
    to_magnetic_north,
    total_error,
)
from posed.events import Float64Array

ANGLES = st.floats(-3.0, 3.0)


def about(axis: tuple[float, float, float], angle: float) -> Float64Array:
    """Return one row: the turn about an axis by rad."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.array([[*(unit * np.sin(angle / 2)), np.cos(angle / 2)]])


def times(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the product of two one-row quaternions, by way of scalar and vector parts."""
    va, vb, wa, wb = a[0, :3], b[0, :3], a[0, 3], b[0, 3]
    return np.array([[*(wa * vb + wb * va + np.cross(va, vb)), wa * wb - va @ vb]])


@given(ANGLES, ANGLES, ANGLES)
def test_a_turn_about_the_vertical_is_heading_alone(heading: float, roll: float, pitch: float) -> None:
    truth = times(about((1, 0, 0), roll), about((0, 1, 0), pitch))
    estimate = times(about((0, 0, 1), heading), truth)
    assert heading_error(estimate, truth) == pytest.approx(abs(heading), abs=1e-7)
    assert total_error(estimate, -3.0 * truth) == pytest.approx(abs(heading), abs=1e-7)
    assert inclination_error(estimate, truth) == pytest.approx(0.0, abs=1e-7)


@given(ANGLES, ANGLES, st.floats(0, 6.28))
def test_a_tilt_is_inclination_alone_wherever_the_phone_points(tilt: float, roll: float, direction: float) -> None:
    truth = times(about((0, 0, 1), roll), about((1, 1, 0), roll))
    estimate = times(about((np.cos(direction), np.sin(direction), 0), tilt), truth)
    assert inclination_error(estimate, truth) == pytest.approx(abs(tilt), abs=1e-7)
    assert total_error(estimate, truth) == pytest.approx(abs(tilt), abs=1e-7)
    assert heading_error(estimate, truth) == pytest.approx(0.0, abs=1e-7)


def test_broads_formulas() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(2, 100, 4))
    e = quaternion_error(a, b)
    assert np.linalg.norm(e, axis=1) == pytest.approx(np.ones(100))
    assert total_error(a, b) == pytest.approx(2 * np.arccos(np.abs(e[:, 3])))
    assert heading_error(a, b) == pytest.approx(2 * np.arctan(np.abs(e[:, 2] / e[:, 3])))
    assert inclination_error(a, b) == pytest.approx(2 * np.arccos(np.sqrt(e[:, 3] ** 2 + e[:, 2] ** 2)))


def test_small_errors_keep_their_digits() -> None:
    truth = about((1, 2, 3), 1.0)
    assert total_error(times(about((1, 0, 0), 1e-9), truth), truth) == pytest.approx(1e-9, rel=1e-6)


def test_rmse_over_what_is_flagged() -> None:
    error = np.array([3.0, 4.0, np.nan])
    assert rmse(error, np.array([True, True, False])) == pytest.approx(np.sqrt(12.5))
    assert np.isnan(rmse(error))
    with pytest.raises(InvalidArgumentError, match="none of 3"):
        rmse(error, np.zeros(3, bool))


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InvalidArgumentError, match=r"\(4,\)"):
        total_error(np.array([0.0, 0.0, 0.0, 1.0]), about((1, 0, 0), 0.0))
    with pytest.raises(InvalidArgumentError, match="1 estimates stand against 2"):
        total_error(about((1, 0, 0), 0.0), np.ones((2, 4)))
    with pytest.raises(InvalidArgumentError, match="2 rows and 1 times"):
        slerp_truth(np.array([0]), np.array([0]), np.ones((2, 4)))


def test_truth_between_its_samples() -> None:
    stamps = np.array([0, 100, 200], np.int64)
    # The last row is the same rotation with the other sign: the short way round is taken.
    truth = np.concatenate([about((0, 0, 1), 0.0), about((0, 0, 1), 1.0), -about((0, 0, 1), 2.0)])
    at = np.array([-1, 0, 25, 100, 175, 200, 201], np.int64)
    between = slerp_truth(at, stamps, truth, max_gap_ns=100)
    assert np.isnan(between[[0, 6]]).all()
    wanted = np.concatenate([about((0, 0, 1), angle) for angle in (0.0, 0.25, 1.0, 1.75, 2.0)])
    assert total_error(between[1:6], wanted) == pytest.approx(np.zeros(5), abs=1e-12)


def test_truth_is_unknown_across_a_gap_but_not_at_its_edges() -> None:
    stamps = np.array([0, 100, 200, 300, 400], np.int64)
    truth = np.repeat(about((1, 0, 0), 0.5), 5, axis=0)
    truth[1:3] = np.nan
    at = np.array([0, 50, 200, 300, 350], np.int64)
    assert np.isnan(slerp_truth(at, stamps, truth, max_gap_ns=200))[:, 0].tolist() == [False, True, True, False, False]
    assert not np.isnan(slerp_truth(at, stamps, truth, max_gap_ns=300)).any()
    near = nearest_truth(np.array([-60, -40, 40, 60, 250, 260, 460], np.int64), stamps, truth, max_gap_ns=50)
    assert np.isnan(near)[:, 0].tolist() == [True, False, False, True, False, False, True]


def test_no_truth_at_all_is_nan() -> None:
    at = np.array([0, 5], np.int64)
    for find in (slerp_truth, nearest_truth):
        assert np.isnan(find(at, np.array([1], np.int64), np.full((1, 4), np.nan))).all()
        assert np.isnan(find(at, np.empty(0, np.int64), np.empty((0, 4)))).all()


def test_nearest_truth_takes_the_nearer_side() -> None:
    stamps = np.array([0, 100], np.int64)
    truth = np.concatenate([about((1, 0, 0), 0.1), about((1, 0, 0), 0.2)])
    near = nearest_truth(np.array([50, 51], np.int64), stamps, truth)
    assert near == pytest.approx(truth)


def test_declination_turns_true_north_into_magnetic_north() -> None:
    """Magnetic heading = true heading - declination; heading is clockwise, turns in ENU are not."""
    declination = 0.1
    true_heading = 1.0
    magnetic = to_magnetic_north(times(about((0, 0, 1), -true_heading), about((1, 0, 0), 0.4)), declination)
    wanted = times(about((0, 0, 1), -(true_heading - declination)), about((1, 0, 0), 0.4))
    assert total_error(magnetic, wanted) == pytest.approx(0.0, abs=1e-12)
