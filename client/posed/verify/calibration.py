"""CalibratedAndUncalibratedSensorPair: a sensor and its uncalibrated stream differ by the bias that is told."""

from bisect import bisect_left

from posed.client.sensor import Sensor
from posed.verify.finding import Finding, judged, skipped
from posed.verify.recording import Recording

NAME = "CalibratedUncalibrated"
UNCALIBRATED = {
    Sensor.TYPE_GYROSCOPE: Sensor.TYPE_GYROSCOPE_UNCALIBRATED,
    Sensor.TYPE_MAGNETIC_FIELD: Sensor.TYPE_MAGNETIC_FIELD_UNCALIBRATED,
}
_LIMITS = {Sensor.TYPE_GYROSCOPE: 0.01, Sensor.TYPE_MAGNETIC_FIELD: 3.0}


def verify_calibration(calibrated: Recording, uncalibrated: Recording) -> Finding:
    """Judge the mean of calibrated - (uncalibrated - bias) of an axis: gyroscope 0.01 rad/s, magnetometer 3 uT.

    Each calibrated event is compared with the uncalibrated one nearest in time.
    """
    others = sorted(
        (each.event.timestamp, each.event.values)
        for each in uncalibrated.received
        if each.event.sensor == uncalibrated.sensor and len(each.event.values) >= 6
    )
    events = [each.event for each in calibrated.received if each.event.sensor == calibrated.sensor]
    if not others or not events:
        return skipped(NAME, calibrated.subject, "no events of both")
    sums = [0.0, 0.0, 0.0]
    for event in events:
        at = bisect_left(others, (event.timestamp,))
        nearest = min(others[max(0, at - 1) : at + 1], key=lambda other: abs(other[0] - event.timestamp))[1]
        for axis in range(3):
            sums[axis] += event.values[axis] - (nearest[axis] - nearest[axis + 3])
    worst = max(abs(total) / len(events) for total in sums)
    limit = _LIMITS[calibrated.sensor.type]
    return judged(NAME, calibrated.subject, f"{worst:.4f}", f"at most {limit:g}", worst <= limit)
