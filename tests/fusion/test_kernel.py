"""Compiled filters compute what the interpreter computes, to the last bit, and are never older than their source."""

import os
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

FUSION = Path(__file__).parents[2] / "service" / "posed" / "fusion"

# Half an hour's worth of defects in a few minutes, by lists and arrays in turn: turns of all sizes,
# gaps, disorder, NaN, magnets, lost gyroscope.
FUSE = """
import hashlib, json, sys
import numpy as np
from posed.fusion import FILTERS, PACKAGED, make_filter
from posed.fusion.event_arrays import EventArrays
from posed.fusion.kernel import kernel

rng = np.random.default_rng(7)
print(kernel())
for name in sorted(FILTERS.keys() - set(PACKAGED)):
    digest = hashlib.sha256()
    for turning in (0.003, 0.1, 1.0, 5.0):
        count = 6000
        kinds = rng.choice([1, 2, 4], count)
        steps = rng.integers(0, 6_000_000, count)
        odd = rng.random(count)
        steps[odd < 0.01] = -4_000_000
        steps[odd > 0.9995] = 700_000_000
        values = rng.normal(0.0, 1.0, (count, 3)) * 0.2
        values[kinds == 1] += (0.0, 5.0, 8.0)
        values[kinds == 2] = values[kinds == 2] * 3.0 + (5.0, 20.0, -40.0)
        values[kinds == 4] *= turning / 0.2
        values[(kinds == 2) & (np.arange(count) // 1000 == 4)] *= 1.5
        values[rng.random(count) < 0.005] = np.nan
        kinds[(kinds == 4) & (np.arange(count) // 500 == 7)] = 1
        arrays = EventArrays(kinds, np.cumsum(steps), values)
        events = list(arrays)
        orientation_filter = make_filter(name)
        for start in range(0, count, 40):
            batch = slice(start, start + 40)
            orientation_filter.update_batch((events, arrays)[start // 40 % 2][batch])
            digest.update(repr(orientation_filter.orientation()).encode())
            digest.update(json.dumps(orientation_filter.save()).encode())
    print(name, digest.hexdigest())
"""


# One recording as it is: for each filter of ours the bits of what it says every two seconds, and of what it saves.
FUSE_RECORDING = """
import hashlib, json, sys
from pathlib import Path
from posed.evaluation.rates import mode_events
from posed.evaluation.trials import load_trial
from posed.fusion import make_filter
from posed.fusion.kernel import kernel

print(kernel())
events = mode_events(load_trial(Path(sys.argv[1])), "GAME")[:18_000]
for name in ("dcm", "dcm-adaptive"):
    orientation_filter = make_filter(name)
    for start in range(0, len(events), 300):
        orientation_filter.update_batch(events[start : start + 300])
        answer = orientation_filter.orientation()
        if answer is not None:
            numbers = (*answer.quaternion, *answer.angular_rate, answer.heading_accuracy)
            print(name, answer.timestamp_ns, int(answer.status), *map(float.hex, numbers))
    print(hashlib.sha256(json.dumps(orientation_filter.save()).encode()).hexdigest())
"""


def run(script: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {key: value for key, value in os.environ.items() if key != "POSED_PURE"}
    command = [sys.executable, "-c", script, *arguments]
    return subprocess.run(command, env={**clean, **environment}, capture_output=True, text=True, check=False)


@pytest.mark.usefixtures("compiled")
def test_compiled_and_interpreted_filters_agree_to_the_last_bit() -> None:
    compiled, interpreted = run(FUSE), run(FUSE, POSED_PURE="1")
    assert compiled.stdout.startswith("compiled\n"), compiled.stderr
    assert interpreted.stdout.startswith("interpreted\n"), interpreted.stderr
    assert compiled.stdout.splitlines()[1:] == interpreted.stdout.splitlines()[1:]
    assert "dcm " in compiled.stdout


@pytest.mark.usefixtures("compiled")
def test_a_recording_gives_the_same_bits_compiled_and_interpreted(data_dir: Path) -> None:
    trial = str(sorted((data_dir / "broad").glob("*.mat"))[0])
    compiled, interpreted = run(FUSE_RECORDING, trial), run(FUSE_RECORDING, trial, POSED_PURE="1")
    assert compiled.stdout.startswith("compiled\n"), compiled.stderr
    assert interpreted.stdout.startswith("interpreted\n"), interpreted.stderr
    said = compiled.stdout.splitlines()[1:]
    assert said == interpreted.stdout.splitlines()[1:]
    assert len(said) > 100


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("edited", ["dcm.py", "gate.pxd"])
def test_a_source_edited_since_it_was_compiled_is_refused_with_the_remedy(edited: str, tmp_path: Path) -> None:
    copy = tmp_path / "posed" / "fusion"
    shutil.copytree(FUSION, copy)
    assert (copy / f"dcm{EXTENSION_SUFFIXES[0]}").exists()
    with (copy / edited).open("a") as source:
        source.write("\n")
    script = f"import sys, posed; posed.__path__ = [{str(tmp_path / 'posed')!r}, *posed.__path__]; import posed.fusion"
    refused = run(script)
    assert refused.returncode != 0
    assert "StaleKernelError" in refused.stderr
    assert str(copy / edited) in refused.stderr
    assert "pip install -e ." in refused.stderr
    assert run(script, POSED_PURE="1").returncode == 0
