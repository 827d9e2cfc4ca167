"""A magnetometer's and a gyroscope's calibration from recordings made for it: turning about all axes, and stillness."""

import numpy as np

from posed.errors import RecordingError
from posed.events import Float64Array
from posed.hal.calibration import Calibration

_FEWEST = 100
_STILL_SPREAD = 3.0
"""Times the median spread of all stretches; of the recordings known, those in motion spread 50 times as much."""
_LEAST_SPREAD = 0.3
"""Of each of the three directions in which the readings spread least to most, as a share of the fitted radius.

Over all orientations it is 1 / sqrt(3) = 0.58; a turn about one axis leaves 0.
"""


def fit_ellipsoid(readings: Float64Array) -> Calibration:
    """Return hard and soft iron such that |matrix @ (m - bias)| is constant over the readings (uT, float64[n, 3]).

    The ellipsoid is the algebraic least-squares one; the matrix is its symmetric root, which turns no axis, scaled so
    that the norm is the mean radius. Raises RecordingError if the readings do not spread over all orientations.
    """
    m = readings[np.isfinite(readings).all(axis=1)]
    if len(m) < _FEWEST:
        raise RecordingError(f"{len(m)} magnetometer readings; an ellipsoid needs at least {_FEWEST}")
    # Centred and scaled, the squares and the constant are of one size and the normal equations well conditioned.
    centre = m.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((m - centre) ** 2, axis=1))))
    if not size > 0.0:
        raise RecordingError("all magnetometer readings are the same; turn the phone about all its axes")
    x, y, z = ((m - centre) / size).T
    design = np.stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, 2 * x, 2 * y, 2 * z], axis=1)
    a, b, c, d, e, f, g, h, i = np.linalg.lstsq(design, np.ones(len(m)), rcond=None)[0]
    shape = np.array([[a, d, e], [d, b, f], [e, f, c]])
    values, axes = np.linalg.eigh(shape)
    if not values[0] > 1e-3 * values[2]:
        raise RecordingError("the magnetometer readings lie on no ellipsoid; turn the phone about all its axes")
    middle = -np.linalg.solve(shape, np.array([g, h, i]))
    radii = np.sqrt((1.0 + middle @ shape @ middle) / values)
    radius = float(np.cbrt(np.prod(radii)))
    matrix = axes @ np.diag(radius / radii) @ axes.T
    calibration = Calibration(centre + size * middle, matrix)
    spread = np.sqrt(np.linalg.eigvalsh(np.cov(calibration.apply(m).T))[0]) / (size * radius)
    if not spread > _LEAST_SPREAD:
        raise RecordingError(
            f"the magnetometer readings spread {spread:.2f} of their radius in one direction, and {_LEAST_SPREAD:g} is"
            " the least; turn the phone about all its axes"
        )
    return calibration


def fit_still_rate(readings: Float64Array) -> Calibration:
    """Return the bias of a gyroscope that lay still: the mean of its readings (rad/s, float64[n, 3]).

    Stretches in which it was still being put down or was picked up again, told by their spread, are left out.
    """
    sound = readings[np.isfinite(readings).all(axis=1)]
    if len(sound) < _FEWEST:
        raise RecordingError(f"{len(sound)} gyroscope readings; a bias needs at least {_FEWEST}")
    stretches = sound[: len(sound) // _FEWEST * _FEWEST].reshape(-1, _FEWEST, 3)
    spread = stretches.std(axis=1).max(axis=1)
    return Calibration(stretches[spread <= _STILL_SPREAD * np.median(spread)].mean(axis=(0, 1)))
