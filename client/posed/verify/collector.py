"""A listener that notes what it gets, and when."""

from posed.client.sensor import Sensor, SensorEvent, TriggerEvent
from posed.verify.recording import Received
from posed.verify.source import SuiteClock


class Collector:
    """Notes events, flush-completes and triggers."""

    def __init__(self, clock: SuiteClock) -> None:
        self._clock = clock
        self.received: list[Received] = []
        self.flushed: list[Sensor] = []
        self.triggered: list[TriggerEvent] = []

    def on_sensor_changed(self, event: SensorEvent) -> None:
        """Note an event."""
        self.received.append(Received(event, self._clock.now_ns()))

    def on_flush_completed(self, sensor: Sensor) -> None:
        """Note a flush-complete."""
        self.flushed.append(sensor)

    def on_trigger(self, event: TriggerEvent) -> None:
        """Note a trigger."""
        self.triggered.append(event)
