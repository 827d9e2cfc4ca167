"""Pictures of the AR page, of every view, at phone and desktop size, dark and light.

python benchmarks/ar_screens.py FOLDER [--readme]    # needs Chromium; --readme: only the two that README.md shows
"""

import argparse
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from ar_page import open_browser, simulated_page
from PIL import Image
from playwright.sync_api import Page

DESKTOP = {"viewport": {"width": 1280, "height": 720}}
PHONE = {"viewport": {"width": 390, "height": 780}, "device_scale_factor": 2, "has_touch": True}
# Where the simulated user rests, and what there is to see.
_WEST, _ACROSS_THE_GULF = (270.0, "Λευκός Πύργος"), (222.0, "Mount Olympus")


def main() -> int:
    """Take the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--readme", action="store_true", help="only the two that README.md shows")
    arguments = parser.parse_args()
    folder: Path = arguments.folder
    folder.mkdir(parents=True, exist_ok=True)
    with open_browser() as browser, tempfile.TemporaryDirectory() as made:
        for size, context in (("desktop", DESKTOP), ("phone", PHONE)):
            for scheme in ("dark", "light"):
                if arguments.readme and (size, scheme) not in (("desktop", "dark"), ("phone", "light")):
                    continue
                with simulated_page(browser, ["--source=sim:look-around"], **context, color_scheme=scheme) as page:
                    aim(page, *(_WEST if size == "desktop" else _ACROSS_THE_GULF))
                    page.screenshot(path=folder / f"ar-{size}-{scheme}.png")
                    if not arguments.readme:
                        for name, show in PANELS.items():
                            show(page)
                            page.screenshot(path=folder / f"ar-{size}-{scheme}-{name}.png")
                            page.keyboard.press("Escape")
            if arguments.readme:
                continue
            for view in ("panorama", "photo"):
                picture = _picture(Path(made) / f"{view}.png")
                with simulated_page(browser, ["--source=sim:look-around"], f"--{view}={picture}", **context) as page:
                    aim(page, *_WEST)
                    page.screenshot(path=folder / f"ar-{size}-{view}.png")
    return 0


# The heading is where it is wanted, and has been for a while.
_RESTS = """(wanted) => {
  const off = ((posedAr.attitude.heading - wanted + 540) % 360) - 180;
  const now = performance.now();
  if (posedAr.pose.sequence < 30 || Math.abs(off) > 2) window.restsSince = now;
  return now - (window.restsSince ??= now) > 400;
}"""


def aim(page: Page, heading_deg: float, target: str) -> None:
    """Wait until the camera rests on a true heading, and hold a place as the target."""
    page.wait_for_function(_RESTS, arg=heading_deg, polling=50, timeout=240_000)
    page.evaluate(_TAP, target)
    page.wait_for_function("(name) => posedAr.target?.name === name", arg=target)
    page.evaluate("() => new Promise((done) => setTimeout(done, 150))")


# A tap on its dot, from within, as the dot moves.
_TAP = """(name) => {
  const { x: clientX, y: clientY } = posedAr.labels.find((label) => label.name === name);
  const stage = document.querySelector("#stage");
  stage.setPointerCapture = () => {};
  for (const type of ["pointerdown", "pointerup"]) {
    stage.dispatchEvent(new PointerEvent(type, { clientX, clientY, pointerId: 7, button: 0, bubbles: true }));
  }
}"""


def _record(page: Page) -> None:
    page.keyboard.press("ArrowRight")
    page.keyboard.press("r")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("r")
    page.keyboard.press("b")
    page.locator("#book-records li").first.wait_for()


def _correct(page: Page) -> None:
    page.keyboard.press("c")
    page.locator("#correct").wait_for()


def _settings(page: Page) -> None:
    page.keyboard.press("s")
    page.locator("#settings").wait_for()


def _help(page: Page) -> None:
    page.keyboard.press("?")
    page.locator("#help").wait_for()


def _figures(page: Page) -> None:
    page.locator("#readout summary").click()


PANELS: dict[str, Callable[[Page], None]] = {
    "book": _record,
    "correct": _correct,
    "settings": _settings,
    "help": _help,
    "figures": _figures,
}


def _picture(path: Path) -> Path:
    """Write a picture all around, of sky and ground with a mark each 30 degrees."""
    height, width = 512, 1024
    rows = np.linspace(0.0, 1.0, height)[:, np.newaxis, np.newaxis]
    sky, ground = np.array([120.0, 165.0, 210.0]), np.array([96.0, 104.0, 80.0])
    shown = np.where(rows < 0.5, sky + 120.0 * rows, ground + 40.0 * (1.0 - rows)) * np.ones((1, width, 1))
    shown[height // 2 - 60 : height // 2, :: width // 12] = 60.0
    Image.fromarray(np.clip(shown, 0, 255).astype(np.uint8)).save(path)
    return path


if __name__ == "__main__":
    sys.exit(main())
