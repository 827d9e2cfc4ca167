"""Calibrations fitted of readings that are known."""

import numpy as np
import pytest

from posed.errors import RecordingError
from posed.evaluation.calibration_fit import fit_ellipsoid, fit_still_rate
from posed.events import Float64Array


def _directions(count: int = 1500, seed: int = 3) -> Float64Array:
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_hard_and_soft_iron_are_found_and_no_axis_is_turned() -> None:
    soft = np.array([[1.1, 0.05, -0.02], [0.05, 0.95, 0.03], [-0.02, 0.03, 1.0]])
    hard = np.array([60.0, -50.0, 410.0])
    raw = 48.0 * _directions() @ np.linalg.inv(soft).T + hard
    raw[7] = np.nan
    found = fit_ellipsoid(raw)
    assert found.bias == pytest.approx(hard, abs=1e-6)
    assert found.matrix == pytest.approx(soft / np.cbrt(np.linalg.det(soft)), abs=1e-6)
    norm = np.linalg.norm(found.apply(np.delete(raw, 7, axis=0)), axis=1)
    assert norm == pytest.approx(np.full(len(norm), norm[0]))


def test_noise_moves_the_fit_little() -> None:
    hard = np.array([60.0, -50.0, 410.0])
    raw = 48.0 * _directions() + hard + np.random.default_rng(4).normal(0.0, 0.7, (1500, 3))
    assert fit_ellipsoid(raw).bias == pytest.approx(hard, abs=0.2)


def test_readings_that_do_not_tell_are_refused() -> None:
    angle = np.linspace(0.0, 6.0, 500)
    ring = 40.0 * np.stack([np.cos(angle), np.sin(angle), 0.01 * np.sin(7 * angle)], axis=1)
    cap = _directions()
    cap = 48.0 * cap[cap[:, 2] > 0.9] + np.random.default_rng(5).normal(0.0, 0.3, (int((cap[:, 2] > 0.9).sum()), 3))
    for raw in (ring, ring + 100.0, np.vstack([cap] * 3), np.tile([1.0, 2.0, 3.0], (200, 1)), np.ones((5, 3))):
        with pytest.raises(RecordingError, match=r"turn the phone about all|at least 100"):
            fit_ellipsoid(raw)


def test_handling_before_and_after_stillness_does_not_count() -> None:
    rng = np.random.default_rng(6)
    rate = rng.normal((0.015, -0.003, 0.071), 1e-3, (1600, 3))
    rate[:170] += rng.normal(0.0, 1.5, (170, 3))
    rate[-40:] += rng.normal(0.0, 0.5, (40, 3))
    assert fit_still_rate(rate).bias == pytest.approx((0.015, -0.003, 0.071), abs=2e-4)
    with pytest.raises(RecordingError, match="5 gyroscope readings"):
        fit_still_rate(rate[:5])
