"""The client processes of a measurement: `python -m posed.cli.profiling.workload pose|raw PERIOD [LATENCY]`.

Each says "begin" on stdout once it gets what it asked for, works until its stdin ends, and then says what it got as
one line of JSON. The end of stdin also ends it when whoever started it has died.
"""

import json
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

from posed.cli.connection import PACKAGE
from posed.client import PoseClient, Sensor, SensorEvent, SensorManager
from posed.errors import ServiceUnavailableError

_INPUTS = (Sensor.TYPE_ACCELEROMETER, Sensor.TYPE_GYROSCOPE, Sensor.TYPE_MAGNETIC_FIELD)
# The filter's start is no part of what a mode costs.
_WARM_UP_POSES = 5


def main() -> int:
    """Run the client that the command line names."""
    kind, period_us, *rest = sys.argv[1:]
    result = pose(int(period_us)) if kind == "pose" else raw(int(period_us), int(rest[0]))
    print(json.dumps(result), flush=True)
    return 0


def pose(rate_mode: int) -> dict[str, Any]:
    """Take poses at 10 Hz; return their count, their events in all and the rate modes that were in force."""
    poses = events = 0
    modes = set()
    with PoseClient(rate_mode) as client:
        for _ in range(_WARM_UP_POSES):
            client.next_pose()
        begin(client.close)
        for pose in client:
            poses += 1
            events += pose.events_fused
            modes.add(pose.rate_mode)
    return {"poses": poses, "events": events, "modes": sorted(modes)}


def raw(rate_mode: int, max_report_latency_us: int) -> dict[str, Any]:
    """Listen to the pose's input sensors; return count, first and last timestamp (ns) of each one's events."""
    counter = _Counter()
    ended = threading.Event()
    with SensorManager(package=PACKAGE) as manager:
        manager.wait_connected()
        for sensor_type in _INPUTS:
            sensor = manager.get_default_sensor(sensor_type)
            if not manager.register_listener(counter, sensor, rate_mode, max_report_latency_us):
                raise ServiceUnavailableError(f"cannot listen to the sensor of type {sensor_type}")
        counter.all_seen.wait()
        begin(ended.set)
        ended.wait()
    return {"sensors": counter.seen}


def begin(on_end: Callable[[], None]) -> None:
    """Say that the work begins; on_end is called, on another thread, when stdin ends."""

    def await_end() -> None:
        os.read(0, 1)
        on_end()

    threading.Thread(target=await_end, daemon=True).start()
    print("begin", flush=True)


class _Counter:
    def __init__(self) -> None:
        self.seen: dict[str, list[int]] = {}
        self.all_seen = threading.Event()

    def on_sensor_changed(self, event: SensorEvent) -> None:
        seen = self.seen.get(event.sensor.string_type)
        if seen is None:
            self.seen[event.sensor.string_type] = [1, event.timestamp, event.timestamp]
            if len(self.seen) == len(_INPUTS):
                self.all_seen.set()
        else:
            seen[0] += 1
            seen[2] = event.timestamp


if __name__ == "__main__":
    sys.exit(main())
