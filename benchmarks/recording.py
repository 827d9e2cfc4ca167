"""A recording to replay: the simulated phone's, every sensor as fast as it goes."""

from pathlib import Path

from posed.clock import VirtualClock
from posed.events import SensorType
from posed.hal import open_source
from posed.hal.profile import load_profile

_SENSORS = (SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD)


def write_recording(path: Path, seconds: float) -> int:
    """Write `seconds` of 100, 200 and 50 Hz as CSV; return the timestamp of the first sample, ns."""
    clock = VirtualClock()
    source = open_source("sim", load_profile("patonis2018"), clock)
    names = {sensor.handle: sensor.type.name.lower() for sensor in source.sensors if sensor.type in _SENSORS}
    for handle in names:
        source.batch(handle, 0, 0)
        source.activate(handle, True)
    batch = source.drain(round(seconds * 1e9))
    rows = [
        (int(timestamp_ns), names[handle], values)
        for handle, column in batch.columns.items()
        for timestamp_ns, values in zip(column.timestamp_ns, column.values.tolist(), strict=True)
    ]
    rows.sort()
    lines = (f"{name},{at_ns},{','.join(map(repr, values))}\n" for at_ns, name, values in rows)
    path.write_text("sensor,timestamp_ns,x,y,z\n" + "".join(lines))
    return rows[0][0]
