"""Started, bound, both or neither: when a daemon stays and when it ends."""

import pytest

from posed.daemon.lifecycle import Lifecycle


def test_a_started_daemon_stays_without_clients() -> None:
    life = Lifecycle(started=True)
    life.bind("a", auto_create=True)
    life.unbind("a")
    assert not life.over


def test_a_bound_only_daemon_waits_for_its_first_bind_and_ends_with_its_last() -> None:
    life = Lifecycle(started=False)
    assert life.awaits_first_bind
    assert not life.over
    life.bind("a", auto_create=True)
    life.bind("b", auto_create=True)
    assert not life.awaits_first_bind
    life.unbind("a")
    assert not life.over
    life.unbind("b")
    assert life.over


def test_a_binding_without_auto_create_does_not_keep_it() -> None:
    life = Lifecycle(started=False)
    life.bind("a", auto_create=True)
    life.bind("b", auto_create=False)
    life.unbind("a")
    assert life.over


@pytest.mark.parametrize("bound", [False, True])
def test_stopping_a_started_daemon_ends_it_unless_it_is_bound(bound: bool) -> None:
    life = Lifecycle(started=True)
    if bound:
        life.bind("a", auto_create=True)
    life.stop()
    assert life.over is not bound
    life.unbind("a")
    assert life.over


def test_starting_a_bound_daemon_makes_it_stay() -> None:
    life = Lifecycle(started=False)
    life.bind("a", auto_create=True)
    life.start()
    life.unbind("a")
    assert not life.over


def test_a_forced_end_asks_nobody() -> None:
    life = Lifecycle(started=True)
    life.bind("a", auto_create=True)
    life.end()
    assert life.over


def test_binding_twice_counts_once() -> None:
    life = Lifecycle(started=False)
    life.bind("a", auto_create=True)
    life.bind("a", auto_create=True)
    assert life.bound_clients == 1
    life.unbind("a")
    assert life.over


def test_it_knows_why_it_ends() -> None:
    life = Lifecycle(started=False)
    assert life.reason == "no client bound"
    life.bind("a", auto_create=True)
    life.unbind("a")
    assert life.reason == "its last client unbound"
    life.bind("b", auto_create=True)
    life.stop()
    life.unbind("b")
    assert life.reason == "it was told to stop"
    life.start()
    assert not life.over
    life.end()
    assert life.reason == "it was told to stop"
