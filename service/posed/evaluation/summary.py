"""What results come to: means and medians over trials, over groups of them, and differences between filters."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from posed.evaluation.evaluate import Result

_RESAMPLES = 10_000
_SEED = 20180810


@dataclass(frozen=True, slots=True)
class Summary:
    """One filter at one mode over the trials of a group of a data set; degrees, ns."""

    dataset: str
    group: str
    filter: str
    mode: str
    trials: int
    total_mean: float
    total_median: float
    heading_mean: float
    inclination_mean: float
    pose10hz_mean: float
    pose10hz_aligned_mean: float
    ns_per_event: float | None
    """Mean; None of the phone's own fusion."""


@dataclass(frozen=True, slots=True)
class Difference:
    """How much further off the truth a filter is than another: mean over trials of total - total, degrees.

    low, high: 95 % interval by bootstrap over the trials (percentiles of 10,000 resamples, seeded).
    """

    dataset: str
    mode: str
    filter: str
    against: str
    trials: int
    mean: float
    low: float
    high: float


ALL = "all trials"
"""The group of every trial of a data set."""


def summaries(results: Sequence[Result]) -> list[Summary]:
    """Return a summary a data set, mode and filter, in the order in which they first appear."""
    return [_summary(ALL, chosen) for chosen in _by(results)]


def group_summaries(results: Sequence[Result]) -> list[Summary]:
    """Return the same for each group that is not of all trials of its data set."""
    found = []
    for dataset in dict.fromkeys(result.dataset for result in results):
        of_dataset = [result for result in results if result.dataset == dataset]
        trials = {result.trial for result in of_dataset}
        for group in dict.fromkeys(group for result in of_dataset for group in result.groups):
            members = [result for result in of_dataset if group in result.groups]
            if {result.trial for result in members} != trials:
                found += [_summary(group, chosen) for chosen in _by(members)]
    return found


def differences(results: Sequence[Result], against: str) -> list[Difference]:
    """Return for each data set and mode how the filters differ from `against`, over the trials that both have."""
    reference = {(r.dataset, r.mode, r.trial): r.total for r in results if r.filter == against}
    found = []
    for chosen in _by(results):
        first = chosen[0]
        pairs = [(r.total, reference.get((r.dataset, r.mode, r.trial))) for r in chosen]
        deltas = np.array([mine - other for mine, other in pairs if other is not None])
        if first.filter != against and len(deltas):
            mean, low, high = _bootstrap(deltas)
            found.append(Difference(first.dataset, first.mode, first.filter, against, len(deltas), mean, low, high))
    return found


def _by(results: Iterable[Result]) -> Iterator[list[Result]]:
    chosen: dict[tuple[str, str, str], list[Result]] = {}
    for result in results:
        chosen.setdefault((result.dataset, result.mode, result.filter), []).append(result)
    yield from chosen.values()


def _summary(group: str, results: Sequence[Result]) -> Summary:
    totals = [result.total for result in results]
    costs = [result.ns_per_event for result in results if result.ns_per_event is not None]

    def mean(name: str) -> float:
        return float(np.mean([getattr(result, name) for result in results]))

    return Summary(
        dataset=results[0].dataset,
        group=group,
        filter=results[0].filter,
        mode=results[0].mode,
        trials=len(results),
        total_mean=mean("total"),
        total_median=float(np.median(totals)),
        heading_mean=mean("heading"),
        inclination_mean=mean("inclination"),
        pose10hz_mean=mean("pose10hz_total"),
        pose10hz_aligned_mean=mean("pose10hz_aligned_total"),
        ns_per_event=float(np.mean(costs)) if costs else None,
    )


def _bootstrap(deltas: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> tuple[float, float, float]:
    # Seeded anew for each: an interval then depends on its own trials alone, not on what else was evaluated.
    rng = np.random.default_rng(_SEED)
    means = deltas[rng.integers(0, len(deltas), (_RESAMPLES, len(deltas)))].mean(axis=1)
    low, high = np.percentile(means, (2.5, 97.5))
    return float(deltas.mean()), float(low), float(high)
