"""What the AR page does when the daemon dies, and when its own tab stops.

    python benchmarks/ar_recovery.py [--repeats N] [--stopped S]

- killed: from SIGKILL of the daemon to the banner that says so; and from the moment a new daemon is ready to poses on
  the page again, without a reload.
- stopped: the page's process is stopped with SIGSTOP and goes on after some seconds; from then to the newest pose on
  it, and what the daemon's figures did meanwhile, beside what they did in as long a time before.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from ar_page import ar_page, open_browser
from figures import Figure, show
from recovery import start_daemon

from posed.cli.profiling.daemons import Daemon, PrivateDaemon

_MOST_TOLD_S = 1.0
_MOST_BACK_S = 3.0


def main() -> int:
    """Print the figures; exit code 1 if one misses its target."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5, metavar="N", help="kills (default: 5)")
    parser.add_argument(
        "--stopped", type=float, default=60.0, metavar="S", help="seconds a tab is stopped (default: 60)"
    )
    arguments = parser.parse_args()
    told, back = killed(arguments.repeats)
    woke, skipped_before, skipped = stopped(arguments.stopped)
    return show(
        "The AR page",
        [
            Figure("killed to told, worst", 1000 * max(told), "ms", at_most=1000 * _MOST_TOLD_S),
            Figure("- median", 1000 * statistics.median(told), "ms"),
            Figure("daemon ready to live again, worst", 1000 * max(back), "ms", at_most=1000 * _MOST_BACK_S),
            Figure("- median", 1000 * statistics.median(back), "ms"),
            Figure("tab woken to newest pose", 1000 * woke, "ms"),
            Figure("poses the daemon skipped meanwhile", skipped),
            Figure("- in as long a time before", skipped_before),
        ],
    )


# Date.now() and Python's time.time() are the same clock of the same machine.
_WATCH = """() => {
  window.seen = [];
  let was = "";
  const watch = () => {
    const banner = document.querySelector("#banner");
    const is = banner.hidden && posedAr.pose?.isStale === false ? "live" : banner.hidden ? "" : "told";
    if (is !== was && is !== "") seen.push([is, Date.now() / 1000]);
    if (is !== "") was = is;
    requestAnimationFrame(watch);
  };
  watch();
}"""


def killed(repeats: int) -> tuple[list[float], list[float]]:
    """Return the seconds from each kill to the banner, and from each new daemon to poses on the page."""
    told, back = [], []
    with tempfile.TemporaryDirectory(prefix="posed-") as directory:
        os.environ["XDG_RUNTIME_DIR"] = directory
        daemon = start_daemon(Path(directory))
        with open_browser() as browser, ar_page(browser, Daemon()) as page:
            page.evaluate(_WATCH)
            for _ in range(repeats):
                page.wait_for_function("() => seen.at(-1)?.[0] === 'live'")
                killed_at = time.time()
                daemon.kill()
                daemon.wait()
                page.wait_for_function("() => seen.at(-1)[0] === 'told'")
                told.append(page.evaluate("() => seen.at(-1)[1]") - killed_at)
                daemon = start_daemon(Path(directory))
                ready_at = time.time()
                page.wait_for_function("() => seen.at(-1)[0] === 'live'")
                back.append(page.evaluate("() => seen.at(-1)[1]") - ready_at)
        daemon.terminate()
        daemon.wait()
        del os.environ["XDG_RUNTIME_DIR"]
    return told, back


def stopped(seconds: float) -> tuple[float, int, int]:
    """Return the seconds from a tab's waking to the newest pose on it, and the poses skipped before and meanwhile."""
    with open_browser() as browser, PrivateDaemon(["--source=sim:still"]) as daemon, ar_page(browser, daemon) as page:
        session = browser.new_browser_cdp_session()
        processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
        renderers = [int(process["id"]) for process in processes if process["type"] == "renderer"]
        page.evaluate(_NOTE)
        begun = daemon.statistics().poses_skipped
        time.sleep(seconds)
        before = daemon.statistics().poses_skipped
        for pid in renderers:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(seconds)
        after = daemon.statistics().poses_skipped
        newest = _newest_sequence(daemon)
        woken_at = time.time()
        for pid in renderers:
            os.kill(pid, signal.SIGCONT)
        page.wait_for_function("newest => notes.some(([sequence]) => sequence >= newest)", arg=newest)
        notes: list[Any] = page.evaluate("() => notes")
        shown_at = next(at for sequence, at in notes if sequence >= newest)
        return shown_at - woken_at, before - begun, after - before


_NOTE = """() => {
  window.notes = [];
  const note = () => {
    const sequence = posedAr.pose.sequence;
    if (notes.at(-1)?.[0] !== sequence) notes.push([sequence, Date.now() / 1000]);
    requestAnimationFrame(note);
  };
  note();
}"""


def _newest_sequence(daemon: Daemon) -> int:
    words = [sys.executable, "-m", "posed.cli", "watch", "--json", "--count=1"]
    said = subprocess.run(words, env=daemon.environment(), capture_output=True, text=True, check=True).stdout
    return int(json.loads(said)["sequence"])


if __name__ == "__main__":
    sys.exit(main())
