"""What the AR page's alignment tool leaves of a wrong heading and a wrong position, with real poses and hands.

    python benchmarks/ar_alignment.py    # needs Chromium

A simulated user looks around. Each alignment is made at a pose of the paper's tablet at GAME, the phone nearly at rest,
with the page's own camera and solver in Chromium, and misses the object by a pixel (one standard deviation, each way).
Before it, headings are 7.3 degrees too large.

- one drag: what is left of the heading error.
- bearing to other targets: after one drag, at all poses of the next minute at rest.
- three drags of objects 40 to 150 m away, wherever the user looks, and a position 12 m off: what is left of both, and
  how often the tool refuses, as the objects lie so that they tell too little of the position. Once with the poses as
  they are, whose own errors of a few tenths of a degree change meanwhile, and once with poses that have no other error.
"""

import argparse
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from ar_experiments import camera_axis, turn_about_up
from ar_page import open_browser
from figures import Figure, show
from playwright.sync_api import Browser, Route
from simulation import Simulation, axes, simulate

import posed.ar.app
from posed.events import Float64Array, Int64Array, RateMode
from posed.fusion import DEFAULT_FILTER
from posed.fusion.filter import OrientationFilter
from posed.hal.profile import load_profile
from posed.sensors import make_device_filter

_TURNED_DEG = 7.3
_MOVED_M = 12.0
_MOST_HEADING_DEG = 0.2
_MOST_POSITION_M = 0.5
_STILL_RAD_S = math.radians(5.0)
_LATER_POSES = 600
_PAGE = Path(posed.ar.app.__file__).with_name("page")

_SOLVE = """async ({ fov, trials, both }) => {
  const { Camera } = await import("/camera.js");
  const { Projector } = await import("/projector.js");
  const { enu, fromEnu, polar } = await import("/geodesy.js");
  const { solveBoth, solveHeading, SolveError } = await import("/solve.js");
  const camera = new Camera({ width: 1280, height: 720, fovDeg: fov, rotation: 0 });
  const to = new Projector();
  const here = { latitude: 40.6265, longitude: 22.9591, height: 72.5 };
  return trials.map(({ moved, sights }) => {
    const alignments = sights.map(({ pose, truth, at, missed }, i) => {
      to.aim(camera, truth, moved);
      to.point(...at);
      const seen = polar(camera.ray(pose, to.x + missed[0], to.y + missed[1]));
      const { bearing, elevation } = seen;
      return { id: `${i}`, name: `${i}`, position: fromEnu(here, at), bearing, elevation };
    });
    try {
      const solution = both ? solveBoth(alignments, here) : solveHeading(alignments, here);
      return { offset: solution.headingOffset, moved: solution.position && enu(here, solution.position) };
    } catch (error) {
      if (error instanceof SolveError) return null;
      throw error;
    }
  });
}"""


