"""What every test may use: the recordings folder, and the rule that a demanded need may not skip."""

import os
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
