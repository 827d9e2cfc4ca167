"""Measurements that wait for the gyroscope sample that covers them."""

from array import array

from posed.events import FlatEvent

MAX_HELD = 1024
"""Half a second at 2 kHz. A source that stamps every sample alike would fill the memory."""


class HeldEvents:
    """Accelerometer and magnetometer events in the order they came: columns, which compiled code walks without objects.

    `count` of them, at most MAX_HELD. Whoever reads row k of the columns sees that k < count.
    """

    def __init__(self) -> None:
        self.count = 0
        self.sensor_type = array("q", bytes(8 * MAX_HELD))
        self.timestamp_ns = array("q", bytes(8 * MAX_HELD))
        self.x = array("d", bytes(8 * MAX_HELD))
        self.y = array("d", bytes(8 * MAX_HELD))
        self.z = array("d", bytes(8 * MAX_HELD))

    def add(self, sensor_type: int, timestamp_ns: int, x: float, y: float, z: float) -> None:
        """Append an event; the caller sees that there is room."""
        k = self.count
        self.sensor_type[k] = sensor_type
        self.timestamp_ns[k] = timestamp_ns
        self.x[k] = x
        self.y[k] = y
        self.z[k] = z
        self.count = k + 1

    def events(self) -> list[FlatEvent]:
        """Return the events, oldest first."""
        return [(self.sensor_type[k], self.timestamp_ns[k], self.x[k], self.y[k], self.z[k]) for k in range(self.count)]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, HeldEvents) and self.events() == other.events()

    def __repr__(self) -> str:
        return f"HeldEvents({self.events()})"
