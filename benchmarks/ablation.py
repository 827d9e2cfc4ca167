"""What each ingredient of dcm-adaptive pays, and what half and double of each parameter cost.

    python benchmarks/ablation.py               # needs POSED_DATA and the extra `evaluate`; minutes when compiled
    python benchmarks/ablation.py parameters    # at GAME and NORMAL only: native says what GAME says
    python benchmarks/ablation.py --half A      # every other trial of each data set by name; B: the others
    python benchmarks/ablation.py held-out      # parameters fixed on one half, tested on the other

The filter runs over the trials of BROAD and of the smartphone attitude data set, with one thing changed at a time.
Printed is the mean total error in degrees by BROAD's definition at each mode, behind the stroke that of the
inclination: in the first line as it is, in the others by how much the change makes it worse.
"""

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from posed.evaluation.rates import ModeName, mode_events
from posed.evaluation.scoring import Errors, Track, score
from posed.evaluation.trial import Trial
from posed.evaluation.trials import find_trials, load_trial
from posed.events import FlatEvent, SensorType
from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams

MODES: tuple[ModeName, ...] = ("native", "GAME", "UI", "NORMAL")
_NEVER = 1e9
_GYROSCOPE = int(SensorType.GYROSCOPE)

ABLATIONS: dict[str, dict[str, object]] = {
    "all of it": {},
    "tilt of the first order": {"tilt.damping": 10.0},
    "no faster tilt for slow gyroscopes": {"tilt.interval_noise": _NEVER},
    "neither tilt nor heading faster for slow gyroscopes": {"interval.loss": 1e-9},
    "rate constant within an interval (no coning)": {"interval.slope": False},
    "measurements at the interval's end": {"interval.own_time": False},
    "no sensor delays": {"gyro_delay_s": 0.0, "acc_delay_s": 0.0, "mag_delay_s": 0.0},
    "no bias": {"bias.motion_std": _NEVER, "rest.settle_s": _NEVER},
    "no bias at rest": {"rest.settle_s": _NEVER},
    "no bias in motion": {"bias.motion_std": _NEVER},
    "no faster heading for a doubted bias": {"heading.bias_s": 1e-9},
    "no gate on magnetic disturbance": {"earth.norm_tolerance": _NEVER, "earth.dip_tolerance": _NEVER},
    "no mean and no wait in the gate": {"earth.mean_s": 1e-9, "earth.settle_s": 1e-9},
    "no new reference": {"earth.candidate_s": _NEVER},
    "no late re-acceptance": {"earth.patience_s": _NEVER},
    "no hard iron": {"iron.worse": 2e-9, "iron.better": 1e-9},
}


def changed(params: Any, changes: dict[str, object]) -> Any:
    """Return a params dataclass with the fields named by their path set to other values."""
    for path, value in changes.items():
        name, _, rest = path.partition(".")
        params = replace(params, **{name: changed(getattr(params, name), {rest: value}) if rest else value})
    return params


