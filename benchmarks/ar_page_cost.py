"""What the AR page costs itself: script a frame, bytes a message, and from a pose's publication to the screen.

    python benchmarks/ar_page_cost.py [--seconds S]    # needs Chromium

The page shows the sample places while a simulated user looks around: the world drawn from the truth at the display's
rate, and without a truth, over a photograph, where only the 10 Hz poses arrive.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from ar_page import open_browser, simulated_page
from figures import Figure, show
from PIL import Image
from playwright.sync_api import Browser, CDPSession

_MOST_SCRIPT_MS = 4.0
_MOST_BYTES = 400


def main() -> int:
    """Print the figures; exit code 1 if one misses its target."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0, metavar="S", help="of each view (default: 20)")
    seconds: float = parser.parse_args().seconds
    with open_browser() as browser, tempfile.TemporaryDirectory() as made:
        photo = Path(made) / "grey.png"
        Image.new("RGB", (1280, 720), "gray").save(photo)
        figures = [
            figure
            for name, arguments in (("world", ()), ("photograph", (f"--photo={photo}",)))
            for figure in measured(browser, name, seconds, *arguments)
        ]
    return show("The AR page, 1280 x 720", figures)


def measured(browser: Browser, name: str, seconds: float, *arguments: str) -> list[Figure]:
    """Return the figures of one view."""
    sizes: list[int] = []
    delays = []
    with simulated_page(browser, ["--source=sim:look-around"], *arguments) as page:
        page.wait_for_function("() => posedAr.pose.sequence > 30")
        session = page.context.new_cdp_session(page)
        session.on("Network.webSocketFrameReceived", lambda event: sizes.append(_bytes(event)))
        session.send("Network.enable")
        # The script's own processor time, of which others on the machine take nothing.
        session.send("Performance.enable", {"timeDomain": "threadTicks"})
        before = page.evaluate("() => posedAr.script.frames")
        script_before_s = _script_s(session)
        for _ in range(int(10 * seconds)):
            page.wait_for_timeout(100)
            delays.append(page.evaluate("() => posedAr.delay.publishedToDrawnMs"))
        script = page.evaluate("() => posedAr.script")
        script_s = _script_s(session) - script_before_s
    frames = script["frames"] - before
    return [
        Figure(f"{name}: script a frame, p95", script["p95"], "ms", at_most=_MOST_SCRIPT_MS),
        Figure("- median", script["p50"], "ms"),
        Figure("- processor time a frame, mean", 1000 * script_s / frames, "ms", at_most=_MOST_SCRIPT_MS),
        Figure("- frames drawn a second", frames / seconds, "1/s"),
        Figure("- message, largest", max(sizes), "bytes", at_most=_MOST_BYTES),
        Figure("- message, mean", float(np.mean(sizes)), "bytes"),
        Figure("- messages a second", len(sizes) / seconds, "1/s"),
        Figure("- published to drawn, median", float(np.median(delays)), "ms"),
        Figure("- p95", float(np.percentile(delays, 95)), "ms"),
    ]


def _script_s(session: CDPSession) -> float:
    metrics = session.send("Performance.getMetrics")["metrics"]
    return next(float(metric["value"]) for metric in metrics if metric["name"] == "ScriptDuration")


def _bytes(event: dict[str, Any]) -> int:
    return len(event["response"]["payloadData"].encode())


if __name__ == "__main__":
    sys.exit(main())
