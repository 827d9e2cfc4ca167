"""Trials of which everything is known, as the files of each data set."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from posed.events import STANDARD_GRAVITY, Float64Array

FIELD = np.array([0.0, 22.0, -42.0])
_TILT = 0.5
DECLINATION = np.radians(1.75)


def heading(t: Float64Array) -> Float64Array:
    """Return how far the phone has turned to the left about the vertical at t seconds, rad."""
    return 0.8 * np.sin(1.5 * t)


def quaternion(t: Float64Array, turned: float = 0.0) -> Float64Array:
    """Return device to ENU, float64[n, 4] (x, y, z, w), turned further to the left by rad."""
    half = 0.5 * (heading(t) + turned)
    sine, cosine = np.sin(0.5 * _TILT), np.cos(0.5 * _TILT)
    return np.stack([np.cos(half) * sine, np.sin(half) * sine, np.sin(half) * cosine, np.cos(half) * cosine], axis=1)


def matrices(t: Float64Array, turned: float = 0.0) -> Float64Array:
    """Return the same as float64[n, 3, 3]."""
    x, y, z, w = quaternion(t, turned).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def sensed(t: Float64Array, dt: float) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return what accelerometer, gyroscope (mean over the last dt seconds) and magnetometer read, float64[n, 3]."""
    c = matrices(t)
    rate = (heading(t) - heading(t - dt)) / dt
    return STANDARD_GRAVITY * c[:, 2], rate[:, None] * c[:, 2], FIELD @ c


def write_csv_trial(path: Path, seconds: float = 12.0) -> Path:
    """Write 100 Hz of everything as CSV, with truth at 50 Hz from the second second on."""
    t = np.arange(int(seconds * 100)) / 100
    lines = ["sensor,timestamp_ns,x,y,z,w"]
    for name, values in zip(("accelerometer", "gyroscope", "magnetic_field"), sensed(t, 0.01), strict=True):
        lines += [f"{name},{int(s * 1e9)},{x},{y},{z}" for s, (x, y, z) in zip(t + 5.0, values, strict=True)]
    truth = quaternion(t)
    lines += [f"truth,{int((s + 5.0) * 1e9)},{','.join(map(str, q))}" for s, q in zip(t, truth, strict=True)][200::2]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_broad_trial(path: Path, seconds: float = 12.0, **changed: object) -> Path:
    """Write a MATLAB file as BROAD's, 100 Hz, with variables changed or, if None, left out."""
    t = np.arange(int(seconds * 100)) / 100
    acc, gyr, mag = sensed(t, 0.01)
    truth = quaternion(t)[:, [3, 0, 1, 2]]
    truth[300:310] = np.nan
    content: dict[str, object] = {
        "imu_gyr": gyr,
        "imu_acc": acc,
        "imu_mag": mag,
        "opt_quat": truth,
        "opt_pos": np.zeros((len(t), 3)),
        "sampling_rate": 100.0,
        "movement": (t > 4.0).astype(np.uint8),
    }
    content.update(changed)
    scipy_io = pytest.importorskip("scipy.io")
    scipy_io.savemat(path, {name: value for name, value in content.items() if value is not None})
    return path


def write_groups(folder: Path, **groups: list[str]) -> None:
    """Write trials.json."""
    (folder / "trials.json").write_text(json.dumps({"trials": {name: {"groups": of} for name, of in groups.items()}}))


HARD_IRON = np.array([60.0, -50.0, 400.0])
GYRO_BIAS = np.array([0.015, -0.005, 0.07])
ANDROID_OFF = 0.02
"""rad/s by which Android's own calibration of the gyroscope is wrong."""


def write_attitude_set(root: Path, names: list[str], *, compress: bool = True, excluded: str = "") -> Path:
    """Write trials of 12 s as the smartphone attitude data set has them, with trials.csv and one calibration day."""
    rows = ["trial,motion,magnetic_disturbance,excluded_s,calibration"]
    t = np.arange(1200) / 100
    acc, gyr, mag = sensed(t, 0.01)
    for name in names:
        folder = root / "trials" / name
        folder.mkdir(parents=True)
        _write(folder, "accelerometer.txt", t, acc, compress)
        _write(folder, "gyroscope.txt", t, np.hstack([gyr + GYRO_BIAS, 0 * gyr]), compress)
        _write(folder, "gyroscope-calibrated.txt", t, gyr + ANDROID_OFF, compress)
        _write(folder, "magnetometer.txt", t, np.hstack([mag + HARD_IRON, 0 * mag]), compress)
        _write(folder, "magnetometer-calibrated.txt", t, mag, compress)
        _write(folder, "rotation-vector.txt", t, np.hstack([quaternion(t), np.full((len(t), 1), 0.1)]), compress)
        (folder / "timeAlignment.txt").write_text("1.0\n")
        frames = np.arange(60 * 14) / 60 - 1.0
        # North of the truth is the true one, which is turned to the left of what the compass shows by the declination.
        rotations = matrices(frames, -DECLINATION).transpose(0, 2, 1).reshape(len(frames), 9).T
        body = {"Rotations": rotations, "Positions": np.zeros((3, len(frames)))}
        pytest.importorskip("scipy.io").savemat(
            folder / "qualisys.mat", {"trial": {"FrameRate": 60.0, "RigidBodies": body}}
        )
        rows.append(f"{name},ar,{str('_Dist_' in name).lower()},{excluded},d1")
    (root / "trials.csv").write_text("\n".join(rows) + "\n")
    write_calibration_day(root / "calibration" / "d1", compress)
    return root


def write_calibration_day(day: Path, compress: bool) -> None:
    """Write a turning about all axes, and a stillness with handling at its start."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(2000, 3))
    field = 47.0 * directions / np.linalg.norm(directions, axis=1, keepdims=True) + HARD_IRON
    still = np.tile(GYRO_BIAS, (2000, 1)) + rng.normal(0.0, 1e-3, (2000, 3))
    still[:150] += rng.normal(1.5, 0.5, (150, 3))
    t = np.arange(2000) / 100
    for folder, name, values in (("mag", "magnetometer.txt", field), ("gyr", "gyroscope.txt", still)):
        (day / folder).mkdir(parents=True)
        _write(day / folder, name, t, np.hstack([values, 0 * values]), compress)


def _write(folder: Path, name: str, t: Float64Array, values: Float64Array, compress: bool) -> None:
    text = "".join(f"{s:.9f} {' '.join(map(repr, row))}\n" for s, row in zip(t.tolist(), values.tolist(), strict=True))
    if compress:
        (folder / f"{name}.gz").write_bytes(gzip.compress(text.encode(), 1))
    else:
        (folder / name).write_text(text)
