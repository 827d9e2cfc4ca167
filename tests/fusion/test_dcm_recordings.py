"""The filter over a phone in seven ways of carrying it, near magnets and not, against optical truth."""

import csv
import gzip
from pathlib import Path

import numpy as np
import pytest
from synthetic_phone import FlatEvents

from posed.evaluation.measures import nearest_truth, rmse, to_magnetic_north, total_error
from posed.events import Float64Array, Int64Array, SensorType
from posed.fusion.dcm import DcmFilter

DECLINATION = np.radians(1.75)
GAME_NS = 20_000_000
POSE_NS = 100_000_000


def stream(path: Path) -> tuple[Int64Array, Float64Array]:
    """Return the times (ns) and three axes of an Android text file."""
    with gzip.open(path) as lines:
        rows = np.loadtxt(lines, usecols=(0, 1, 2, 3))
    return np.round(rows[:, 0] * 1e9).astype(np.int64), rows[:, 1:]


def interval_means(times: Int64Array, values: Float64Array) -> tuple[Int64Array, Float64Array]:
    """Return one sample every GAME period: the mean since the one before, at the last time in it."""
    edges = np.flatnonzero(np.diff((times - times[0] - 1) // GAME_NS)) + 1
    starts, ends = np.r_[0, edges], np.r_[edges, len(times)]
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
    return times[ends - 1], (sums[ends] - sums[starts]) / (ends - starts)[:, None]


def nearest_samples(times: Int64Array, values: Float64Array) -> tuple[Int64Array, Float64Array]:
    """Return the samples nearest to a grid of GAME periods."""
    grid = np.arange(times[0], times[-1], GAME_NS)
    after = np.clip(np.searchsorted(times, grid), 1, len(times) - 1)
    rows = np.unique(np.where(grid - times[after - 1] <= times[after] - grid, after - 1, after))
    return times[rows], values[rows]


def game_rate(trial: Path) -> FlatEvents:
    """Return a trial's own calibrated streams as GAME mode would deliver them."""
    columns = [
        (SensorType.ACCELEROMETER, nearest_samples(*stream(trial / "accelerometer.txt.gz"))),
        (SensorType.GYROSCOPE, interval_means(*stream(trial / "gyroscope-calibrated.txt.gz"))),
        (SensorType.MAGNETIC_FIELD, stream(trial / "magnetometer-calibrated.txt.gz")),
    ]
    times = np.concatenate([column[0] for _, column in columns])
    order = np.argsort(times, kind="stable")
    types = np.concatenate([np.full(len(column[0]), kind, np.int64) for kind, column in columns])
    return FlatEvents(types[order], times[order], np.concatenate([column[1] for _, column in columns])[order])


def optical_truth(trial: Path, excluded_s: str) -> tuple[Int64Array, Float64Array]:
    """Return Android times (ns) and quaternions against magnetic north, NaN where lost or excluded."""
    loadmat = pytest.importorskip("scipy.io").loadmat
    rotation = pytest.importorskip("scipy.spatial.transform").Rotation
    contents = loadmat(trial / "qualisys.mat", simplify_cells=True)
    recording = next(value for name, value in contents.items() if not name.startswith("__"))
    matrices = np.asarray(recording["RigidBodies"]["Rotations"]).reshape(9, -1).T.reshape(-1, 3, 3).transpose(0, 2, 1)
    seconds = np.arange(len(matrices)) / float(recording["FrameRate"])
    known = np.isfinite(matrices).all(axis=(1, 2))
    for span in excluded_s.split():
        start, end = map(float, span.split("-"))
        known &= (seconds < start) | (seconds > end)
    quaternions = np.full((len(matrices), 4), np.nan)
    quaternions[known] = to_magnetic_north(rotation.from_matrix(matrices[known]).as_quat(), DECLINATION)
    offset = float((trial / "timeAlignment.txt").read_text().split()[0])
    return np.round((seconds - offset) * 1e9).astype(np.int64), quaternions


def test_phone_trials_at_game(data_dir: Path) -> None:
    folder = data_dir / "smartphone-attitude"
    at_gyro, at_10_hz = [], []
    with (folder / "trials.csv").open() as table:
        for row in csv.DictReader(table):
            events = game_rate(folder / "trials" / row["trial"])
            truth = optical_truth(folder / "trials" / row["trial"], row["excluded_s"])
            dcm = DcmFilter()
            times, quaternions, fed = [], [], 0
            for end in np.flatnonzero(events.sensor_type == SensorType.GYROSCOPE) + 1:
                dcm.update_batch(events[fed:end])
                fed = end
                answer = dcm.orientation()
                if answer is not None:
                    times.append(answer.timestamp_ns)
                    quaternions.append(answer.quaternion)
            poses = np.array(quaternions)
            error = total_error(poses, nearest_truth(np.array(times), *truth, max_gap_ns=30_000_000))
            at_gyro.append(rmse(error, np.isfinite(error)))
            grid = np.arange(times[0], times[-1], POSE_NS)
            newest = np.searchsorted(times, grid, "right") - 1
            error = total_error(poses[newest], nearest_truth(grid, *truth, max_gap_ns=30_000_000))
            at_10_hz.append(rmse(error, np.isfinite(error)))
    assert len(at_gyro) == 14
    assert np.degrees(np.mean(at_gyro)) <= 6.8
    assert np.degrees(np.mean(at_10_hz)) <= 7.1
