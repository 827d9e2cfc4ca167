"""Callbacks on a thread of the caller's."""

import threading

import pytest

from posed.client import Handler


def test_pending_callbacks_run_in_order_on_the_callers_thread() -> None:
    handler = Handler()
    ran: list[tuple[int, int]] = []
    for number in range(3):
        handler.post(lambda number=number: ran.append((number, threading.get_ident())))  # type: ignore[misc]
    assert handler.run_pending() == 3
    assert ran == [(number, threading.get_ident()) for number in range(3)]
    assert handler.run_pending() == 0


def test_waiting_ends_with_the_first_callback() -> None:
    handler = Handler()
    ran = threading.Event()
    poster = threading.Timer(0.0, lambda: handler.post(ran.set))
    poster.start()
    assert handler.run_pending(timeout_s=10) == 1
    assert ran.is_set()
    poster.join()


def test_run_ends_when_a_callback_says_so() -> None:
    handler = Handler()
    ran: list[str] = []
    handler.post(lambda: ran.append("first"))
    handler.post(handler.quit)
    handler.run()
    assert ran == ["first"]
    handler.post(handler.quit)
    handler.run()


def test_a_callback_that_raises_leaves_the_others_waiting() -> None:
    handler = Handler()
    ran: list[str] = []
    handler.post(lambda: [][0])
    handler.post(lambda: ran.append("next"))
    with pytest.raises(IndexError):
        handler.run_pending()
    assert handler.run_pending() == 1
    assert ran == ["next"]


def test_what_is_posted_meanwhile_runs_the_next_time() -> None:
    handler = Handler()
    handler.post(lambda: handler.post(lambda: None))
    assert handler.run_pending() == 1
    assert handler.run_pending() == 1


def test_quit_comes_before_what_waits() -> None:
    handler = Handler()
    ran: list[str] = []
    handler.post(handler.quit)
    handler.post(lambda: ran.append("later"))
    handler.run()
    assert ran == []
    assert handler.run_pending() == 1
    assert ran == ["later"]
