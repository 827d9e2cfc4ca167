"""CPU time of the filters, compiled and interpreted, an event and a 9-axis sample, beside VQF's batch.

    python benchmarks/kernel_speed.py           # needs POSED_DATA, the extra `compare`, and compiled filters

BROAD's trials at their native rate, each filter in turn on each trial, so that what else the machine does falls on all
alike. The events are made before the clock starts. A 9-axis sample is a gyroscope sample with what came beside it: in
BROAD one event of each sensor. VQF gets whole arrays at the gyroscope's rate. Stated is the total CPU time over the
trials, the least of three rounds; interpreted (a process with POSED_PURE=1) two trials, once.
"""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

from figures import Figure, show

from posed.clock import BootClock
from posed.evaluation.rates import mode_batch
from posed.evaluation.speed import work
from posed.evaluation.trial import INPUTS
from posed.evaluation.trials import find_trials, load_trial
from posed.events import SensorType
from posed.fusion import make_filter
from posed.fusion.kernel import kernel

OURS = ("dcm", "dcm-adaptive")
ROUNDS = 3
INTERPRETED_TRIALS = 2
EVENT_NS = {"dcm": 120.0, "dcm-adaptive": 240.0}
AGAINST_VQF = {"dcm": 0.5, "dcm-adaptive": 1.0}


def measure(folder: Path, names: tuple[str, ...], trials: int | None, rounds: int) -> dict[str, tuple[float, float]]:
    """Return the CPU time of each filter over the first `trials` (None: all), ns an event and ns a 9-axis sample."""
    clock = BootClock()
    events = samples = 0
    spent = dict.fromkeys(names, 0)
    for path in find_trials([folder])[:trials]:
        batch = mode_batch(load_trial(path), "native")
        events += sum(len(batch.columns[kind]) for kind in INPUTS)
        samples += len(batch.columns[SensorType.GYROSCOPE])
        least: dict[str, int] = {}
        for _ in range(rounds):
            for name in names:
                run = work(partial(make_filter, name), batch)
                started = clock.cpu_ns()
                run()
                took = clock.cpu_ns() - started
                least[name] = min(took, least.get(name, took))
        for name in names:
            spent[name] += least[name]
    return {name: (total / events, total / samples) for name, total in spent.items()}


def interpreted() -> dict[str, float]:
    """Return ns an event of each of ours in a process that runs the sources."""
    done = subprocess.run(
        [sys.executable, __file__, "interpreted"],
        env={**os.environ, "POSED_PURE": "1"},
        check=True,
        capture_output=True,
        text=True,
    )
    return {name: float(ns) for name, ns in (line.split() for line in done.stdout.splitlines())}


def main() -> int:
    """Print the figures; exit code 1 if a target was missed."""
    data = os.environ.get("POSED_DATA")
    if data is None:
        sys.exit("set POSED_DATA to the folder of recordings")
    folder = Path(data) / "broad"
    if sys.argv[1:] == ["interpreted"]:
        for name, (ns, _) in measure(folder, OURS, INTERPRETED_TRIALS, 1).items():
            print(name, ns)
        return 0
    if kernel() != "compiled":
        sys.exit("the filters are not compiled; install with a C compiler, and unset POSED_PURE")
    compiled = measure(folder, (*OURS, "vqf"), None, ROUNDS)
    slow = interpreted()
    vqf = compiled["vqf"][1]
    figures = [Figure("vqf, a 9-axis sample", vqf, "ns")]
    for name in OURS:
        event, sample = compiled[name]
        figures += [
            Figure(f"{name}, an event", event, "ns", at_most=EVENT_NS[name]),
            Figure(f"{name}, a 9-axis sample", sample, "ns"),
            Figure(f"{name}, a 9-axis sample / vqf's", sample / vqf, "", at_most=AGAINST_VQF[name]),
            Figure(f"{name} interpreted, an event", slow[name], "ns"),
            Figure(f"{name}, interpreted / compiled", slow[name] / event),
        ]
    return show("CPU time of the filters, BROAD at its native rate", figures)


if __name__ == "__main__":
    sys.exit(main())
