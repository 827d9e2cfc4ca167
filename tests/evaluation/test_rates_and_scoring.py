"""Events at the rate modes, and what a filter's answers to them are worth."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_trials import quaternion, write_attitude_set, write_broad_trial, write_csv_trial

from posed.errors import InvalidArgumentError
from posed.evaluation.fuse import fuse_recording
from posed.evaluation.rates import MODES, PROFILE, mode_events
from posed.evaluation.scoring import Answers, Track, error_track, phone_answers, run_filter, score
from posed.evaluation.trial import Trial
from posed.evaluation.trials import load_trial
from posed.events import FilterStatus, FlatEvent, Orientation, RateMode, SensorType
from posed.fusion import make_filter
from posed.hal.profile import load_profile
from posed.sensors import make_device_filter

_GYROSCOPE = int(SensorType.GYROSCOPE)


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Trial:
    return load_trial(write_broad_trial(tmp_path_factory.mktemp("broad") / "x.mat"))


class _Oracle:
    """Knows the truth at gyroscope samples, from `since_ns` on, and turns at the true rate."""

    name = "oracle"

    def __init__(self, since_ns: int = 0) -> None:
        self._since_ns = since_ns
        self._newest: FlatEvent | None = None
        self.fed: list[FlatEvent] = []

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        self.update_batch([(int(sensor_type), timestamp_ns, x, y, z)])

    def update_batch(self, events: Iterable[FlatEvent]) -> None:
        for event in events:
            self.fed.append(event)
            if event[0] == _GYROSCOPE:
                self._newest = event

    def orientation(self) -> Orientation | None:
        if self._newest is None or self._newest[1] < self._since_ns:
            return None
        time_ns = self._newest[1]
        x, y, z, w = quaternion(np.array([time_ns * 1e-9]))[0].tolist()
        rate = 0.8 * 1.5 * math.cos(1.5 * time_ns * 1e-9)
        up = (0.0, math.sin(0.5), math.cos(0.5))
        return Orientation(time_ns, (x, y, z, w), (rate * up[0], rate * up[1], rate * up[2]), 0.1, FilterStatus.OK)

    def clear_events(self) -> None: ...

    def save(self) -> dict[str, Any]:
        return {}

    def restore(self, saved: Mapping[str, Any]) -> None: ...


def test_native_is_every_event_in_order(trial: Trial) -> None:
    events = mode_events(trial, "native")
    assert len(events) == 3600
    assert [(event[1], event[0]) for event in events] == sorted((event[1], event[0]) for event in events)
    # The gyroscope, which the others wait for, is the last of an instant.
    assert [event[0] for event in events[:3]] == [1, 2, 4]


@pytest.mark.parametrize(
    ("mode", "hz"), [("FASTEST", (100, 100, 50)), ("GAME", (50, 50, 50)), ("UI", (15, 15, 15)), ("NORMAL", (15, 5, 5))]
)
def test_modes_have_the_tablets_rates_and_lose_no_rotation(trial: Trial, mode: Any, hz: tuple[int, int, int]) -> None:
    events = mode_events(trial, mode)
    for kind, rate in zip((SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD), hz, strict=True):
        times = [event[1] for event in events if event[0] == kind]
        assert len(times) == pytest.approx(rate * 12, abs=2)
    gyro = np.array([event[1:] for event in events if event[0] == _GYROSCOPE])
    native = np.array([event[1:] for event in mode_events(trial, "native") if event[0] == _GYROSCOPE])
    turned = np.diff(gyro[:, 0]) @ gyro[1:, 1:] * 1e-9
    within = (native[:, 0] > gyro[0, 0]) & (native[:, 0] <= gyro[-1, 0])
    assert turned == pytest.approx(native[within][:, 1:].sum(axis=0) * 0.01, abs=0.02)


def test_an_unknown_mode_is_refused(trial: Trial) -> None:
    with pytest.raises(InvalidArgumentError, match="'HASTY' is unknown; allowed: native, FASTEST"):
        mode_events(trial, "HASTY")  # type: ignore[arg-type]


@pytest.mark.parametrize("mode", MODES)
def test_a_filter_that_knows_the_truth_errs_by_its_lag_alone(trial: Trial, mode: Any) -> None:
    events = mode_events(trial, mode)
    oracle = _Oracle()
    answers = run_filter(oracle, events)
    # Behind the last gyroscope sample and the last instant nothing can change an answer.
    assert oracle.fed == events[: len(oracle.fed)]
    assert all(event[0] != _GYROSCOPE for event in events[len(oracle.fed) :])
    assert score(trial, answers.filtered).total == pytest.approx(0.0, abs=0.02)
    held, aligned = score(trial, answers.poses).total, score(trial, answers.aligned).total
    assert (answers.poses.timestamp_ns == np.arange(0, events[-1][1] + 1, 100_000_000)).all()
    # 49 deg/s RMS; every other instant of the grid has a sample at UI (else 33 ms old) and NORMAL (else 100 ms).
    lag_ms = {"UI": 1e3 / 30, "NORMAL": 1e2}.get(mode, 0.0) * math.sqrt(0.5)
    assert held == pytest.approx(0.0486 * lag_ms, rel=0.3, abs=0.03)
    assert aligned < 0.15 * held + 0.03


def test_what_was_not_answered_does_not_count(trial: Trial) -> None:
    events = mode_events(trial, "GAME")
    late = run_filter(_Oracle(since_ns=8_000_000_000), events)
    assert np.isnan(late.filtered.quaternion[:400]).all()
    assert score(trial, late.filtered).total == pytest.approx(0.0, abs=0.02)
    never = run_filter(_Oracle(since_ns=10**18), events)
    assert math.isnan(score(trial, never.filtered).total)


def test_errors_are_those_of_the_turn_that_is_too_much(trial: Trial) -> None:
    stamps = trial.recording.columns[SensorType.GYROSCOPE].timestamp_ns
    off = Track(stamps, quaternion(stamps * 1e-9, math.radians(3.0)))
    errors = score(trial, off)
    assert (errors.total, errors.heading) == (pytest.approx(3.0, abs=1e-6), pytest.approx(3.0, abs=1e-6))
    assert errors.inclination == pytest.approx(0.0, abs=1e-6)
    track = error_track(trial, off)
    assert np.isnan(track[:401]).all()
    assert np.degrees(track[401:]) == pytest.approx(3.0, abs=1e-6)


def test_a_real_filter_finds_a_clean_phone(tmp_path: Path) -> None:
    csv = load_trial(write_csv_trial(tmp_path / "walk.csv"))
    for name in ("dcm", "dcm-literal", "dcm-adaptive", "vqf"):
        answers = run_filter(make_filter(name), mode_events(csv, "GAME"))
        assert score(csv, answers.filtered).total < 2.0, name


@pytest.mark.parametrize("mode", ["FASTEST", "NORMAL"])
@pytest.mark.parametrize("aligned", [False, True])
def test_the_poses_scored_are_those_that_a_daemon_publishes(trial: Trial, mode: Any, aligned: bool) -> None:
    profile = load_profile(PROFILE)
    answers = run_filter(make_device_filter("dcm", profile), mode_events(trial, mode))
    track = answers.aligned if aligned else answers.poses
    period_us = RateMode[mode].sampling_period_us
    published = {
        pose.instant_ns: pose.orientation.quaternion
        for pose in fuse_recording(
            trial.recording, profile, sampling_period_us=period_us, filters=["dcm"], aligned=aligned
        )
    }
    scored = {
        instant_ns: tuple(quaternion)
        for instant_ns, quaternion in zip(track.timestamp_ns.tolist(), track.quaternion.tolist(), strict=True)
        if not math.isnan(quaternion[0])
    }
    assert len(scored) > 100
    assert scored == published


def test_the_phones_own_fusion(tmp_path: Path, trial: Trial) -> None:
    phone = load_trial(write_attitude_set(tmp_path / "set", ["A_NoDist_AR"]) / "trials" / "A_NoDist_AR")
    answers: Answers = phone_answers(phone)
    assert score(phone, answers.filtered).total < 0.05
    assert score(phone, answers.poses).total < 0.05
    assert math.isnan(score(phone, answers.aligned).total)
    with pytest.raises(InvalidArgumentError, match="no rotation vector"):
        phone_answers(trial)


def test_no_gyroscope_is_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="no gyroscope event"):
        run_filter(_Oracle(), [(1, 0, 0.0, 0.0, 9.8)])
