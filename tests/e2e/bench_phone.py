"""A daemon over a simulated phone with a few parts more: python bench_phone.py PROFILE

It has a light sensor (on-change, another value every 100 ms), two proximity sensors, of which one wakes the phone, a
motion detector (one-shot, fires 100 ms after it is activated) and a significant motion sensor that never fires. While
a file "lost" is in the runtime directory the phone is gone; while "dynamic" is there, so is a clip-on light.
"""

import logging
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from posed.clock import Clock
from posed.daemon import DaemonConfig, loop, run
from posed.errors import InvalidArgumentError, SourceLostError
from posed.events import EventBatch, EventColumn, ReportingMode, SensorInfo, SensorType
from posed.hal import open_source
from posed.hal.profile import DeviceProfile

_STEP_NS = 100_000_000
MOTION, CLIP_ON = int(SensorType.MOTION_DETECT), 5000


def _part(kind: SensorType, mode: ReportingMode, **others: Any) -> SensorInfo:
    facts: dict[str, Any] = {
        "handle": int(kind),
        "name": kind.name,
        "min_delay_us": -1 if mode is ReportingMode.ONE_SHOT else 0,
        "max_delay_us": 0,
        **others,
    }
    return SensorInfo(
        type=kind,
        vendor="bench",
        version=1,
        max_range=10_000.0,
        resolution=1.0,
        power_ma=0.1,
        reporting_mode=mode,
        **facts,
    )


_PARTS = {
    part.handle: part
    for part in (
        _part(SensorType.LIGHT, ReportingMode.ON_CHANGE),
        _part(SensorType.PROXIMITY, ReportingMode.ON_CHANGE, name="Proximity"),
        _part(SensorType.PROXIMITY, ReportingMode.ON_CHANGE, handle=1008, name="Proximity Wakeup", wake_up=True),
        _part(SensorType.MOTION_DETECT, ReportingMode.ONE_SHOT),
        _part(SensorType.SIGNIFICANT_MOTION, ReportingMode.ONE_SHOT, wake_up=True),
    )
}
_CLIP_ON = _part(
    SensorType.LIGHT, ReportingMode.CONTINUOUS, handle=CLIP_ON, name="Clip-on", is_dynamic=True, min_delay_us=10_000
)


class BenchPhone:
    """A SensorSource: the simulated phone for what it has, and the parts above."""

    def __init__(self, profile: DeviceProfile, clock: Clock, directory: Path) -> None:
        self._make = lambda: open_source("sim:still", profile, clock)
        self._phone = self._make()
        self._clock = clock
        self._directory = directory
        self._since: dict[int, int] = {}
        self._flushes: list[int] = []
        self._has_clip_on = False
        self.sensors = (*self._phone.sensors, *_PARTS.values())
        self.time_map = self._phone.time_map
        self.end_ns = None

    def activate(self, handle: int, enabled: bool) -> None:
        self._require_phone()
        if not self._is_part(handle):
            self._phone.activate(handle, enabled)
        elif not enabled:
            self._since.pop(handle, None)
        else:
            self._since.setdefault(handle, self._clock.now_ns())

    def batch(self, handle: int, sampling_period_ns: int, max_report_latency_ns: int) -> int:
        self._require_phone()
        if self._is_part(handle):
            return sampling_period_ns
        return self._phone.batch(handle, sampling_period_ns, max_report_latency_ns)

    def flush(self, handle: int) -> None:
        self._require_phone()
        if not self._is_part(handle):
            self._phone.flush(handle)
        elif handle in self._since:
            self._flushes.append(handle)
        else:
            raise InvalidArgumentError(f"{handle} is not active")

    def drain(self, until_ns: int) -> EventBatch:
        self._require_phone()
        batch = self._phone.drain(until_ns)
        columns = dict(batch.columns)
        for handle, since_ns in list(self._since.items()):
            times = self._times(handle, since_ns, until_ns)
            if times:
                columns[handle] = EventColumn(
                    np.array(times, np.int64),
                    np.array([[float(100 + t // _STEP_NS % 100)] for t in times]),
                    np.full(len(times), 3, np.int8),
                )
                self._since[handle] = until_ns
                if handle == MOTION:
                    del self._since[handle]
        flushes, self._flushes = self._flushes, []
        has_clip_on = (self._directory / "dynamic").exists()
        connected = (_CLIP_ON,) if has_clip_on and not self._has_clip_on else ()
        disconnected = (CLIP_ON,) if self._has_clip_on and not has_clip_on else ()
        self._has_clip_on = has_clip_on
        return EventBatch(columns, (*batch.flush_completes, *flushes), connected, disconnected)

    def resume(self) -> None:
        self._phone.resume()

    def prepare(self) -> None:
        pass

    def set_environment(self, kind: SensorType, value: float) -> None:
        raise InvalidArgumentError("nothing to set")

    def next_sample_ns(self, handle: int) -> int | None:
        self._require_phone()
        if not self._is_part(handle):
            return self._phone.next_sample_ns(handle)
        if handle not in self._since or handle == SensorType.SIGNIFICANT_MOTION:
            return None
        return self._since[handle] + _STEP_NS

    def truth(self, timestamp_ns: int) -> None:
        return None

    def _is_part(self, handle: int) -> bool:
        return handle in _PARTS or handle == CLIP_ON

    def _times(self, handle: int, since_ns: int, until_ns: int) -> list[int]:
        if handle == SensorType.SIGNIFICANT_MOTION:
            return []
        return list(range(since_ns + _STEP_NS, until_ns + 1, _STEP_NS))

    def _require_phone(self) -> None:
        if (self._directory / "lost").exists():
            self._phone = self._make()
            self._since.clear()
            self._has_clip_on = False
            raise SourceLostError("the phone is gone")


def main() -> None:
    logging.basicConfig(level=logging.WARNING)
    directory = Path(os.environ["XDG_RUNTIME_DIR"])

    def open_bench_phone(_spec: str, profile: DeviceProfile, clock: Clock, **_: Any) -> BenchPhone:
        return BenchPhone(profile, clock, directory)

    loop.open_source = open_bench_phone  # type: ignore[assignment]
    run(DaemonConfig(profile=sys.argv[1]))


if __name__ == "__main__":
    main()
