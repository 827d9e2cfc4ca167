"""The AR page in a real browser, over a daemon of its own, for the benchmarks that measure what is on the screen."""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, sync_playwright

from posed.cli.profiling.ar_client import find_browser
from posed.cli.profiling.daemons import Daemon, PrivateDaemon

POSITION = "40.6265,22.9591,72.5"


@contextmanager
def open_browser() -> Iterator[Browser]:
    """Yield a Chromium without a window."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=find_browser(),
            args=["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--force-color-profile=srgb"],
        )
        yield browser
        browser.close()


@contextmanager
def ar_page(browser: Browser, daemon: Daemon, *arguments: str, **context: Any) -> Iterator[Page]:
    """Yield the page of a `posed ar` with these arguments, once it shows poses; context: as of Browser.new_context."""
    directory = Path(tempfile.mkdtemp(prefix="posed-ar-"))
    server = subprocess.Popen(
        [sys.executable, "-m", "posed.cli", "ar", "--port=0", f"--corrections={directory / 'kept.json'}", *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env=daemon.environment(),
    )
    try:
        assert server.stdout is not None
        link = re.search(r"http://\S+", server.stdout.readline())
        if link is None:
            sys.exit("posed ar did not start")
        page = browser.new_context(**{"viewport": {"width": 1280, "height": 720}, **context}).new_page()
        page.goto(link[0])
        page.wait_for_function("() => window.posedAr?.pose?.isStale === false")
        yield page
        page.context.close()
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait()
        shutil.rmtree(directory, ignore_errors=True)


@contextmanager
def simulated_page(browser: Browser, serve: Sequence[str], *arguments: str, **context: Any) -> Iterator[Page]:
    """Yield the page over a daemon with these arguments of `posed serve`."""
    with (
        PrivateDaemon([*serve, f"--position={POSITION}"]) as daemon,
        ar_page(browser, daemon, *arguments, **context) as page,
    ):
        yield page


def data_folder() -> Path:
    """Return the folder of recordings that POSED_DATA names."""
    named = os.environ.get("POSED_DATA")
    if named is None:
        sys.exit("set POSED_DATA to the folder of recordings")
    return Path(named)
