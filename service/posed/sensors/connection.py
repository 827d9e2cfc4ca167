"""One listener's events on their way out: bounded, oldest dropped first and counted (SensorEventConnection.cpp)."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from posed.events import EventColumn, SensorInfo
from posed.sensors.client import Client
from posed.sensors.decimation import Decimator

MAX_FLUSH_COMPLETES = 1000
"""Flush-completes that may wait for one listener; so many fit one message."""

_CACHE_WITHOUT_FIFO = 984
"""Events kept where none of the listener's sensors has a hardware FIFO (100 KB of sensors_event_t)."""

_Entry = tuple[int, EventColumn | None]
"""A sensor's handle with events of its, or with None: a flush-complete."""


@dataclass(frozen=True, slots=True)
class EventChunk:
    """What fits one message: columns by handle, then the flushes completed behind them."""

    columns: dict[int, EventColumn]
    flush_completes: tuple[int, ...]

    def __len__(self) -> int:
        return sum(len(column) for column in self.columns.values())


@dataclass(slots=True)
class SensorRegistration:
    """One sensor of a connection."""

    info: SensorInfo
    decimator: Decimator | None = None
    first_flush_pending: bool = False
    """True for one who joined a running sensor, until what was sampled for the others is out of the way."""
    pending_flushes: int = 0
    """Flushes asked for and not complete yet."""


class SensorEventConnection:
    """The FIFO between the service and one listener. A flush-complete is never dropped."""

    def __init__(self, client: Client | None = None) -> None:
        self.client = client or Client()
        self.registrations: dict[int, SensorRegistration] = {}
        """Its sensors by handle; `add` and `remove` change them."""
        self.capacity = _CACHE_WITHOUT_FIFO
        """Events kept for a listener that does not read."""
        self.events_received = 0
        """Events of its sensors, dropped ones counted."""
        self.events_dropped = 0
        self.events_cached = 0
        """Events waiting to be taken."""
        self.flush_completes = 0
        """Flush-completes waiting to be taken."""
        self._queue: deque[_Entry] = deque()

    def __bool__(self) -> bool:
        return bool(self._queue)

    def add(self, registration: SensorRegistration) -> None:
        """Give it a sensor."""
        self.registrations[registration.info.handle] = registration
        self.capacity = cache_limit([each.info for each in self.registrations.values()])

    def remove(self, handle: int) -> None:
        """Undo `add`; what is queued stays."""
        del self.registrations[handle]
        self.capacity = cache_limit([each.info for each in self.registrations.values()])

    def offer(self, handle: int, column: EventColumn, sample_period_ns: int) -> None:
        """Queue events of one of its sensors, which come every `sample_period_ns`, unless they are not for it."""
        registration = self.registrations[handle]
        if registration.first_flush_pending:
            return
        if registration.decimator is not None:
            column = registration.decimator(column, sample_period_ns)
        if len(column):
            self.append(handle, column)

    def complete_flush(self, handle: int) -> None:
        """Take in a flush-complete addressed to it; the one of its joining is not for the listener to see."""
        registration = self.registrations.get(handle)
        if registration is None:
            return
        if registration.first_flush_pending:
            registration.first_flush_pending = False
            return
        registration.pending_flushes -= 1
        self.append_flush_complete(handle)

    def append(self, handle: int, column: EventColumn) -> None:
        """Queue events of one sensor."""
        self._queue.append((handle, column))
        self.events_received += len(column)
        self.events_cached += len(column)

    def append_flush_complete(self, handle: int) -> None:
        """Queue a flush-complete behind what is queued."""
        self._queue.append((handle, None))
        self.flush_completes += 1

    def drop_overflow(self) -> int:
        """Drop the oldest queued of all sensors beyond the capacity and return how many; called when none can leave."""
        count = max(0, self.events_cached - self.capacity)
        if count:
            self._drop_oldest(count)
        return count

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


def cache_limit(sensors: Sequence[SensorInfo]) -> int:
    """Return how many events are kept for one who has these sensors (SensorEventConnection::computeMaxCacheSizeLocked).

    The hardware FIFOs that would fill meanwhile: those reserved for one sensor add up, of shared ones the largest
    counts, for wake-up sensors and the others apart.
    """
    limit = 0
    for wake_up in (False, True):
        fifos = [each for each in sensors if each.wake_up is wake_up]
        dedicated = [each for each in fifos if each.fifo_reserved_event_count == each.fifo_max_event_count]
        shared = [each.fifo_max_event_count for each in fifos if each not in dedicated]
        limit += sum(each.fifo_max_event_count for each in dedicated) + max(shared, default=0)
    return limit or _CACHE_WITHOUT_FIFO


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
