"""Callbacks on a thread of the caller's (android.os.Handler and Looper in one)."""

import time
from collections import deque
from collections.abc import Callable
from threading import Condition


class Handler:
    """A queue of callbacks that run on whichever thread calls `run` or `run_pending`."""

    def __init__(self) -> None:
        self._changed = Condition()
        self._waiting: deque[Callable[[], None]] = deque()
        self._quitting = False

    def post(self, callback: Callable[[], None]) -> None:
        """Have `callback` run; from any thread."""
        with self._changed:
            self._waiting.append(callback)
            self._changed.notify()

    def run_pending(self, timeout_s: float = 0.0) -> int:
        """Run what waits, after waiting up to `timeout_s` for something, and return how many callbacks ran."""
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while not self._waiting and not self._quitting:
                remaining = deadline - time.monotonic()
                if remaining <= 0 or not self._changed.wait(remaining):
                    break
            waiting = len(self._waiting)
        ran = 0
        while ran < waiting and self._run_next():
            ran += 1
        return ran

    def run(self) -> None:
        """Run callbacks as they come, until `quit`."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._quitting)
                if self._quitting:
                    self._quitting = False
                    return
            self._run_next()

    def quit(self) -> None:
        """End `run`; from any thread, a callback included."""
        with self._changed:
            self._quitting = True
            self._changed.notify()

    def _run_next(self) -> bool:
        """Run what waits longest; False if nothing does. What it raises costs none of the others."""
        with self._changed:
            if not self._waiting:
                return False
            callback = self._waiting.popleft()
        callback()
        return True
