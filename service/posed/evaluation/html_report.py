"""An evaluation as one HTML file that needs nothing else: tables and plots, in light and dark."""

import base64
from collections.abc import Sequence
from html import escape
from string import Template

from posed.evaluation.evaluate import Evaluation, Result
from posed.evaluation.plots import (
    bars_of_groups,
    bars_of_modes,
    bars_of_trials,
    colours,
    error_over_time,
    require_matplotlib,
)
from posed.evaluation.report import NOTES, ReportTable, tables
from posed.evaluation.summary import group_summaries, summaries

__all__ = ["as_html", "require_matplotlib"]


def as_html(evaluation: Evaluation) -> str:
    """Return the report; raises MissingExtraError without matplotlib."""
    require_matplotlib()
    results = evaluation.results
    colour = colours(evaluation.plan.filters)
    shown = tables(evaluation)
    # Not that of the first result: the phone's own are native, whatever was asked for.
    mode = evaluation.plan.modes[0]
    parts = []
    for dataset in dict.fromkeys(result.dataset for result in results):
        own = [result for result in results if result.dataset == dataset]
        groups = group_summaries(own)
        parts.append(f"<h2>{escape(dataset)}</h2>")
        parts.append(_plot("Mean total error by mode", bars_of_modes(summaries(own), colour)))
        if groups:
            parts.append(_plot(f"Mean total error by group, {mode}", bars_of_groups(groups, mode, colour)))
        parts.append(_plot(f"Total error by trial, {mode}", bars_of_trials(own, mode, colour)))
        for table in shown:
            if table.title.startswith(f"{dataset}:"):
                parts.append(_table(table, folded=table is not shown[0]))
        parts.append(_curves(own, mode, colour))
    if evaluation.skipped:
        items = "".join(f"<li>{escape(each.reason)}</li>" for each in evaluation.skipped)
        parts.append(f"<h2>{len(evaluation.skipped)} skipped</h2><ul>{items}</ul>")
    notes = "".join(f"<li>{escape(note)}</li>" for note in NOTES)
    return _PAGE.substitute(body="\n".join(parts), notes=notes, subject=_subject(evaluation))


def _subject(evaluation: Evaluation) -> str:
    trials = {(result.dataset, result.trial) for result in evaluation.results}
    return escape(f"{', '.join(evaluation.plan.filters)} on {len(trials)} trials")


def _curves(results: Sequence[Result], mode: str, colour: dict[str, str]) -> str:
    plots = []
    for trial in dict.fromkeys(result.trial for result in results):
        chosen = [result for result in results if result.trial == trial and result.curve is not None]
        plots.append(_plot(trial, error_over_time(chosen, colour)))
    return f"<details><summary>Error over time, {escape(mode)}</summary>{''.join(plots)}</details>"


def _plot(caption: str, svg: str) -> str:
    data = base64.b64encode(svg.encode()).decode()
    image = f'<img alt="{escape(caption)}" src="data:image/svg+xml;base64,{data}">'
    return f"<figure><figcaption>{escape(caption)}</figcaption>{image}</figure>"


def _table(table: ReportTable, *, folded: bool) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        kinds = [' class="word"' if index < table.labels else "" for index in range(len(cells))]
        return "".join(f"<{tag}{kind}>{escape(cell)}</{tag}>" for kind, cell in zip(kinds, cells, strict=True))

    body = "".join(
        f"<tr{' class=end' if index in table.sections else ''}>{row(cells, 'td')}</tr>"
        for index, cells in enumerate(table.rows)
    )
    grid = (
        f"<div class=wide><table><thead><tr>{row(table.header, 'th')}</tr></thead><tbody>{body}</tbody></table></div>"
    )
    return f"<details{'' if folded else ' open'}><summary>{escape(table.title)}</summary>{grid}</details>"


_PAGE = Template("""\
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>Orientation error: $subject</title>
<style>
:root { color-scheme: light dark; --ink: #222; --paper: #fff; --line: #ddd; --faint: #666 }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --paper: #16181c; --line: #3a3d44; --faint: #999 } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 62rem;
  margin: 0 auto; padding: 1rem }
h1 { font-size: 1.5rem; margin-bottom: 0 }
h2 { margin-top: 2.5rem; border-bottom: 1px solid var(--line) }
figure { margin: 1.5rem 0 }
figcaption { font-weight: 600 }
img { width: 100%; height: auto }
summary { cursor: pointer; font-weight: 600; margin: 0.8rem 0 }
.wide { overflow-x: auto }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px }
th, td { text-align: right; padding: 0.15rem 0.7rem 0.15rem 0; white-space: nowrap }
.word { text-align: left }
thead th, tr.end td { border-bottom: 1px solid var(--line) }
ul { color: var(--faint); font-size: 13px; padding-left: 1.2rem }
</style>
<h1>Orientation error</h1>
<p>$subject</p>
$body
<h2>Notes</h2>
<ul>$notes</ul>
</html>
""")
