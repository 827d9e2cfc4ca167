"""Orientation error of the 10 Hz poses against motion capture, trial by trial and mode by mode.

    python benchmarks/accuracy.py            # needs POSED_DATA and the extra `evaluate`

Each trial of `smartphone-attitude` goes through the pipeline of `posed fuse`. Printed is the total RMSE in degrees
(BROAD's definition) of each pose at its own timestamp, beside that of the phone's own rotation vector at the same
instants; then the means, and with them what a client sees that takes each pose for the state at its grid instant.
"""

import csv
import math
import os
import sys
from pathlib import Path

import numpy as np

from posed.evaluation.fuse import fuse_recording
from posed.evaluation.measures import (
    BoolArray,
    heading_error,
    inclination_error,
    rmse,
    slerp_truth,
    to_magnetic_north,
    total_error,
)
from posed.events import Float64Array, Int64Array, RateMode
from posed.hal.profile import load_profile
from posed.hal.recording import Recording, TruthTrack
from posed.hal.replay import load_recording

MODES = (RateMode.FASTEST, RateMode.GAME, RateMode.UI, RateMode.NORMAL)
TARGET_GAME_DEG = 8.0


def errors(
    truth: TruthTrack, declination: float, times: Int64Array, estimate: Float64Array, kept: BoolArray
) -> dict[str, float]:
    """Return total, heading and inclination RMSE (deg) of orientations against magnetic north."""
    true = to_magnetic_north(slerp_truth(times, truth.timestamp_ns, truth.quaternion), declination)
    kept = kept & np.isfinite(true).all(axis=1)
    measures = {"total": total_error, "heading": heading_error, "inclination": inclination_error}
    return {name: math.degrees(rmse(measure(estimate[kept], true[kept]))) for name, measure in measures.items()}


def outside(times: Int64Array, excluded: str, origin_ns: int) -> BoolArray:
    """Return which times are in none of the excluded spans, `FROM-TO FROM-TO` in seconds of motion capture."""
    kept = np.ones(len(times), bool)
    for span in excluded.split():
        first, last = (float(edge) for edge in span.split("-"))
        seconds = (times - origin_ns) / 1e9
        kept &= (seconds < first) | (seconds > last)
    return kept


def score(recording: Recording, excluded: str) -> dict[str, dict[str, float]]:
    """Return the errors of each mode, as poses and as a client sees them, and of the phone's own fusion."""
    truth = recording.truth
    own = recording.rotation_vector
    if truth is None or own is None:
        sys.exit(f"{recording.name} lacks truth or rotation vector")
    origin_ns = int(truth.timestamp_ns[0])
    result = {}
    for mode in MODES:
        poses = list(fuse_recording(recording, load_profile("patonis2018"), sampling_period_us=mode.sampling_period_us))
        estimate = np.array([pose.orientation.quaternion for pose in poses])
        for name, times in (
            (mode.name, np.array([pose.orientation.timestamp_ns for pose in poses])),
            (f"{mode.name} seen", np.array([pose.instant_ns for pose in poses])),
        ):
            kept = outside(times, excluded, origin_ns)
            result[name] = errors(truth, recording.declination, times, estimate, kept)
        if mode is RateMode.GAME:
            times = np.array([pose.instant_ns for pose in poses])
            newest = np.searchsorted(own.timestamp_ns, times, side="right") - 1
            kept = outside(times, excluded, origin_ns) & (newest >= 0)
            times = own.timestamp_ns[newest]
            result["phone"] = errors(truth, recording.declination, times, own.values[newest, :4], kept)
    return result


def main() -> int:
    """Print the table; exit code 1 if the mean at GAME misses its target."""
    data = os.environ.get("POSED_DATA")
    if data is None:
        sys.exit("set POSED_DATA to the folder of recordings")
    folder = Path(data) / "smartphone-attitude"
    with (folder / "trials.csv").open(newline="") as listed:
        trials = list(csv.DictReader(listed))
    names = [mode.name for mode in MODES]
    print(f"{'total RMSE, deg':<24}" + "".join(f"{name:>9}" for name in names) + f"{'phone':>9}")
    scores = []
    for trial in trials:
        scored = score(load_recording(folder / "trials" / trial["trial"]), trial["excluded_s"])
        scores.append(scored)
        row = "".join(f"{scored[name]['total']:9.2f}" for name in (*names, "phone"))
        print(f"{trial['trial'].removeprefix('Guillaume_Nexus5_'):<24}{row}", flush=True)
    for measure in ("total", "heading", "inclination"):
        row = "".join(f"{np.mean([s[name][measure] for s in scores]):9.2f}" for name in (*names, "phone"))
        print(f"{f'mean {measure}':<24}{row}")
    row = "".join(f"{np.mean([s[f'{name} seen']['total'] for s in scores]):9.2f}" for name in names)
    print(f"{'mean total, as seen':<24}{row}")
    game = float(np.mean([s["GAME"]["total"] for s in scores]))
    verdict = "ok" if game <= TARGET_GAME_DEG else "MISSED"
    print(f"mean total at GAME {game:.2f} deg, at most {TARGET_GAME_DEG:g}: {verdict}")
    return 0 if game <= TARGET_GAME_DEG else 1


if __name__ == "__main__":
    sys.exit(main())
