"""The last events of each sensor, for people and for those who join an on-change sensor (RecentEventLogger.cpp)."""

from collections import deque
from collections.abc import Iterator

from posed.events import EventColumn, SensorType

_SIZES = {
    SensorType.ACCELEROMETER: 50,
    SensorType.LIGHT: 50,
    SensorType.STEP_COUNTER: 50,
    SensorType.SIGNIFICANT_MOTION: 50,
    SensorType.PROXIMITY: 30,
}
_DEFAULT_SIZE = 10


class RecentEventLogger:
    """A ring of one sensor's last events, kept as the columns in which they came, each of one event at least."""

    def __init__(self, kind: SensorType) -> None:
        self._size = _SIZES.get(kind, _DEFAULT_SIZE)
        self._columns: deque[tuple[int, EventColumn]] = deque(maxlen=self._size)
        """When they were taken in, and the events."""
        self._last_is_current = False

    def add(self, column: EventColumn, boot_ns: int) -> None:
        """Note events, at least one, taken in at `boot_ns` (CLOCK_BOOTTIME)."""
        self._columns.append((boot_ns, column))
        self._last_is_current = True

    def set_last_event_stale(self) -> None:
        """Say that a new activation begins: what was seen before it is not its."""
        self._last_is_current = False

    @property
    def last_if_current(self) -> EventColumn | None:
        """The last event, None if it is not of this activation."""
        return self._columns[-1][1][-1:] if self._last_is_current else None

    def events(self) -> Iterator[tuple[int, int, list[float]]]:
        """Yield (sample time ns, CLOCK_BOOTTIME ns when it was taken in, values), oldest first."""
        skipped = sum(len(column) for _, column in self._columns) - self._size
        for boot_ns, column in self._columns:
            rows = column[max(0, skipped) :]
            skipped -= len(column)
            for timestamp_ns, values in zip(rows.timestamp_ns.tolist(), rows.values.tolist(), strict=True):
                yield timestamp_ns, boot_ns, values
