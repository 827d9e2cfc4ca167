"""The filter on recordings with optical truth: a laboratory's sensor at the slowest rate, a phone's at a usual one."""

from pathlib import Path

import numpy as np
import pytest

from posed.evaluation.rates import ModeName, mode_events
from posed.evaluation.scoring import Errors, Track, score
from posed.evaluation.trials import find_trials, load_trial
from posed.events import SensorType
from posed.fusion.adaptive import AdaptiveFilter


@pytest.mark.parametrize(
    ("folder", "trials", "mode", "total", "inclination"),
    [("broad", 16, "NORMAL", 7.0, 3.5), ("smartphone-attitude", 14, "GAME", 4.8, 2.4)],
)
def test_mean_errors_over_trials(
    data_dir: Path, folder: str, trials: int, mode: ModeName, total: float, inclination: float
) -> None:
    pytest.importorskip("scipy")
    errors: list[Errors] = []
    for path in find_trials([data_dir / folder]):
        trial = load_trial(path)
        adaptive = AdaptiveFilter()
        times, quaternions = [], []
        for event in mode_events(trial, mode):
            adaptive.update_batch((event,))
            if event[0] == SensorType.GYROSCOPE:
                answer = adaptive.orientation()
                if answer is not None:
                    times.append(answer.timestamp_ns)
                    quaternions.append(answer.quaternion)
        errors.append(score(trial, Track(np.array(times, np.int64), np.array(quaternions))))
    assert len(errors) == trials
    assert np.mean([error.total for error in errors]) < total
    assert np.mean([error.inclination for error in errors]) < inclination
