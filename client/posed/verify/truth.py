"""MeanVerification, GyroscopeIntegrationVerification and CtsVerifier's RVCV: sensors against how the phone was held.

Android has its user lay a phone down, turn it once about an axis, or film a pattern. Here a truth stream tells.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from posed.client.sensor import Sensor
from posed.verify.collector import Collector
from posed.verify.finding import Finding, judged, skipped
from posed.verify.source import EventSource, SuiteClock

MEAN, GYROSCOPE_INTEGRATION, ROTATION_VECTOR = "Mean", "GyroscopeIntegration", "RotationVector"
_GRAVITY = 9.80665
_MEAN_LIMIT = 1.95
_TURN_LIMIT_DEG = 10.0
_LEAST_TURN_DEG = 90.0
_HORIZONTAL_LIMITS = (0.15, 0.30)
_VERTICAL_LIMITS = (0.25, 0.45)
_LEAST_VALID = 0.8
_LONGEST_STEP_NS = 100_000_000

Quaternion = tuple[float, float, float, float]


class Attitude(NamedTuple):
    """How the phone was held: sample time (ns), and (x, y, z, w) from device to world (east, magnetic north, up)."""

    timestamp_ns: int
    quaternion: Quaternion


TruthStream = Callable[[Callable[[Attitude], None]], AbstractContextManager[object]]
"""Hands attitudes over, 20 a second at least, in time order, while it is entered."""


@dataclass(frozen=True)
class Held:
    """Attitudes in time order, looked up between two of them."""

    attitudes: Sequence[Attitude]

    def at(self, timestamp_ns: int) -> Quaternion | None:
        """Return the attitude then, None where no two that are less than 0.1 s apart stand about it."""
        after = bisect_right(self.attitudes, timestamp_ns, key=lambda each: each.timestamp_ns)
        if not 0 < after < len(self.attitudes):
            return None
        (left_ns, left), (right_ns, right) = self.attitudes[after - 1], self.attitudes[after]
        if right_ns - left_ns > _LONGEST_STEP_NS:
            return None
        share = (timestamp_ns - left_ns) / (right_ns - left_ns)
        return _product(left, _rotation([share * angle for angle in _rotation_vector(_product(_inverse(left), right))]))


def run_against_truth(
    source: EventSource, clock: SuiteClock, sensors: Sequence[Sensor], listen: TruthStream, seconds: float
) -> list[Finding]:
    """Record accelerometer, gyroscope and rotation vector at their fastest beside the truth, and judge each."""
    judges = {
        Sensor.TYPE_ACCELEROMETER: verify_mean,
        Sensor.TYPE_GYROSCOPE: verify_gyroscope_integration,
        Sensor.TYPE_ROTATION_VECTOR: verify_rotation_vector,
    }
    attitudes: list[Attitude] = []
    collectors = {sensor: Collector(clock) for sensor in sensors if sensor.type in judges}
    with listen(attitudes.append):
        for sensor, collector in collectors.items():
            source.register_listener(collector, sensor, 0)
        clock.wait(seconds)
        for collector in collectors.values():
            source.unregister_listener(collector)
    held = Held(attitudes)
    return [judges[sensor.type](sensor, _events(sensor, each), held) for sensor, each in collectors.items()]


Event = tuple[int, Sequence[float]]
"""Sample time (ns) and values."""


def verify_mean(sensor: Sensor, events: Sequence[Event], held: Held) -> Finding:
    """Judge the mean of each axis of the accelerometer against gravity as the phone was held: 1.95 m/s2."""
    differences = [
        [value - _GRAVITY * up for value, up in zip(values, _up(attitude), strict=False)]
        for timestamp_ns, values in events
        if (attitude := held.at(timestamp_ns)) is not None
    ]
    if not differences:
        return _without_truth(MEAN, sensor)
    worst = max(abs(sum(axis)) / len(differences) for axis in zip(*differences, strict=True))
    return judged(
        MEAN, _subject(sensor), f"{worst:.3f} m/s2 from gravity", f"at most {_MEAN_LIMIT:g}", worst <= _MEAN_LIMIT
    )


def verify_gyroscope_integration(sensor: Sensor, events: Sequence[Event], held: Held) -> Finding:
    """Judge where the integrated gyroscope has come to from where the phone was at first: 10 degrees.

    Where Android has the phone turned by 360 degrees, a truth shows the turn of whatever motion; below 90 degrees in
    all there is nothing to judge.
    """
    known = [(timestamp_ns, values) for timestamp_ns, values in events if held.at(timestamp_ns) is not None]
    first = held.at(known[0][0]) if known else None
    last = held.at(known[-1][0]) if known else None
    if first is None or last is None:
        return _without_truth(GYROSCOPE_INTEGRATION, sensor)
    reached, turned = first, 0.0
    for (before_ns, _), (timestamp_ns, rate) in pairwise(known):
        angles = [1e-9 * (timestamp_ns - before_ns) * each for each in rate[:3]]
        reached = _product(reached, _rotation(angles))
        turned += math.degrees(math.hypot(*angles))
    if turned < _LEAST_TURN_DEG:
        return skipped(GYROSCOPE_INTEGRATION, _subject(sensor), f"the phone turned by {turned:.0f} degrees only")
    error = math.degrees(math.hypot(*_rotation_vector(_product(_inverse(last), reached))))
    return judged(
        GYROSCOPE_INTEGRATION,
        _subject(sensor),
        f"{error:.2f} deg off after {turned:.0f} deg",
        f"at most {_TURN_LIMIT_DEG:g} deg",
        error <= _TURN_LIMIT_DEG,
    )


def verify_rotation_vector(sensor: Sensor, events: Sequence[Event], held: Held) -> Finding:
    """Judge the rotation vector: about the horizontal 0.15 rad RMS and 0.30 at most, about the vertical 0.25 and 0.45.

    80 % of the events have to lie where the truth is known. The error is told in the world's axes, as roll and yaw of
    a phone held upright, with its camera to the horizon, are one and the same.
    """
    errors = [
        _rotation_vector(_product(_of_vector(values), _inverse(attitude)))
        for timestamp_ns, values in events
        if (attitude := held.at(timestamp_ns)) is not None
    ]
    inside = [each for each in events if held.attitudes[0][0] <= each[0] <= held.attitudes[-1][0]] if errors else []
    if not inside:
        return _without_truth(ROTATION_VECTOR, sensor)
    horizontal = [math.hypot(east, north) for east, north, _ in errors]
    vertical = [abs(up) for _, _, up in errors]
    measured = (_rms(horizontal), max(horizontal), _rms(vertical), max(vertical))
    limits = (*_HORIZONTAL_LIMITS, *_VERTICAL_LIMITS)
    valid = len(errors) / len(inside)
    return judged(
        ROTATION_VECTOR,
        _subject(sensor),
        "tilt {:.3f}, {:.3f}; heading {:.3f}, {:.3f} rad".format(*measured),
        "{:.2f}, {:.2f}; {:.2f}, {:.2f} rad (RMS, largest)".format(*limits),
        all(one < limit for one, limit in zip(measured, limits, strict=True)) and valid >= _LEAST_VALID,
        "" if valid >= _LEAST_VALID else f"truth beside {100 * valid:.0f} % of the events only",
    )


def _events(sensor: Sensor, collector: Collector) -> list[Event]:
    own = (each.event for each in collector.received if each.event.sensor == sensor)
    return sorted((event.timestamp, event.values) for event in own)


def _subject(sensor: Sensor) -> str:
    return sensor.string_type.removeprefix("android.sensor.")


def _without_truth(verification: str, sensor: Sensor) -> Finding:
    return skipped(verification, _subject(sensor), "no truth beside its events")


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(value * value for value in values) / len(values))


def _of_vector(values: Sequence[float]) -> Quaternion:
    x, y, z = values[:3]
    w = values[3] if len(values) > 3 else math.sqrt(max(0.0, 1.0 - x * x - y * y - z * z))
    return x, y, z, w


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _inverse(q: Quaternion) -> Quaternion:
    x, y, z, w = q
    return -x, -y, -z, w


def _rotation(vector: Sequence[float]) -> Quaternion:
    angle = math.hypot(*vector)
    scale = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    x, y, z = vector
    return scale * x, scale * y, scale * z, math.cos(angle / 2)


def _rotation_vector(q: Quaternion) -> tuple[float, float, float]:
    """Return axis times angle (rad), the shorter way round."""
    x, y, z, w = q if q[3] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
    sine = math.hypot(x, y, z)
    scale = 2.0 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    return scale * x, scale * y, scale * z


def _up(q: Quaternion) -> tuple[float, float, float]:
    """Return the world's vertical in device axes."""
    x, y, z, w = q
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
