"""Many clients at mixed rates: what the daemon says it sent, cached and dropped is what each of them received."""

import contextlib
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

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

Eventually = Callable[[Callable[[], object]], None]

_RATES = (SENSOR_DELAY_FASTEST, SENSOR_DELAY_GAME, SENSOR_DELAY_UI, SENSOR_DELAY_NORMAL, 100_000)
_KINDS = (Sensor.TYPE_ACCELEROMETER, Sensor.TYPE_MAGNETIC_FIELD, Sensor.TYPE_GYROSCOPE, Sensor.TYPE_GRAVITY)


class _Client:
    """One client with three or four sensors, which notes what it gets; a held one reads nothing until it is let go."""

    def __init__(self, number: int, held: bool = False) -> None:
        self.name = f"com.example.client{number:02d}"
        self.received: dict[int, list[int]] = {}
        self.count = 0
        self.let_go = threading.Event()
        if not held:
            self.let_go.set()
        self._number = number
        self.manager = SensorManager(package=Package(self.name))

    def register(self) -> None:
        latency_us = (0, 0, 50_000, 500_000)[self._number % 4]
        for kind in _KINDS[: 3 + self._number % 2]:
            sensor = self.manager.get_default_sensor(kind)
            rate = _RATES[self._number % len(_RATES)]
            decimate = self._number % 7 == 3
            assert self.manager.register_listener(self, sensor, rate, latency_us, decimate=decimate)

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.let_go.wait(30)
        self.received.setdefault(event.sensor.handle, []).append(event.timestamp)
        self.count += 1


def _recording(path: Path, seconds: int) -> Path:
    rows = ["sensor,timestamp_ns,x,y,z"]
    for k in range(seconds * 200):
        rows.append(f"gyroscope,{k * 5_000_000},0.01,0,0")
        if k % 2 == 0:
            rows.append(f"accelerometer,{k * 5_000_000 + 1_000_000},0,0,9.80665")
        if k % 4 == 0:
            rows.append(f"magnetic_field,{k * 5_000_000 + 2_000_000},0,25,-40")
    path.write_text("\n".join(rows) + "\n")
    return path


def _said_by_dumpsys(text: str) -> dict[str, tuple[int, ...]]:
    """Return (received, sent, cached, dropped) by package."""
    pattern = r"\t (com\.example\S+) \|.*\n(?:\t .* \| status: .*\n)+\t events recvd: (\d+) \| sent (\d+) \| cache (\d+) \| dropped (\d+)"
    return {name: tuple(map(int, counts)) for name, *counts in re.findall(pattern, text)}


def test_dumpsys_agrees_exactly_with_what_each_of_20_clients_received(
    desk: Any, tmp_path: Path, eventually: Eventually
) -> None:
    recording = _recording(tmp_path / "walk.csv", 60)
    desk.serve("--source", f"replay:{recording}", "--speed", "10")
    with contextlib.ExitStack() as stack:
        clients = [_Client(number, held=number == 5) for number in range(20)]
        for client in clients:
            stack.enter_context(client.manager)
        held = clients[5]
        for client in clients:
            client.register()
        asking = clients[0].manager

        def statistics() -> dict[str, Any]:
            return {listener.package_name: listener for listener in asking.get_statistics().listeners}

        eventually(lambda: statistics()[held.name].events_dropped > 0)
        held.let_go.set()
        eventually(lambda: asking.get_statistics().source_ended)
        eventually(
            lambda: all(
                (said := statistics()[client.name]).events_cached == 0 and said.events_sent == client.count
                for client in clients
            )
        )
        said = _said_by_dumpsys(desk.posed("dumpsys", "sensorservice").stdout)
        assert len(said) == 20
        for client in clients:
            dropped = client.manager.get_events_dropped(client)
            assert said[client.name] == (client.count + dropped, client.count, 0, dropped)
            for times in client.received.values():
                assert times == sorted(set(times))
        assert said[held.name][3] > 0
        assert sum(counts[3] > 0 for counts in said.values()) == 1
        # Of the sensors that another had before it, and has still, it misses what was dropped and nothing else.
        complete = clients[0]
        missed = 0
        for handle, times in held.received.items():
            there = [t for t in complete.received[handle] if t >= times[0]] if handle in complete.received else times
            missed += len(set(there) - set(times))
        fused = len(set(clients[1].received[9]) - set(held.received[9]))
        assert missed + len([t for t in clients[1].received[9] if t >= held.received[9][0]]) >= fused
        assert missed <= said[held.name][3]
