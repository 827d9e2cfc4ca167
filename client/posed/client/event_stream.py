"""A sensor's events to iterate over, with `for` or with `async for`."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from threading import Condition
from types import TracebackType
from typing import TYPE_CHECKING

from posed.client.sensor import SensorEvent

if TYPE_CHECKING:
    from posed.client.sensor_manager import SensorManager

# What is kept for one who does not iterate: half a minute of a gyroscope at 400 Hz.
_BACKLOG = 10_000


class EventStream:
    """Events of one sensor as they come; made by SensorManager.stream.

    It ends with `close`, which leaving a loop over it or a `with` block calls, or with its manager. While a daemon is
    away it waits for its return. Of events that are not taken in time the oldest are dropped and counted.
    """

    def __init__(self, manager: SensorManager) -> None:
        self._manager = manager
        self._changed = Condition()
        self._events: deque[SensorEvent] = deque()
        self._wake: Callable[[], object] | None = None
        self._ended = False
        self.events_dropped = 0
        """Events dropped here; get_events_dropped tells of those that the daemon dropped."""

    def __enter__(self) -> EventStream:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[SensorEvent]:
        try:
            while (event := self.next()) is not None:
                yield event
        finally:
            self.close()

    async def __aiter__(self) -> AsyncIterator[SensorEvent]:
        import asyncio  # an SDK that is used without it is not to load it

        loop = asyncio.get_running_loop()
        arrived = asyncio.Event()
        self._wake = lambda: loop.call_soon_threadsafe(arrived.set)
        try:
            while True:
                arrived.clear()
                ended = self._ended  # what came before the end is in the queue by now
                while self._events:
                    yield self._events.popleft()
                if ended:
                    return
                await arrived.wait()
        finally:
            self._wake = None
            self.close()

    def next(self, timeout_s: float | None = None) -> SensorEvent | None:
        """Return the next event, waiting for it; None at the end of the stream or after `timeout_s`."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        with self._changed:
            while not self._events and not self._ended:
                remaining = None if deadline is None else deadline - time.monotonic()
                if remaining is not None and remaining <= 0:
                    return None
                self._changed.wait(remaining)
            return self._events.popleft() if self._events else None

    def close(self) -> None:
        """End the stream and its registration."""
        self.end()
        self._manager.unregister_listener(self)

    # From the manager

    def on_sensor_changed(self, event: SensorEvent) -> None:
        """Take one event."""
        with self._changed:
            self._events.append(event)
            if len(self._events) > _BACKLOG:
                self._events.popleft()
                self.events_dropped += 1
            self._changed.notify()
            if self._wake is not None:
                self._wake()

    def end(self) -> None:
        """Let who iterates come to the end; what has arrived is still yielded."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
            if self._wake is not None:
                self._wake()