def numbers(params: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield the path and value of every number in a params dataclass."""
    for each in fields(params):
        value = getattr(params, each.name)
        if is_dataclass(value):
            yield from numbers(value, f"{path}{each.name}.")
        elif isinstance(value, float):
            yield path + each.name, value


# Of the bias that dcm learns in the detection of rest; dcm-adaptive learns it elsewhere.
# Where the gyroscope is lost: no trial here loses it, so neither half nor double would show anything.
_UNUSED = {"rest.bias_std", "rest.bias_walk", "rest.rest_density", "tilt.lost_s", "heading.lost_density"}


def parameters() -> dict[str, dict[str, object]]:
    """Return each number at half and at double its default."""
    variants: dict[str, dict[str, object]] = {"defaults": {}}
    for path, value in numbers(AdaptiveParams()):
        if path not in _UNUSED:
            variants[f"{path} {value:.4g} / 2"] = {path: 0.5 * value}
            variants[f"{path} {value:.4g} * 2"] = {path: 2.0 * value}
    return variants


FITTED = (
    *("tilt.time_s", "tilt.interval_noise", "interval.loss", "heading.time_s", "heading.field_noise", "heading.bias_s"),
    *("bias.std", "bias.motion_std", "earth.norm_tolerance", "earth.dip_tolerance"),
    *("gyro_delay_s", "acc_delay_s", "mag_delay_s"),
)
"""What the recordings had a say in; the rest is physics, data sheets and VQF's."""
FACTORS = (0.5, 0.7, 1.0, 1.4, 2.0)


def held_out(data: Path) -> None:
    """Print what parameters fixed on one half of the trials do on the other half, beside the defaults.

    On each half every parameter in turn takes the best of five values from half to double its default, the others
    being as they are by then; best is the least mean total error over both data sets at GAME and NORMAL.
    """
    halves: dict[str, list[tuple[Trial, ModeName, list[FlatEvent]]]] = {"A": [], "B": []}
    for which, cases in halves.items():
        for folder in ("broad", "smartphone-attitude"):
            for path in half(find_trials([data / folder]), which):
                trial = load_trial(path)
                cases += [(trial, mode, mode_events(trial, mode)) for mode in ("GAME", "NORMAL")]

    def means(params: AdaptiveParams, which: str) -> dict[tuple[str, ModeName], float]:
        found: dict[tuple[str, ModeName], list[float]] = {}
        for trial, mode, events in halves[which]:
            found.setdefault((trial.dataset, mode), []).append(errors(trial, events, params).total)
        return {column: float(np.mean(each)) for column, each in found.items()}

    def cost(params: AdaptiveParams, which: str) -> float:
        return float(np.mean(list(means(params, which).values())))

    for fitted, tested in (("A", "B"), ("B", "A")):
        default = chosen = AdaptiveParams()
        moved: dict[str, float] = {}
        for name, value in numbers(default):
            if name in FITTED:
                tried = [changed(chosen, {name: factor * value}) for factor in FACTORS]
                costs = [cost(params, fitted) for params in tried]
                best = int(np.argmin(costs))
                chosen = tried[best]
                moved[name] = FACTORS[best]
                print(fitted, name, FACTORS[best], f"{costs[best]:.3f}", file=sys.stderr, flush=True)
        print(f"fixed on {fitted}: " + ", ".join(f"{name} * {f}" for name, f in moved.items() if f != 1.0))
        for which in (fitted, tested):
            own, shipped = means(chosen, which), means(default, which)
            cells = (
                f"{dataset} {mode} {own[dataset, mode]:.2f} ({shipped[dataset, mode]:.2f})" for dataset, mode in own
            )
            print(f"  on {which}, in brackets the defaults: " + ", ".join(cells))


def errors(trial: Trial, events: Sequence[FlatEvent], params: AdaptiveParams) -> Errors:
    """Return the errors of the filter's orientation right after each gyroscope sample."""
    adaptive = AdaptiveFilter(params)
    times, quaternions, fed = [], [], 0
    for row, event in enumerate(events):
        if event[0] == _GYROSCOPE:
            adaptive.update_batch(events[fed : row + 1])
            fed = row + 1
            answer = adaptive.orientation()
            if answer is not None:
                times.append(answer.timestamp_ns)
                quaternions.append(answer.quaternion)
    return score(trial, Track(np.array(times, np.int64), np.array(quaternions)))


def half(paths: list[Path], which: str | None) -> list[Path]:
    """Return every other path, from the first for A and from the second for B; all for None."""
    return paths if which is None else paths[which == "B" :: 2]


def main() -> int:
    """Print the table."""
    data = os.environ.get("POSED_DATA")
    if data is None:
        sys.exit("set POSED_DATA to the folder of recordings")
    parser = argparse.ArgumentParser(description="What each part of dcm-adaptive pays.")
    parser.add_argument("what", nargs="?", choices=["parameters", "held-out"], help="not what is left out, but this")
    parser.add_argument(
        "--half", choices=["A", "B"], help="every other trial of each data set by name, B from the second"
    )
    options = parser.parse_args()
    if options.what == "held-out":
        held_out(Path(data))
        return 0
    variants = parameters() if options.what else ABLATIONS
    modes: tuple[ModeName, ...] = ("GAME", "NORMAL") if options.what else MODES
    made = {name: changed(AdaptiveParams(), changes) for name, changes in variants.items()}
    folders = [Path(data) / name for name in ("broad", "smartphone-attitude")]
    found: dict[tuple[str, str, ModeName], list[Errors]] = {}
    paths = [path for folder in folders for path in half(find_trials([folder]), options.half)]
    for path in paths:
        trial = load_trial(path)
        print(trial.name, file=sys.stderr, flush=True)
        for mode in modes:
            events = mode_events(trial, mode)
            for name, params in made.items():
                found.setdefault((name, trial.dataset, mode), []).append(errors(trial, events, params))
    columns = [(dataset, mode) for dataset in dict.fromkeys(key[1] for key in found) for mode in modes]
    print(f"{'':<52}" + "".join(f"{dataset[:5]:>7} {mode:<7}" for dataset, mode in columns))
    reference = None
    for name in made:
        row = np.array(
            [
                [float(np.mean([getattr(e, part) for e in found[name, *column]])) for part in ("total", "inclination")]
                for column in columns
            ]
        )
        if reference is None:
            reference = row
            cells = [f"{total:8.2f}/{inclination:5.2f} " for total, inclination in row]
        else:
            cells = [f"{total:+8.2f}/{inclination:+5.2f} " for total, inclination in row - reference]
        print(f"{name:<52}" + "".join(cells))
    return 0


if __name__ == "__main__":
    sys.exit(main())
