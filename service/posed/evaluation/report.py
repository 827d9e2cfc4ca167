"""An evaluation as tables, JSON and Markdown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from posed.evaluation.evaluate import Evaluation, Result
from posed.evaluation.summary import Difference, Summary, differences, group_summaries, summaries


@dataclass(frozen=True, slots=True)
class ReportTable:
    """A table as any output shows it; the first `labels` columns are words, the others figures."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    labels: int
    sections: tuple[int, ...] = ()
    """Rows behind which something new begins."""


NOTES = (
    "Errors are RMSE in degrees by BROAD's definitions, over the instants that count, at the gyroscope samples.",
    "10 Hz: of the pose as a client sees it, the newest held at each grid instant, so that lag counts; aligned: turned"
    " on to that instant by its angular rate.",
    "ns: CPU time an event. vqf's is of its batch form at the gyroscope's rate, imufusion's of its update.",
    "Difference: mean over trials of the filter's total minus that of the first, with the 95 % interval of 10,000"
    " bootstrap resamples of the trials.",
)


def tables(evaluation: Evaluation) -> list[ReportTable]:
    """Return the tables of the report: for each data set its means, its groups, its trials."""
    results = evaluation.results
    against = {
        (each.dataset, each.mode, each.filter): each for each in differences(results, evaluation.plan.filters[0])
    }
    found = []
    for dataset in dict.fromkeys(result.dataset for result in results):
        own = [each for each in summaries(results) if each.dataset == dataset]
        found.append(_summary_table(dataset, evaluation.plan.filters[0], own, against))
        groups = [each for each in group_summaries(results) if each.dataset == dataset]
        if groups:
            found.append(_group_table(dataset, groups))
        found.append(_trial_table(dataset, [result for result in results if result.dataset == dataset]))
    return found


def as_json(evaluation: Evaluation) -> dict[str, Any]:
    """Return results and summary as JSON holds them, NaN as null; behind them what only this report has."""
    results = evaluation.results
    return {
        "results": [
            {
                "dataset": each.dataset,
                "trial": each.trial,
                "groups": list(each.groups),
                "filter": each.filter,
                "mode": each.mode,
                "total": _number(each.total),
                "heading": _number(each.heading),
                "inclination": _number(each.inclination),
                "pose10hz_total": _number(each.pose10hz_total),
                "ns_per_event": _number(each.ns_per_event),
            }
            for each in results
        ],
        "summary": [
            {
                "dataset": each.dataset,
                "filter": each.filter,
                "mode": each.mode,
                "trials": each.trials,
                "total_mean": _number(each.total_mean),
                "total_median": _number(each.total_median),
                "heading_mean": _number(each.heading_mean),
                "inclination_mean": _number(each.inclination_mean),
            }
            for each in summaries(results)
        ],
        "groups": [
            {
                "dataset": each.dataset,
                "group": each.group,
                "filter": each.filter,
                "mode": each.mode,
                "trials": each.trials,
                "total_mean": _number(each.total_mean),
                "total_median": _number(each.total_median),
            }
            for each in group_summaries(results)
        ],
        "poses": [
            {
                "dataset": each.dataset,
                "filter": each.filter,
                "mode": each.mode,
                "pose10hz_total_mean": _number(each.pose10hz_mean),
                "pose10hz_aligned_total_mean": _number(each.pose10hz_aligned_mean),
            }
            for each in summaries(results)
        ],
        "differences": [
            {
                "dataset": each.dataset,
                "mode": each.mode,
                "filter": each.filter,
                "against": each.against,
                "trials": each.trials,
                "total_mean": _number(each.mean),
                "low": _number(each.low),
                "high": _number(each.high),
            }
            for each in differences(results, evaluation.plan.filters[0])
        ],
        "skipped": [{"path": each.path, "reason": each.reason} for each in evaluation.skipped],
    }


def as_markdown(evaluation: Evaluation) -> str:
    """Return the report as Markdown."""
    parts = ["# Orientation error"]
    for table in tables(evaluation):
        rule = [":--"] * table.labels + ["--:"] * (len(table.header) - table.labels)
        lines = [_markdown_row(table.header), _markdown_row(rule), *map(_markdown_row, table.rows)]
        parts += [f"## {table.title}", "\n".join(lines)]
    parts += ["\n".join(f"- {note}" for note in NOTES)]
    if evaluation.skipped:
        lines = [f"- {each.reason}" for each in evaluation.skipped]
        parts += [f"## {len(evaluation.skipped)} skipped", "\n".join(lines)]
    return "\n\n".join(parts) + "\n"


def degrees(value: float) -> str:
    """Return degrees as a report shows them, a dash for NaN."""
    return "-" if math.isnan(value) else f"{value:.2f}"


def _summary_table(
    dataset: str, first: str, own: Sequence[Summary], against: dict[tuple[str, str, str], Difference]
) -> ReportTable:
    rows = []
    for each in own:
        delta = against.get((dataset, each.mode, each.filter))
        rows.append(
            (
                each.mode,
                each.filter,
                str(each.trials),
                degrees(each.total_mean),
                degrees(each.total_median),
                degrees(each.heading_mean),
                degrees(each.inclination_mean),
                degrees(each.pose10hz_mean),
                degrees(each.pose10hz_aligned_mean),
                "-" if each.ns_per_event is None else f"{each.ns_per_event:.0f}",
                "" if delta is None else _interval(delta),
            )
        )
    header = ("mode", "filter", "trials", "mean", "median", "heading", "incl.", "10 Hz", "aligned", "ns", f"- {first}")
    return ReportTable(f"{dataset}: means over trials", header, tuple(rows), 2, _ends(rows))


def _interval(delta: Difference) -> str:
    return "-" if math.isnan(delta.mean) else f"{delta.mean:+.2f} [{delta.low:+.2f}, {delta.high:+.2f}]"


def _group_table(dataset: str, groups: Sequence[Summary]) -> ReportTable:
    filters = list(dict.fromkeys(each.filter for each in groups))
    cells = {(each.group, each.mode, each.filter): each for each in groups}
    rows = []
    for group, mode in dict.fromkeys((each.group, each.mode) for each in groups):
        found = [cells.get((group, mode, name)) for name in filters]
        trials = max(each.trials for each in found if each is not None)
        rows.append((group, mode, str(trials), *("" if each is None else degrees(each.total_mean) for each in found)))
    title = f"{dataset}: mean total error of each group"
    return ReportTable(title, ("group", "mode", "trials", *filters), tuple(rows), 2, _ends(rows))


def _trial_table(dataset: str, results: Sequence[Result]) -> ReportTable:
    filters = list(dict.fromkeys(each.filter for each in results))
    cells = {(each.trial, each.mode, each.filter): each for each in results}
    rows = []
    for trial, mode in dict.fromkeys((each.trial, each.mode) for each in results):
        found = [cells.get((trial, mode, name)) for name in filters]
        rows.append((trial, mode, *("" if each is None else degrees(each.total) for each in found)))
    title = f"{dataset}: total error of each trial"
    return ReportTable(title, ("trial", "mode", *filters), tuple(rows), 2, _ends(rows))


def _ends(rows: Sequence[Sequence[str]]) -> tuple[int, ...]:
    return tuple(index for index in range(len(rows) - 1) if rows[index][0] != rows[index + 1][0])


def _markdown_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def _number(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
