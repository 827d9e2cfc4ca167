"""What every test may use: the recordings folder, and the rule that a demanded need may not skip."""

import os
import signal
from pathlib import Path

import pytest


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


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """A shell's background job ignores SIGINT and hands that down; the programs under test are to end by it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
