"""MagnitudeVerification, StandardDeviationVerification and InitialValueVerification: values are those of the sensor."""

import math

from posed.client.sensor import Sensor
from posed.verify.finding import Finding, judged, skipped
from posed.verify.recording import Received, Recording

MAGNITUDE = "Magnitude"
STANDARD_DEVIATION = "StandardDeviation"
INITIAL_VALUE = "InitialValue"
_INITIAL_NS = 2_000_000_000
_PRESSURE_HPA = 3.0
_MAGNITUDES = {Sensor.TYPE_ACCELEROMETER: (9.80665, 1.5), Sensor.TYPE_GYROSCOPE: (0.0, 1.5)}
_DEVIATIONS = {Sensor.TYPE_ACCELEROMETER: 1.0, Sensor.TYPE_GYROSCOPE: 0.5}


def verify_magnitude(recording: Recording) -> Finding | None:
    """Judge the mean length of the vectors: accelerometer 9.80665 +- 1.5 m/s2, gyroscope 0 +- 1.5 rad/s."""
    if recording.sensor.type not in _MAGNITUDES or not recording.received:
        return None
    expected, tolerance = _MAGNITUDES[recording.sensor.type]
    lengths = [math.hypot(*each.event.values[:3]) for each in _own(recording)]
    mean = sum(lengths) / max(1, len(lengths))
    return judged(
        MAGNITUDE, recording.subject, f"{mean:.3f}", f"{expected:g} +- {tolerance:g}", abs(mean - expected) <= tolerance
    )


def verify_standard_deviation(recording: Recording) -> Finding | None:
    """Judge the largest deviation of an axis, of a phone at rest: accelerometer 1.0 m/s2, gyroscope 0.5 rad/s."""
    if recording.sensor.type not in _DEVIATIONS or not recording.received:
        return None
    limit = _DEVIATIONS[recording.sensor.type]
    worst = max(_deviation([each.event.values[axis] for each in _own(recording)]) for axis in range(3))
    return judged(STANDARD_DEVIATION, recording.subject, f"{worst:.4f}", f"at most {limit:g}", worst <= limit)


def verify_initial_value(recording: Recording) -> Finding | None:
    """Judge the mean of the first 2 s against that of the rest: pressure 3 hPa; Android bounds no other sensor."""
    if recording.sensor.type != Sensor.TYPE_PRESSURE:
        return None
    own = [each.event for each in _own(recording)]
    begun_ns = min((event.timestamp for event in own), default=0)
    first = [event.values[0] for event in own if event.timestamp - begun_ns <= _INITIAL_NS]
    rest = [event.values[0] for event in own if event.timestamp - begun_ns > _INITIAL_NS]
    if not first or not rest:
        return skipped(INITIAL_VALUE, recording.subject, "too short for a beginning and a rest")
    off = abs(sum(first) / len(first) - sum(rest) / len(rest))
    return judged(
        INITIAL_VALUE, recording.subject, f"{off:.3f} hPa", f"at most {_PRESSURE_HPA:g}", off <= _PRESSURE_HPA
    )


def _own(recording: Recording) -> list[Received]:
    return [each for each in recording.received if each.event.sensor == recording.sensor]


def _deviation(values: list[float]) -> float:
    mean = sum(values) / max(1, len(values))
    return math.sqrt(sum((value - mean) ** 2 for value in values) / max(1, len(values) - 1))
