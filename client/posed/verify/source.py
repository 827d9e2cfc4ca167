"""What the suite needs of what it judges: the SDK's calls, and a clock to wait by."""

import time
from collections.abc import Callable
from typing import Protocol

from posed.client.sensor import Sensor, SensorEventListener, TriggerEventListener


class EventSource(Protocol):
    """The part of SensorManager that is judged; anything else with these calls can be judged too."""

    def get_sensor_list(self) -> list[Sensor]:
        """Return the sensors."""

    def register_listener(
        self,
        listener: SensorEventListener | None,
        sensor: Sensor | None,
        sampling_period_us: int,
        max_report_latency_us: int = 0,
    ) -> bool:
        """Begin events of a sensor."""

    def unregister_listener(self, listener: SensorEventListener | None, sensor: Sensor | None = None) -> None:
        """End events of one sensor, or of all."""

    def flush(self, listener: SensorEventListener | None) -> bool:
        """Ask for on_flush_completed once for each sensor of the listener."""

    def request_trigger_sensor(self, listener: TriggerEventListener | None, sensor: Sensor | None) -> bool:
        """Begin to wait for a one-shot sensor."""

    def cancel_trigger_sensor(self, listener: TriggerEventListener | None, sensor: Sensor | None = None) -> bool:
        """End waiting for a one-shot sensor."""


class SuiteClock(Protocol):
    """The clock that the timestamps are on."""

    def now_ns(self) -> int:
        """Return the present instant, ns."""

    def wait(self, timeout_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time pass until something holds, `timeout_s` at most, and return whether it does."""


class BootClock:
    """CLOCK_BOOTTIME, as Android's events are on."""

    def now_ns(self) -> int:
        """Return the present instant, ns."""
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)

    def wait(self, timeout_s: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time pass, looking every 10 ms."""
        deadline = time.monotonic() + timeout_s
        while not until():
            remaining = deadline - time.monotonic()
            if remaining <= 0:
                return False
            time.sleep(min(0.01, remaining))
        return True
