"""The daemon's sleep: deadlines come once, in their time, and whatever else happens ends it."""

import os
import time
from collections.abc import Iterator

import pytest

from posed.daemon.waiting import Waiter

_MS = 1_000_000


def _now_ns() -> int:
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


@pytest.fixture
def waiter() -> Iterator[Waiter]:
    made = Waiter(())
    yield made
    made.close()


@pytest.mark.parametrize(
    "steps_ms",
    [(10, 10, 10, 10, 10), (10, 10, 3, 20, 20, 20), (5, 5, 5, 1, 1, 1, 5)],
    ids=["equal", "another interval", "faster and back"],
)
def test_each_deadline_is_waited_for(waiter: Waiter, steps_ms: tuple[int, ...]) -> None:
    due_ns = _now_ns()
    for step_ms in steps_ms:
        due_ns += step_ms * _MS
        assert not waiter.wait(due_ns)
        assert _now_ns() >= due_ns


def test_deadlines_missed_meanwhile_come_at_once_and_the_next_in_its_time(waiter: Waiter) -> None:
    due_ns = _now_ns()
    for _ in range(3):
        due_ns += 5 * _MS
        assert not waiter.wait(due_ns)
    while _now_ns() < due_ns + 23 * _MS:
        pass
    for _ in range(6):
        due_ns += 5 * _MS
        assert not waiter.wait(due_ns)
        assert _now_ns() >= due_ns


def test_what_happens_ends_the_wait_and_the_deadline_still_comes(waiter: Waiter) -> None:
    reader, writer = os.pipe()
    try:
        waiter.watch(reader)
        due_ns = _now_ns()
        for k in range(4):
            due_ns += 100 * _MS
            if k >= 2:  # before and after the timer goes by itself
                os.write(writer, b"x")
                assert waiter.wait(due_ns)
                assert _now_ns() < due_ns
            assert not waiter.wait(due_ns)
            assert _now_ns() >= due_ns
        # Without a deadline none comes, though the timer was set to go on.
        os.write(writer, b"x")
        assert waiter.wait(None)
        assert not waiter.wait(_now_ns() - 1)
    finally:
        os.close(reader)
        os.close(writer)
