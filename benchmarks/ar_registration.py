"""Registration error of the AR overlay against motion capture, on the recorded AR trials, in degrees and pixels.

    python benchmarks/ar_registration.py [--no-browser]    # needs POSED_DATA, the extra `evaluate`, and Chromium

The error is the angle on the screen between where the overlay puts the object in the middle of the true view and where
it is. Twice:

- computed, for each rate mode: at every frame of a 60 Hz display, a pose being shown 20 ms after its grid instant; and
  the same after one alignment, which takes the heading error of its instant out, as a user begins;
- seen, at GAME: the trial replayed in real time by a daemon, and the page's own figure, read each frame in Chromium.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import IO

import numpy as np
from ar_experiments import MODES, camera_axis, heading_of, overlay_error_deg, pixels, turn_about_up
from ar_page import ar_page, data_folder, open_browser
from rich.console import Console
from rich.table import Table
from simulation import axes

from posed.cli.profiling.daemons import PrivateDaemon
from posed.evaluation.fuse import fuse_recording
from posed.evaluation.measures import slerp_truth, to_magnetic_north
from posed.events import Float64Array, RateMode
from posed.hal.profile import load_profile
from posed.hal.recording import Recording
from posed.hal.replay import load_recording

_TRIALS = ("Guillaume_Nexus5_NoDist_AR", "Guillaume_Nexus5_Dist_AR")
_DELAY_NS = 20_000_000
_FRAME_NS = 1_000_000_000 // 60
# The filter has settled, and the user has taken up the phone.
_ALIGNED_AFTER_S = 5.0


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--no-browser", action="store_true", help="compute only")
    arguments = parser.parse_args()
    folder = data_folder() / "smartphone-attitude" / "trials"
    fov_deg = load_profile("patonis2018").camera_fov_deg
    table = Table(title="Registration error, mean / p95", title_justify="left")
    for name in ("trial", "mode", "as it comes", "after one alignment"):
        table.add_column(name, justify="left" if name in ("trial", "mode") else "right")
    for trial in _TRIALS:
        recording = load_recording(folder / trial)
        short = trial.removeprefix("Guillaume_Nexus5_")
        for mode in MODES:
            found, aligned = computed(recording, mode)
            table.add_row(short, mode.name, _cell(found, fov_deg), _cell(aligned, fov_deg))
        if not arguments.no_browser:
            table.add_row(short, "GAME, on the page", _cell(seen(folder / trial), fov_deg), "")
        table.add_section()
    Console(highlight=False, width=110).print(table)
    return 0


def computed(recording: Recording, mode: RateMode) -> tuple[Float64Array, Float64Array]:
    """Return the errors (deg) at each frame, as the poses come, and after one alignment."""
    truth = recording.truth
    if truth is None:
        sys.exit(f"{recording.name} has no truth")
    poses = list(fuse_recording(recording, load_profile("patonis2018"), sampling_period_us=mode.sampling_period_us))
    shown_ns = np.array([pose.instant_ns for pose in poses]) + _DELAY_NS
    frames = np.arange(shown_ns[0], shown_ns[-1], _FRAME_NS)
    newest = np.searchsorted(shown_ns, frames, side="right") - 1
    true = to_magnetic_north(slerp_truth(frames, truth.timestamp_ns, truth.quaternion), recording.declination)
    known = np.isfinite(true).all(axis=1)
    quaternions = np.array([pose.orientation.quaternion for pose in poses])[newest][known]
    frames, true = frames[known], true[known]
    first = int(np.searchsorted(frames, frames[0] + _ALIGNED_AFTER_S * 1e9))
    off = heading_of(camera_axis(axes(true[first : first + 1]))) - heading_of(
        camera_axis(axes(quaternions[first : first + 1]))
    )
    aligned = turn_about_up(quaternions, -float(off[0]))
    return (
        overlay_error_deg(axes(quaternions), axes(true)),
        overlay_error_deg(axes(aligned[first:]), axes(true[first:])),
    )


_READ = """() => {
  window.errors = [];
  const read = () => {
    const { deg } = posedAr.registration;
    if (!posedAr.pose?.isStale && Number.isFinite(deg)) errors.push(deg);
    requestAnimationFrame(read);
  };
  read();
}"""


def seen(trial: Path) -> Float64Array:
    """Return the errors (deg) that the page showed at each frame of a replay."""
    recording = load_recording(trial)
    if recording.truth is None:
        sys.exit(f"{recording.name} has no truth")
    # Poses are counted from the first sample on, ten a second; motion capture ends before the phone does.
    last = (int(recording.truth.timestamp_ns[-1]) - recording.start_ns) // 100_000_000 - 5
    with (
        open_browser() as browser,
        PrivateDaemon([f"--source=replay:{trial}"]) as daemon,
        tempfile.NamedTemporaryFile("w", suffix=".geojson") as places,
        ar_page(browser, daemon, "--mode=GAME", f"--places={_no_places(places)}") as page,
    ):
        page.evaluate(_READ)
        page.wait_for_function("last => posedAr.pose.sequence >= last", arg=last, polling=50, timeout=300_000)
        return np.array(page.evaluate("() => errors"), np.float64)


def _no_places(file: IO[str]) -> str:
    """Have no place in the file, so that the page measures in the middle of the view; return its name."""
    file.write('{"type": "FeatureCollection", "features": []}')
    file.flush()
    return file.name


def _cell(errors: Iterable[float], fov_deg: float) -> str:
    found = np.asarray(errors)
    return " / ".join(
        f"{value:.2f}° {pixels(value, fov_deg)}" for value in (float(found.mean()), float(np.percentile(found, 95)))
    )


if __name__ == "__main__":
    sys.exit(main())
