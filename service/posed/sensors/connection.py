"""One listener's events on their way out: bounded, oldest dropped first and counted (SensorEventConnection.cpp)."""

from collections import deque
from dataclasses import dataclass

from posed.events import EventColumn


@dataclass(frozen=True, slots=True)
class EventChunk:
    """What fits one message: columns by handle, then the flushes completed behind them."""

    columns: dict[int, EventColumn]
    flush_completes: tuple[int, ...]


class SensorEventConnection:
    """The FIFO between the service and one listener. A flush-complete is never dropped."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        """Events kept while the listener does not read."""
        self.events_dropped = 0
        self._queue: deque[tuple[int, EventColumn | None]] = deque()
        self._cached = 0

    @property
    def events_cached(self) -> int:
        """Events waiting to be taken."""
        return self._cached

    def __bool__(self) -> bool:
        return bool(self._queue)

    def append(self, handle: int, column: EventColumn) -> None:
        """Queue events of one sensor; beyond the capacity the oldest queued go."""
        self._queue.append((handle, column))
        self._cached += len(column)
        if self._cached > self.capacity:
            self._drop_oldest(self._cached - self.capacity)

    def append_flush_complete(self, handle: int) -> None:
        """Queue a flush-complete behind what is queued."""
        self._queue.append((handle, None))

    def take(self, max_events: int) -> EventChunk:
        """Remove and return the next events, at most `max_events`, ending behind the first run of flush-completes."""
        columns: dict[int, list[EventColumn]] = {}
        flushes: list[int] = []
        room = max_events
        while self._queue:
            handle, column = self._queue[0]
            if column is None:
                flushes.append(handle)
                self._queue.popleft()
                continue
            if flushes or room == 0:
                break
            taken = column if len(column) <= room else column[:room]
            if len(taken) < len(column):
                self._queue[0] = (handle, column[room:])
            else:
                self._queue.popleft()
            columns.setdefault(handle, []).append(taken)
            room -= len(taken)
        self._cached -= max_events - room
        return EventChunk({h: EventColumn.concatenate(parts) for h, parts in columns.items()}, tuple(flushes))

    def _drop_oldest(self, count: int) -> None:
        self.events_dropped += count
        self._cached -= count
        kept: list[tuple[int, EventColumn | None]] = []
        while count:
            handle, column = self._queue.popleft()
            if column is None:
                kept.append((handle, None))
            elif len(column) <= count:
                count -= len(column)
            else:
                kept.append((handle, column[count:]))
                count = 0
        self._queue.extendleft(reversed(kept))
