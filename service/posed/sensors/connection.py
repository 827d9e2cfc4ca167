"""One listener's events on their way out: bounded, oldest dropped first and counted (SensorEventConnection.cpp)."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from posed.events import EventColumn

MAX_FLUSH_COMPLETES = 1000
"""Flush-completes that may wait for one listener; so many fit one message."""


_Entry = tuple[int, EventColumn | None]
"""A sensor's handle with events of its, or with None: a flush-complete."""


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
        self.events_cached = 0
        """Events waiting to be taken."""
        self.flush_completes = 0
        """Flush-completes waiting to be taken."""
        self._queue: deque[_Entry] = deque()

    def __bool__(self) -> bool:
        return bool(self._queue)

    def append(self, handle: int, column: EventColumn) -> None:
        """Queue events of one sensor; beyond the capacity the oldest queued of all sensors go."""
        self._queue.append((handle, column))
        self.events_cached += len(column)
        if self.events_cached > self.capacity:
            self._drop_oldest(self.events_cached - self.capacity)

    def append_flush_complete(self, handle: int) -> None:
        """Queue a flush-complete behind what is queued."""
        self._queue.append((handle, None))
        self.flush_completes += 1

    def take(self, max_events: int) -> EventChunk:
        """Remove and return the oldest events, at most `max_events`, ending behind the first run of flush-completes."""
        waiting = _columns_of(takewhile(_is_column, self._queue))
        counts = [len(column) for _, column in waiting]
        all_fit = sum(counts) <= max_events
        taken = counts if all_fit else _oldest(waiting, max_events)
        columns: dict[int, list[EventColumn]] = {}
        rest: list[_Entry] = []
        for (handle, column), count in zip(waiting, taken, strict=True):
            self._queue.popleft()
            if count:
                columns.setdefault(handle, []).append(column if count == len(column) else column[:count])
            if count < len(column):
                rest.append((handle, column[count:]))
        self._queue.extendleft(reversed(rest))
        self.events_cached -= sum(taken)
        flushes: list[int] = []
        if all_fit:
            while self._queue and self._queue[0][1] is None:
                flushes.append(self._queue.popleft()[0])
            self.flush_completes -= len(flushes)
        return EventChunk({h: EventColumn.concatenate(parts) for h, parts in columns.items()}, tuple(flushes))

    def _drop_oldest(self, count: int) -> None:
        self.events_dropped += count
        self.events_cached -= count
        dropped = iter(_oldest(_columns_of(self._queue), count))
        kept: list[_Entry] = []
        for handle, column in self._queue:
            if column is None:
                kept.append((handle, None))
            elif (gone := next(dropped)) < len(column):
                kept.append((handle, column[gone:]))
        self._queue = deque(kept)


def _is_column(entry: _Entry) -> bool:
    return entry[1] is not None


def _columns_of(entries: Iterable[_Entry]) -> list[tuple[int, EventColumn]]:
    return [(handle, column) for handle, column in entries if column is not None]


def _oldest(columns: Sequence[tuple[int, EventColumn]], count: int) -> list[int]:
    """Return how many events of each column are among the `count` oldest of all; of one instant, the first queued."""
    times = np.concatenate([column.timestamp_ns for _, column in columns])
    owners = np.repeat(np.arange(len(columns)), [len(column) for _, column in columns])
    order = np.argsort(times, kind="stable")[:count]
    counts: list[int] = np.bincount(owners[order], minlength=len(columns)).tolist()
    return counts
