"""Clients that count what they receive: python counting_clients.py NUMBER...

Each listens to one sensor at a rate, a latency and with or without decimation by its number; numbers 1 and 25 to all
there are, each event as it happens. The process says "ready", and for each line on stdin what its clients have got, as
one line of JSON.
"""

import json
import sys

from posed.client import (
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    SENSOR_DELAY_UI,
    Package,
    Sensor,
    SensorEvent,
    SensorManager,
)

_RATES = (SENSOR_DELAY_FASTEST, SENSOR_DELAY_GAME, SENSOR_DELAY_UI, SENSOR_DELAY_NORMAL, 100_000)
_LATENCIES_US = (0, 0, 50_000, 500_000)
_EVERYTHING = (1, 25)


class CountingClient:
    """One client with a binding of its own."""

    def __init__(self, number: int) -> None:
        self.name = f"com.example.client{number:02d}"
        self.times: dict[int, list[int]] = {}
        self.manager = SensorManager(package=Package(self.name))
        listed = self.manager.get_sensor_list()
        sensors = [each for each in listed if each.reporting_mode == Sensor.REPORTING_MODE_CONTINUOUS]
        if number not in _EVERYTHING:
            sensors = [sensors[number % len(sensors)]]
        for sensor in sensors:
            if not self.manager.register_listener(
                self,
                sensor,
                _RATES[number % len(_RATES)],
                _LATENCIES_US[number % len(_LATENCIES_US)],
                decimate=number % 7 == 3,
            ):
                raise SystemExit(f"client {number} was refused")

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.times.setdefault(event.sensor.handle, []).append(event.timestamp)

    def report(self) -> dict[str, object]:
        return {"times": self.times, "dropped": self.manager.get_events_dropped(self)}


def main() -> None:
    clients = [CountingClient(int(number)) for number in sys.argv[1:]]
    print("ready", flush=True)
    for _ in sys.stdin:
        print(json.dumps({client.name: client.report() for client in clients}), flush=True)
    for client in clients:
        client.manager.close()


if __name__ == "__main__":
    main()
