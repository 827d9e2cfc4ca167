"""The AR application as a load: `posed ar`, and a real browser that shows its page."""

import os
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from posed.cli.profiling.accounting import Reading, read_session
from posed.cli.profiling.clients import end_session
from posed.cli.profiling.daemons import Daemon
from posed.errors import PosedError

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WINDOW = (1280, 720)
_PICTURE = (
    f'<svg xmlns="http://www.w3.org/2000/svg" width="{WINDOW[0]}" height="{WINDOW[1]}">'
    '<rect width="100%" height="100%" fill="gray"/></svg>'
)
_LINK_TIMEOUT_S = 20.0
# A page's first seconds are those of compiling its script and filling its caches.
_SETTLE_S = 4.0


def find_browser() -> str:
    """Return the path of Chromium; raises PosedError with the remedy if there is none."""
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found is None:
        raise PosedError(f"--with-ar needs a browser, one of {', '.join(_BROWSERS)}; install chromium")
    return found


class ArApplication:
    """`posed ar` and a browser with its page; leaving the `with` block ends both.

    Over a still picture, as over a camera's, the page draws the overlay with each pose; a drawn world is drawn anew
    with each frame of the display, and needs the truth 50 times a second.
    """

    def __init__(self, daemon: Daemon, mode: str, *, drawn_world: bool) -> None:
        self._daemon = daemon
        self._mode = mode
        self._drawn_world = drawn_world
        self._directory = Path(tempfile.mkdtemp(prefix="posed-ar-"))
        self._server: subprocess.Popen[bytes] | None = None
        self._browser: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "ArApplication":
        try:
            words = [sys.executable, "-m", "posed.cli", "ar", "--port=0", f"--mode={self._mode}"]
            words.append(f"--corrections={self._directory / 'corrections.json'}")
            if not self._drawn_world:
                picture = self._directory / "grey.svg"
                picture.write_text(_PICTURE)
                words.append(f"--photo={picture}")
            self._server = self._start(words)
            link = self._next_link()
            self._browser = self._start(self._browser_words(link))
            self._next_link()  # the first has been used: the page is there
            time.sleep(_SETTLE_S)
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def read_server(self) -> Reading:
        """Return the accounts of `posed ar`."""
        return _read(self._server, "posed ar")

    def read_page(self) -> Reading:
        """Return the accounts of all the browser's processes."""
        return _read(self._browser, "the browser")

    def _start(self, words: Sequence[str]) -> "subprocess.Popen[bytes]":
        with (self._directory / "log").open("ab") as log:
            return subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                env=self._daemon.environment(),
                start_new_session=True,
            )

    def _browser_words(self, link: str) -> list[str]:
        # Root's browser refuses to start with its sandbox.
        sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []
        return [
            find_browser(),
            "--headless=new",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-background-networking",
            f"--window-size={WINDOW[0]},{WINDOW[1]}",
            f"--user-data-dir={self._directory / 'browser'}",
            *sandbox,
            link,
        ]

    def _next_link(self) -> str:
        stdout = self._server.stdout if self._server else None
        if stdout is not None and select.select([stdout], [], [], _LINK_TIMEOUT_S)[0]:
            found = re.search(r"http://\S+", stdout.readline().decode())
            if found is not None:
                return found[0]
        said = (self._directory / "log").read_text(errors="replace").strip().splitlines()
        what = "the browser did not open the page" if self._browser else "posed ar did not start"
        raise PosedError(f"{what}{': ' + said[-1] if said else ''}")

    def _end(self) -> None:
        for process in (self._browser, self._server):
            if process is not None:
                end_session(process)
                if process.stdout is not None:
                    process.stdout.close()
        shutil.rmtree(self._directory, ignore_errors=True)


def _read(process: "subprocess.Popen[bytes] | None", name: str) -> Reading:
    if process is None or process.poll() is not None:
        raise PosedError(f"{name} ended while it was being measured")
    return read_session(process.pid)