def main() -> int:
    """Print the figures; exit code 1 if one misses its target."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=300, metavar="N", help="of each kind (default: 300)")
    trials: int = parser.parse_args().trials
    done = simulate("look-around", 300, _filter, RateMode.GAME, warm_up_s=5.0)
    rng = np.random.default_rng(0)
    with open_browser() as browser:
        heading, later = one_drag(browser, done, rng, trials)
        turned, moved, refused = three_drags(browser, done, rng, trials, exact=False)
        turned_alone, moved_alone, _ = three_drags(browser, done, rng, trials, exact=True)
    return show(
        "What alignments leave",
        [
            *_figures("one drag, heading error", heading, "deg", _MOST_HEADING_DEG),
            *_figures("bearing to other targets after it", later, "deg"),
            *_figures("three drags, heading error", turned, "deg"),
            *_figures("three drags, position error", moved, "m"),
            Figure("- refused: the places tell too little", 100 * refused, "%"),
            *_figures("the same, poses exact but for 7.3 deg, heading error", turned_alone, "deg", _MOST_HEADING_DEG),
            *_figures("- position error", moved_alone, "m", _MOST_POSITION_M),
        ],
    )


def one_drag(
    browser: Browser, done: Simulation, rng: np.random.Generator, count: int
) -> tuple[Float64Array, Float64Array]:
    """Return what is left of the heading error at once, and of bearings to other targets later (deg, absolute)."""
    poses, truths, still = _orientations(done)
    picks = rng.choice(still[still < len(poses) - _LATER_POSES], count)
    trials = [{"moved": [0, 0, 0], "sights": [_sight(poses, truths, pick, rng, np.zeros(3))]} for pick in picks]
    offsets = np.array([found["offset"] for found in _solve(browser, trials, both=False) if found])
    left, later = [], []
    for pick, offset in zip(picks, offsets, strict=True):
        after = still[(still >= pick) & (still < pick + _LATER_POSES)]
        corrected = turn_about_up(poses[after], -offset)
        # The same object: where it is, and where the corrected pose has it.
        true, drawn = camera_axis(axes(truths[after])), camera_axis(axes(corrected))
        error = np.degrees(np.arctan2(drawn[:, 0], drawn[:, 1]) - np.arctan2(true[:, 0], true[:, 1]))
        error = np.abs((error + 180.0) % 360.0 - 180.0)
        left.append(error[0])
        later.append(error[1:])
    return np.array(left), np.concatenate(later)


def three_drags(
    browser: Browser, done: Simulation, rng: np.random.Generator, count: int, *, exact: bool
) -> tuple[Float64Array, Float64Array, float]:
    """Return what is left of the heading (deg) and of the position (m, horizontal), and the share that was refused."""
    poses, truths, still = _orientations(done, exact)
    trials: list[dict[str, Any]] = []
    for _ in range(count):
        way = rng.uniform(0, 2 * math.pi)
        moved = _MOVED_M * np.array([math.sin(way), math.cos(way), 0.0])
        sights = [_sight(poses, truths, pick, rng, moved) for pick in rng.choice(still, 3)]
        trials.append({"moved": moved.tolist(), "sights": sights})
    solved = [(one, trial) for one, trial in zip(_solve(browser, trials, both=True), trials, strict=True) if one]
    turned = np.degrees(np.abs([one["offset"] + math.radians(_TURNED_DEG) for one, _ in solved]))
    missed = np.array([np.array(one["moved"]) - trial["moved"] for one, trial in solved])
    return turned, np.linalg.norm(missed[:, :2], axis=1), 1.0 - len(solved) / count


def _orientations(done: Simulation, exact: bool = False) -> tuple[Float64Array, Float64Array, Int64Array]:
    """Return poses, 7.3 degrees off, and truths, both against true north, and the poses at which the phone is held."""
    poses = turn_about_up(done.quaternions, -done.declination - math.radians(_TURNED_DEG))
    fused_ns = np.array([pose.orientation.timestamp_ns for pose in done.poses])
    if exact:
        poses = turn_about_up(done.truth(fused_ns), -math.radians(_TURNED_DEG))
    rates = np.array([np.linalg.norm(pose.orientation.angular_rate) for pose in done.poses])
    return poses, done.truth(fused_ns), np.flatnonzero(rates < _STILL_RAD_S)


def _sight(
    poses: Float64Array, truths: Float64Array, pick: int, rng: np.random.Generator, moved: Float64Array
) -> dict[str, Any]:
    """Return an alignment: an object in the middle of the true view, seen from where the phone truly is."""
    ahead = camera_axis(axes(truths[pick : pick + 1]))[0]
    at = moved + ahead * rng.uniform(40.0, 150.0)
    return {
        "pose": poses[pick].tolist(),
        "truth": truths[pick].tolist(),
        "at": at.tolist(),
        "missed": rng.normal(0.0, 1.0, 2).tolist(),
    }


def _solve(browser: Browser, trials: list[dict[str, Any]], *, both: bool) -> list[dict[str, Any] | None]:
    def serve(route: Route) -> None:
        name = route.request.url.rsplit("/", 1)[1]
        if name:
            route.fulfill(body=(_PAGE / name).read_bytes(), content_type="text/javascript")
        else:
            route.fulfill(body="<!doctype html>", content_type="text/html")

    page = browser.new_page()
    page.route("**/*", serve)
    page.goto("http://page.invalid/")
    fov = load_profile("patonis2018").camera_fov_deg
    solved: list[dict[str, Any] | None] = page.evaluate(_SOLVE, {"fov": fov, "trials": trials, "both": both})
    page.close()
    return solved


def _figures(name: str, errors: Float64Array, unit: str, at_most: float | None = None) -> list[Figure]:
    """Return median, which the target is of, and 95th percentile."""
    median, p95 = (float(np.percentile(errors, part)) for part in (50, 95))
    return [Figure(f"{name}, median", median, unit, at_most=at_most), Figure("- p95", p95, unit)]


def _filter() -> OrientationFilter:
    return make_device_filter(DEFAULT_FILTER, load_profile("patonis2018"))


if __name__ == "__main__":
    sys.exit(main())
