"""The whole way from recordings to figures, against what an independent evaluation of the same recordings found."""

from pathlib import Path

import numpy as np
import pytest

from posed.evaluation.rates import mode_events
from posed.evaluation.scoring import run_filter, score
from posed.evaluation.trials import find_trials, load_trial
from posed.fusion import make_filter


def test_vqf_over_broad(data_dir: Path) -> None:
    pytest.importorskip("vqf")
    totals = []
    for path in find_trials([data_dir / "broad"]):
        trial = load_trial(path)
        totals.append(score(trial, run_filter(make_filter("vqf"), mode_events(trial, "UI")).filtered).total)
    assert len(totals) == 16
    assert np.mean(totals) == pytest.approx(5.81, rel=0.03)


def test_the_phones_recordings_agree_with_its_truth(data_dir: Path) -> None:
    """Calibration, clocks, exclusions and declination: with any of them wrong VQF errs by 5.7 degrees or more."""
    pytest.importorskip("vqf")
    totals = {}
    for path in find_trials([data_dir / "smartphone-attitude"]):
        trial = load_trial(path)
        totals[trial.name] = score(trial, run_filter(make_filter("vqf"), mode_events(trial, "UI")).filtered).total
    assert len(totals) == 14
    assert np.mean(list(totals.values())) < 5.5
