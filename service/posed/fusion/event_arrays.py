"""Events as columns, which compiled code walks without an object an event: those of a recording, and those that wait.

A tuple of five numbers costs a filter as much to take apart as half of what it does with them.
"""

from array import array
from collections.abc import Iterator

import numpy as np

from posed.errors import InvalidArgumentError
from posed.events import FlatEvent, Float64Array, Int64Array

MAX_HELD = 1024
"""Half a second at 2 kHz. A source that stamps every sample alike would fill the memory."""


class EventArrays:
    """Three-axis events in the order filters take them, for work on recordings: `update_batch` is fastest over these.

    Iterates as FlatEvent. The live service has a few dozen events at a time, for which lists are cheaper.
    """

    def __init__(self, sensor_type: Int64Array, timestamp_ns: Int64Array, values: Float64Array) -> None:
        """Take int64[n] sensor types, int64[n] sample times (ns) and float64[n, 3] values (m/s2, rad/s or uT).

        Raises InvalidArgumentError where the lengths differ.
        """
        self.count = len(timestamp_ns)
        if sensor_type.shape != (self.count,) or values.shape != (self.count, 3):
            raise InvalidArgumentError(
                f"events of shapes {sensor_type.shape}, {timestamp_ns.shape} and {values.shape}; give n, n and (n, 3)"
            )
        self._given = (sensor_type, timestamp_ns, values)
        # As memoryviews, so that the interpreter too gets plain numbers out of them.
        self.sensor_type = np.ascontiguousarray(sensor_type, np.int64).data
        self.timestamp_ns = np.ascontiguousarray(timestamp_ns, np.int64).data
        self.x = np.ascontiguousarray(values[:, 0], np.float64).data
        self.y = np.ascontiguousarray(values[:, 1], np.float64).data
        self.z = np.ascontiguousarray(values[:, 2], np.float64).data

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, rows: slice) -> "EventArrays":
        sensor_type, timestamp_ns, values = self._given
        return EventArrays(sensor_type[rows], timestamp_ns[rows], values[rows])

    def __iter__(self) -> Iterator[FlatEvent]:
        sensor_type, timestamp_ns, values = self._given
        return zip(sensor_type.tolist(), timestamp_ns.tolist(), *values.T.tolist(), strict=True)


class HeldEvents:
    """Accelerometer and magnetometer events, in the order they came, that wait for the gyroscope.

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
