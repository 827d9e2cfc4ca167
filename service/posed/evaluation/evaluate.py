"""Filters over trials at rate modes: each trial by a process of its own, the results in the order of the trials."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from posed.errors import InvalidArgumentError, InvalidStateError, RecordingError
from posed.evaluation.attitude_trials import CalibrationChoice
from posed.evaluation.rates import MODES, PROFILE, ModeName, mode_batch
from posed.evaluation.scoring import Answers, Track, error_track, phone_answers, run_filter, score
from posed.evaluation.speed import cpu_ns_per_event
from posed.evaluation.trial import INPUTS, Trial
from posed.evaluation.trials import Skipped, load_trial
from posed.fusion.filter import OrientationFilter
from posed.hal.profile import load_profile
from posed.sensors import make_device_filter

PHONE = "phone"
"""In the place of a filter's name: the phone's own rotation vector, which has one rate, its native one."""

_CURVE_POINTS = 300


@dataclass(frozen=True, slots=True)
class Plan:
    """What is evaluated: filters by name (PHONE among them), modes, and which calibration a phone's trials get."""

    filters: tuple[str, ...]
    modes: tuple[ModeName, ...] = MODES
    calibration: CalibrationChoice = CalibrationChoice.OWN

    def check(self) -> None:
        """Raise InvalidArgumentError for an unknown name or none, MissingExtraError for a package not installed."""
        for what, names in (("filter", self.filters), ("mode", self.modes)):
            if not names or len(set(names)) != len(names):
                raise InvalidArgumentError(f"{what}s {','.join(names)!r}; give one or more, none twice")
        for mode in self.modes:
            if mode not in MODES:
                raise InvalidArgumentError(f"mode {mode!r} is unknown; allowed: {', '.join(MODES)}")
        for name in self.filters:
            if name != PHONE:
                _maker(name)()


@dataclass(frozen=True, slots=True)
class Curve:
    """Error over time: RMS (deg) of stretches of equal length about `seconds` since the first event; NaN: not known."""

    seconds: tuple[float, ...]
    error: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Result:
    """One filter on one trial at one mode. Errors in degrees (RMSE), NaN where there was no answer.

    pose10hz_total and pose10hz_aligned_total: of the pose as a client sees it (see `scoring`). ns_per_event: None of
    the phone's own fusion. curve: of the total error, for the first mode of the plan and for PHONE.
    """

    dataset: str
    trial: str
    groups: tuple[str, ...]
    filter: str
    mode: ModeName
    total: float
    heading: float
    inclination: float
    pose10hz_total: float
    pose10hz_aligned_total: float
    ns_per_event: float | None
    curve: Curve | None


@dataclass(frozen=True, slots=True)
class Evaluation:
    """All results, in the order of the trials, then modes, then filters; and what could not be read."""

    plan: Plan
    results: tuple[Result, ...]
    skipped: tuple[Skipped, ...]


def evaluate(
    trials: Sequence[Path], plan: Plan, *, jobs: int | None = None, on_trial: Callable[[Path], None] = lambda _: None
) -> Evaluation:
    """Evaluate trials (see `find_trials`), `jobs` at a time (default: one a core); `on_trial` is called after each.

    Errors do not depend on the number of jobs; CPU times are measurements. A trial that cannot be read is skipped and
    kept as such; trials of one name are told apart by the folders they lie in. Raises what Plan.check does,
    MissingExtraError if a reader is missing, and InvalidStateError if a process was killed.
    """
    plan.check()
    jobs = min(jobs or len(os.sched_getaffinity(0)), len(trials))
    done: dict[Path, tuple[Result, ...] | Skipped] = {}
    for path, outcome in _outcomes(trials, plan, jobs):
        done[path] = outcome
        on_trial(path)
    outcomes = [(path, done[path]) for path in trials]
    results = _told_apart([(path, each) for path, each in outcomes if not isinstance(each, Skipped)])
    return Evaluation(plan, results, tuple(each for _, each in outcomes if isinstance(each, Skipped)))


