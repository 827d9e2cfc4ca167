"""SensorTest and SensorParameterRangeTest: the sensor list is one Android would accept."""

from posed.client.sensor import Sensor
from posed.verify.finding import Finding, judged

NAME = "SensorList"
_LONGEST_MIN_DELAY_US = {
    Sensor.TYPE_ACCELEROMETER: 20_000,
    Sensor.TYPE_GYROSCOPE: 20_000,
    Sensor.TYPE_MAGNETIC_FIELD: 100_000,
}
"""CTS asks accelerometer and gyroscope of a phone for 100 Hz; the compatibility definition's 50 Hz is the bound here,
as CTS has it for watches."""


def verify_sensor_list(sensors: list[Sensor]) -> list[Finding]:
    """Judge each sensor's description, and that names are unique within a type."""
    findings = [_judge(sensor) for sensor in sensors]
    names = [(sensor.type, sensor.name) for sensor in sensors]
    twice = len(names) - len(set(names))
    return [*findings, judged(NAME, "all", f"{twice} names used twice within a type", "0", twice == 0)]


def _judge(sensor: Sensor) -> Finding:
    wrong = [what for what, holds in _conditions(sensor).items() if not holds]
    subject = sensor.string_type.removeprefix("android.sensor.")
    return judged(NAME, subject, ", ".join(wrong) or "as described", "as Android describes sensors", not wrong)


def _conditions(sensor: Sensor) -> dict[str, bool]:
    mode = sensor.reporting_mode
    min_delay = sensor.min_delay
    if mode == Sensor.REPORTING_MODE_CONTINUOUS:
        delay_fits = min_delay > 0
    else:
        delay_fits = min_delay == (-1 if mode == Sensor.REPORTING_MODE_ONE_SHOT else 0) or (
            mode == Sensor.REPORTING_MODE_ON_CHANGE and min_delay > 0
        )
    return {
        f"type {sensor.string_type!r}": sensor.string_type.startswith("android.sensor."),
        f"range {sensor.maximum_range}": sensor.maximum_range >= 0,
        f"power {sensor.power}": sensor.power >= 0,
        f"resolution {sensor.resolution}": sensor.resolution > 0,
        "no vendor": bool(sensor.vendor),
        "no name": bool(sensor.name),
        f"version {sensor.version}": sensor.version > 0,
        f"FIFO {sensor.fifo_reserved_event_count} of {sensor.fifo_max_event_count}": 0
        <= sensor.fifo_reserved_event_count
        <= sensor.fifo_max_event_count,
        f"minDelay {min_delay}": delay_fits and min_delay <= _LONGEST_MIN_DELAY_US.get(sensor.type, min_delay),
        f"maxDelay {sensor.max_delay}": sensor.max_delay == 0 or sensor.max_delay >= min_delay,
    }
