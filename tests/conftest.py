"""What every test may use: the recordings folder, and the rule that a demanded need may not skip."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

_PATIENCE_S = 20.0


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of recordings that POSED_DATA names; skips without it, fails where POSED_REQUIRE demands it."""
    named = os.environ.get("POSED_DATA")
    if named and Path(named).is_dir():
        return Path(named)
    reason = f"POSED_DATA is {named!r}, not a folder of recordings; set it to run this test"
    if "data" in os.environ.get("POSED_REQUIRE", "").split(","):
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture
def eventually() -> Callable[[Callable[[], object]], None]:
    """Wait until something that gives no event of its own is so."""

    def wait(condition: Callable[[], object]) -> None:
        pause = threading.Event()
        deadline = time.monotonic() + _PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, "it never came to be"
            pause.wait(0.01)

    return wait