def evaluate_trial(trial: Trial, plan: Plan) -> tuple[Result, ...]:
    """Return the results of a plan's filters on one trial."""
    results = []
    for index, mode in enumerate(plan.modes):
        batch = mode_batch(trial, mode)
        events = batch.flat({int(kind): kind for kind in INPUTS})
        for name in plan.filters:
            if name != PHONE:
                answers = run_filter(_maker(name)(), events)
                ns_per_event = cpu_ns_per_event(_maker(name), batch)
                results.append(_result(trial, name, mode, answers, ns_per_event, with_curve=index == 0))
            elif index == 0 and trial.rotation_vector is not None:
                results.append(_result(trial, PHONE, "native", phone_answers(trial), None, with_curve=True))
    return tuple(results)


def _outcomes(trials: Sequence[Path], plan: Plan, jobs: int) -> Iterator[tuple[Path, tuple[Result, ...] | Skipped]]:
    if jobs <= 1:
        for path in trials:
            yield path, _outcome(path, plan)
        return
    # Spawned, not forked: a fork would take over whatever threads and locks the caller has. Ctrl-C ends the
    # processes at once and without a word.
    with ProcessPoolExecutor(
        jobs, get_context("spawn"), initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_DFL)
    ) as pool:
        futures: dict[Future[tuple[Result, ...] | Skipped], Path] = {
            pool.submit(_outcome, path, plan): path for path in trials
        }
        waiting = set(futures)
        try:
            while waiting:
                finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield futures[future], future.result()
        except BrokenProcessPool as error:
            raise InvalidStateError(
                "a process that evaluated a trial was killed, perhaps for want of memory; use fewer jobs"
            ) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _outcome(path: Path, plan: Plan) -> tuple[Result, ...] | Skipped:
    try:
        # Inside too: a phone's own rotation vector is read when it is first asked for.
        return evaluate_trial(load_trial(path, plan.calibration), plan)
    except RecordingError as error:
        return Skipped(str(path), str(error))


def _told_apart(found: Sequence[tuple[Path, tuple[Result, ...]]]) -> tuple[Result, ...]:
    """Return all results, their trials named with the folders below those they share if another has the same name."""
    placed = [(path.parent.resolve(), each) for path, results in found for each in results]
    folders: dict[tuple[str, str], set[Path]] = {}
    for folder, each in placed:
        folders.setdefault((each.dataset, each.trial), set()).add(folder)
    shared = {key: os.path.commonpath(alike) for key, alike in folders.items()}
    return tuple(
        replace(each, trial=str(folder.relative_to(shared[each.dataset, each.trial]) / each.trial))
        for folder, each in placed
    )


def _maker(name: str) -> Callable[[], OrientationFilter]:
    profile = load_profile(PROFILE)
    return lambda: make_device_filter(name, profile)


def _result(
    trial: Trial, name: str, mode: ModeName, answers: Answers, ns_per_event: float | None, *, with_curve: bool
) -> Result:
    errors = score(trial, answers.filtered)
    return Result(
        dataset=trial.dataset,
        trial=trial.name,
        groups=trial.groups,
        filter=name,
        mode=mode,
        total=errors.total,
        heading=errors.heading,
        inclination=errors.inclination,
        pose10hz_total=score(trial, answers.poses).total,
        pose10hz_aligned_total=score(trial, answers.aligned).total,
        ns_per_event=ns_per_event,
        curve=_curve(trial, answers.filtered) if with_curve else None,
    )


def _curve(trial: Trial, track: Track) -> Curve:
    seconds = (track.timestamp_ns - trial.recording.start_ns) * 1e-9
    squared = np.square(np.degrees(error_track(trial, track)))
    edges = np.linspace(seconds[0], seconds[-1], _CURVE_POINTS + 1)
    stretch = np.clip(np.searchsorted(edges, seconds, side="right") - 1, 0, _CURVE_POINTS - 1)
    known = np.isfinite(squared)
    count = np.bincount(stretch[known], minlength=_CURVE_POINTS)
    total = np.bincount(stretch[known], weights=squared[known], minlength=_CURVE_POINTS)
    error = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return Curve(tuple((0.5 * (edges[:-1] + edges[1:])).tolist()), tuple(error.tolist()))
