"""Orientation error against truth, by the definitions of BROAD (Laidig, Caruso, Cereatti, Seel 2021).

Quaternions are float64[n, 4] rows (x, y, z, w), device to world (ENU); their length and sign do not matter. Truth that
is not known is NaN, and so is then the error.
"""

import numpy as np
import numpy.typing as npt

from posed.errors import InvalidArgumentError
from posed.events import Float64Array, Int64Array

BoolArray = npt.NDArray[np.bool_]


def quaternion_error(estimate: Float64Array, truth: Float64Array) -> Float64Array:
    """Return e = estimate * conj(truth), float64[n, 4] of unit length: the turn in the world that is too much."""
    ax, ay, az, aw = _unit(estimate, "estimate").T
    bx, by, bz, bw = (_unit(truth, "truth") * (-1.0, -1.0, -1.0, 1.0)).T
    if len(ax) != len(bx):
        raise InvalidArgumentError(f"{len(ax)} estimates stand against {len(bx)} of truth; give one truth for each")
    return np.stack(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ],
        axis=-1,
    )


def total_error(estimate: Float64Array, truth: Float64Array) -> Float64Array:
    """Return the angle of the whole error, 2 acos |e_w|, rad[n] in [0, pi]."""
    e = quaternion_error(estimate, truth)
    # atan2 of the two parts equals the arc cosine and keeps its digits where the error is small.
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(e[:, :3], axis=1), np.abs(e[:, 3])))


def heading_error(estimate: Float64Array, truth: Float64Array) -> Float64Array:
    """Return the part of the error about the vertical, 2 atan |e_z / e_w|, rad[n] in [0, pi]."""
    e = quaternion_error(estimate, truth)
    return np.asarray(2.0 * np.arctan2(np.abs(e[:, 2]), np.abs(e[:, 3])))


def inclination_error(estimate: Float64Array, truth: Float64Array) -> Float64Array:
    """Return the angle between the two verticals, 2 acos sqrt(e_w^2 + e_z^2), rad[n] in [0, pi]."""
    e = quaternion_error(estimate, truth)
    return np.asarray(2.0 * np.arctan2(np.hypot(e[:, 0], e[:, 1]), np.hypot(e[:, 2], e[:, 3])))


def rmse(error: Float64Array, where: BoolArray | None = None) -> float:
    """Return the root mean square of the errors flagged in `where` (all without it), in their unit.

    NaN among them gives NaN. Raises InvalidArgumentError when nothing is left to average.
    """
    chosen = error if where is None else error[where]
    if not chosen.size:
        raise InvalidArgumentError(f"none of {error.size} errors is flagged; there is nothing to average")
    return float(np.sqrt(np.mean(np.square(chosen))))


def slerp_truth(
    timestamp_ns: Int64Array, truth_ns: Int64Array, truth: Float64Array, max_gap_ns: int = 100_000_000
) -> Float64Array:
    """Return truth at `timestamp_ns` (int64[n]), interpolated on the sphere between its neighbours, float64[n, 4].

    truth_ns: int64[m], increasing; truth: float64[m, 4], NaN where the tracking was lost. NaN outside of it and where
    the neighbours known are more than `max_gap_ns` apart.
    """
    times, known = _known(truth_ns, truth)
    result = np.full((len(timestamp_ns), 4), np.nan)
    if not len(times):
        return result
    after = np.clip(np.searchsorted(times, timestamp_ns), 0, len(times) - 1)
    before = np.where(times[after] == timestamp_ns, after, np.maximum(after - 1, 0))
    span = times[after] - times[before]
    inside = (times[before] <= timestamp_ns) & (timestamp_ns <= times[after]) & (span <= max_gap_ns)
    a = known[before]
    b = known[after]
    cosine = np.sum(a * b, axis=1)
    b = np.where(cosine[:, None] < 0.0, -b, b)
    angle = np.arctan2(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)) * 2.0
    share = (timestamp_ns - times[before]) / np.maximum(span, 1)
    # Where the neighbours are all but equal, the chord is the arc and the sines would divide zero by zero.
    sine = np.sin(angle)
    flat = sine < 1e-9
    divisor = np.where(flat, 1.0, sine)
    weight_a = np.where(flat, 1.0 - share, np.sin((1.0 - share) * angle) / divisor)
    weight_b = np.where(flat, share, np.sin(share * angle) / divisor)
    between = weight_a[:, None] * a + weight_b[:, None] * b
    result[inside] = _unit(between[inside], "truth")
    return result


def nearest_truth(
    timestamp_ns: Int64Array, truth_ns: Int64Array, truth: Float64Array, max_gap_ns: int = 100_000_000
) -> Float64Array:
    """Return the truth nearest in time to `timestamp_ns` (int64[n]), float64[n, 4], NaN if further than `max_gap_ns`.

    truth_ns: int64[m], increasing; truth: float64[m, 4], NaN where the tracking was lost.
    """
    times, known = _known(truth_ns, truth)
    result = np.full((len(timestamp_ns), 4), np.nan)
    if not len(times):
        return result
    after = np.clip(np.searchsorted(times, timestamp_ns), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(timestamp_ns - times[before] <= times[after] - timestamp_ns, before, after)
    close = np.abs(times[nearest] - timestamp_ns) <= max_gap_ns
    result[close] = known[nearest[close]]
    return result


def to_magnetic_north(quaternion: Float64Array, declination: float) -> Float64Array:
    """Return rotations given against true north as against magnetic north (declination in rad, east positive)."""
    x, y, z, w = quaternion.T
    s = np.sin(0.5 * declination)
    c = np.cos(0.5 * declination)
    return np.stack([c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z], axis=-1)


def _unit(quaternion: Float64Array, name: str) -> Float64Array:
    if quaternion.ndim != 2 or quaternion.shape[1] != 4:
        raise InvalidArgumentError(f"{name} has shape {quaternion.shape}; give rows (x, y, z, w), float64[n, 4]")
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True))


def _known(truth_ns: Int64Array, truth: Float64Array) -> tuple[Int64Array, Float64Array]:
    """Return the times and unit quaternions of the truth that is known."""
    if len(truth_ns) != len(truth):
        raise InvalidArgumentError(f"truth has {len(truth)} rows and {len(truth_ns)} times; give one time for each")
    rows = np.isfinite(truth).all(axis=1)
    return truth_ns[rows], _unit(truth[rows], "truth")
