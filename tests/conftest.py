"""What every test may use: recordings, compiled filters, a browser, and the rule that a demanded need may not skip."""

import os
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import pytest
from hypothesis import HealthCheck, settings

if TYPE_CHECKING:
    from playwright.sync_api import Browser

# A busy machine is no fault of what is tested.
settings.register_profile("posed", settings(), deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("posed")

_PATIENCE_S = 20.0
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Without a GPU, a display, or root's wish to be protected from itself; timers of pages behind others go on.
_BROWSER_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--force-color-profile=srgb",
    "--disable-background-timer-throttling",
)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of recordings that POSED_DATA names; skips without it, fails where POSED_REQUIRE demands it."""
    named = os.environ.get("POSED_DATA")
    if not named or not Path(named).is_dir():
        _lacking("data", f"POSED_DATA is {named!r}, not a folder of recordings; set it to run this test")
    return Path(named)


@pytest.fixture(scope="session")
def compiled() -> None:
    """The filters are compiled; skips where they are not, fails where POSED_REQUIRE demands it."""
    from posed.fusion.kernel import kernel

    if kernel() == "interpreted":
        _lacking("compiler", "the filters are not compiled; install with a C compiler, and unset POSED_PURE")


@pytest.fixture(scope="session")
def browser_path() -> str:
    """Where Chromium is; skips without one, fails where POSED_REQUIRE demands it."""
    path = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if path is None:
        _lacking("browser", f"none of {', '.join(_BROWSERS)} is installed; install chromium to run this test")
    return path


# A module's, not the session's: as long as it is open, this thread has a running event loop.
@pytest.fixture(scope="module")
def browser(browser_path: str) -> "Iterator[Browser]":
    """A real Chromium without a window."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=browser_path, args=list(_BROWSER_ARGUMENTS))
        yield started
        started.close()


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


@pytest.fixture
def stop_process(eventually: Callable[[Callable[[], object]], None]) -> Callable[[int], None]:
    """Stop a process by SIGSTOP and return once it stands still: on another core it runs on for a moment."""

    def stop(pid: int) -> None:
        os.kill(pid, signal.SIGSTOP)
        eventually(lambda: Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T")

    return stop


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """A shell's background job ignores SIGINT and hands that down; the programs under test are to end by it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _lacking(need: str, reason: str) -> NoReturn:
    if need in os.environ.get("POSED_REQUIRE", "").split(","):
        pytest.fail(reason)
    pytest.skip(reason)
