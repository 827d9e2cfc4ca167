"""A phone of which everything is known: attitude as a function of time, and what perfect sensors would read."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from posed.events import FlatEvent, Float64Array, Int64Array, SensorType
from posed.fusion.filter import OrientationFilter

GRAVITY = 9.80665
FIELD = np.array([0.0, 22.0, -42.0])
FASTEST = (100.0, 200.0, 50.0)
GAME = (50.0, 50.0, 50.0)
NORMAL = (15.0, 5.0, 5.0)

Attitude = Callable[[float], Float64Array]


@dataclass(frozen=True)
class FlatEvents:
    """Events in one order as arrays, int64[n], int64[n] and float64[n, 3], to be cut and changed."""

    sensor_type: Int64Array
    timestamp_ns: Int64Array
    values: Float64Array

    def __len__(self) -> int:
        return len(self.timestamp_ns)

    def __getitem__(self, rows: slice) -> "FlatEvents":
        return FlatEvents(self.sensor_type[rows], self.timestamp_ns[rows], self.values[rows])

    def __iter__(self) -> Iterator[FlatEvent]:
        rows = zip(self.sensor_type.tolist(), self.timestamp_ns.tolist(), self.values.tolist(), strict=True)
        return ((kind, timestamp_ns, x, y, z) for kind, timestamp_ns, (x, y, z) in rows)


def rotation(x: float, y: float, z: float) -> Float64Array:
    """Return the matrix of a rotation vector (rad)."""
    angle = float(np.sqrt(x * x + y * y + z * z))
    if angle == 0.0:
        return np.eye(3)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / angle
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def matrix(quaternion: tuple[float, float, float, float]) -> Float64Array:
    """Return the matrix of a unit quaternion (x, y, z, w)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_vector(m: Float64Array) -> Float64Array:
    """Return the rotation vector (rad) of a matrix that turns by less than pi."""
    axis = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    sine = float(np.linalg.norm(axis))
    angle = np.arctan2(sine, np.trace(m) - 1.0)
    return axis * (angle / sine if sine > 0.0 else 0.5)


def sense(
    attitude: Attitude,
    duration_s: float,
    rates: tuple[float, float, float] = FASTEST,
    *,
    start_ns: int = 0,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    field: Callable[[float], Float64Array] | None = None,
    noise: np.random.Generator | None = None,
) -> FlatEvents:
    """Return what the sensors read: rates of accelerometer, gyroscope, magnetometer in Hz, bias in rad/s.

    The gyroscope gives the mean rate since its previous sample. With `noise`, that of a BMI055 and an AK8963.
    """
    gyro_hz = rates[1]
    acc_s, gyro_s, mag_s = (np.arange(int(duration_s * hz) + 1) / hz for hz in rates)
    acc = np.array([attitude(t).T @ (0.0, 0.0, GRAVITY) for t in acc_s])
    mag = np.array([attitude(t).T @ (FIELD if field is None else field(t)) for t in mag_s])
    turns = [attitude(t - 1.0 / gyro_hz).T @ attitude(t) for t in gyro_s]
    gyro = np.array([rotation_vector(turn) * gyro_hz for turn in turns]) + bias
    if noise is not None:
        acc = acc + noise.normal(0.0, 0.034, acc.shape)
        gyro = gyro + noise.normal(0.0, np.radians(0.014) * np.sqrt(gyro_hz), gyro.shape)
        mag = mag + noise.normal(0.0, 1.2, mag.shape)
    kinds = (SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD)
    types = np.repeat(np.array(kinds, np.int64), [len(acc), len(gyro), len(mag)])
    times = np.round(np.concatenate([acc_s, gyro_s, mag_s]) * 1e9).astype(np.int64) + start_ns
    order = np.argsort(times, kind="stable")
    return FlatEvents(types[order], times[order], np.concatenate([acc, gyro, mag])[order])


def without(events: FlatEvents, sensor_type: SensorType, start_s: float, end_s: float) -> FlatEvents:
    """Return the events less those of one sensor in the seconds [start, end)."""
    t = (events.timestamp_ns - events.timestamp_ns[0]) * 1e-9
    keep = (events.sensor_type != sensor_type) | (t < start_s) | (t >= end_s)
    return FlatEvents(events.sensor_type[keep], events.timestamp_ns[keep], events.values[keep])


def between(events: FlatEvents, start_s: float, end_s: float) -> FlatEvents:
    """Return the events in the seconds [start, end) after the first."""
    t = (events.timestamp_ns - events.timestamp_ns[0]) * 1e-9
    keep = (t >= start_s) & (t < end_s)
    return FlatEvents(events.sensor_type[keep], events.timestamp_ns[keep], events.values[keep])


def error_deg(dcm: OrientationFilter, truth: Float64Array) -> float:
    """Return the angle between the filter's orientation and the true matrix, degrees."""
    answer = dcm.orientation()
    assert answer is not None
    return float(np.degrees(np.linalg.norm(rotation_vector(truth.T @ matrix(answer.quaternion)))))


def heading_deg(dcm: OrientationFilter) -> float:
    """Return the azimuth of the device's y axis, degrees clockwise from north."""
    answer = dcm.orientation()
    assert answer is not None
    m = matrix(answer.quaternion)
    return float(np.degrees(np.arctan2(m[0, 1], m[1, 1])))
