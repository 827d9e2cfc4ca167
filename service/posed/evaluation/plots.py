"""An evaluation as pictures: SVG that takes its ink from the colour scheme of who looks at it."""

import io
import math
from collections.abc import Sequence
from typing import Any

from posed.errors import MissingExtraError
from posed.evaluation.evaluate import PHONE, Result
from posed.evaluation.rates import MODES
from posed.evaluation.summary import Summary

_INK = "#123456"
"""Drawn with, and replaced by the scheme's own: no colour of a filter."""
_STYLE = "<style>svg{color:#222;--grid:#0002}@media(prefers-color-scheme:dark){svg{color:#ddd;--grid:#fff3}}</style>"
# Readable on white and on near black.
_COLOURS = ("#2f7ed8", "#e0782f", "#2f9e5b", "#b65fc9", "#c9a227", "#d0485c", "#1aa5a5", "#8a8a8a")


def require_matplotlib() -> None:
    """Raise MissingExtraError with the remedy if matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError("plots need matplotlib: pip install 'posed[plot]'") from error


def colours(filters: Sequence[str]) -> dict[str, str]:
    """Return a colour for each filter."""
    return {name: _COLOURS[index % len(_COLOURS)] for index, name in enumerate(filters)}


def bars_of_modes(summaries: Sequence[Summary], colour: dict[str, str]) -> str:
    """Return the mean total error of each filter by mode, for one data set, as SVG."""
    modes = [mode for mode in MODES if any(each.mode == mode for each in summaries)]
    values = {(each.mode, each.filter): each.total_mean for each in summaries}
    return _grouped_bars(modes, [name for name in colour if any(n == name for _, n in values)], values, colour)


def bars_of_groups(groups: Sequence[Summary], mode: str, colour: dict[str, str]) -> str:
    """Return the mean total error by group at a mode (the phone's own always), for one data set, as SVG."""
    chosen = [each for each in groups if each.mode == mode or each.filter == PHONE]
    names = list(dict.fromkeys(each.group for each in chosen))
    values = {(each.group, each.filter): each.total_mean for each in chosen}
    return _grouped_bars(names, [name for name in colour if any(n == name for _, n in values)], values, colour)


def bars_of_trials(results: Sequence[Result], mode: str, colour: dict[str, str]) -> str:
    """Return the total error by trial at a mode (the phone's own always), for one data set, as SVG."""
    chosen = [each for each in results if each.mode == mode or each.filter == PHONE]
    names = list(dict.fromkeys(each.trial for each in chosen))
    values = {(each.trial, each.filter): each.total for each in chosen}
    return _grouped_bars(names, [name for name in colour if any(n == name for _, n in values)], values, colour, True)


def error_over_time(results: Sequence[Result], colour: dict[str, str]) -> str:
    """Return the error of each filter over one trial's time, as SVG; what does not count is left blank."""
    figure, axes = _figure(9.0, 2.6)
    for each in results:
        if each.curve is not None:
            axes.plot(each.curve.seconds, each.curve.error, color=colour[each.filter], linewidth=1.2, label=each.filter)
    axes.set_xlabel("s")
    axes.set_ylabel("total error, °")
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)
    _finish(axes)
    return _svg(figure)


def _grouped_bars(
    names: Sequence[str],
    filters: Sequence[str],
    values: dict[tuple[str, str], float],
    colour: dict[str, str],
    lying: bool = False,
) -> str:
    from matplotlib.ticker import LogLocator, NullLocator

    width = 0.8 / max(1, len(filters))
    figure, axes = _figure(9.0, 1.0 + 0.16 * len(names) * (len(filters) + 1) if lying else 3.2)
    drawn = [value for value in values.values() if math.isfinite(value)]
    for index, name in enumerate(filters):
        places = [place + (index - (len(filters) - 1) / 2) * width for place in range(len(names))]
        heights = [values.get((each, name), math.nan) for each in names]
        draw = axes.barh if lying else axes.bar
        bars = draw(places, heights, width, color=colour[name], label=name)
        labels = ["" if math.isnan(height) else f"{height:.1f}" for height in heights]
        axes.bar_label(bars, labels, padding=1, fontsize=6, color=_INK)
    if lying:
        axes.set_yticks(range(len(names)), names, fontsize=7)
        axes.invert_yaxis()
        axes.margins(y=0.01)
        axes.set_xlabel("total RMSE, °")
    else:
        slanted = {"rotation": 30, "ha": "right", "rotation_mode": "anchor"} if len(names) > 6 else {}
        axes.set_xticks(range(len(names)), names, fontsize=8, **slanted)
        axes.set_ylabel("mean total RMSE, °")
    # An aliased mode is ten times worse than the rest: on a linear scale it would leave the rest invisible.
    if drawn and max(drawn) > 12.0 * min(drawn) > 0.0:
        (axes.set_xscale if lying else axes.set_yscale)("log")
        axis = axes.xaxis if lying else axes.yaxis
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(NullLocator())
        (axes.set_xlim if lying else axes.set_ylim)(0.5 * min(drawn), 1.6 * max(drawn))
    elif drawn:
        (axes.set_xlim if lying else axes.set_ylim)(0.0, 1.12 * max(drawn))
    _finish(axes, "x" if lying else "y")
    return _svg(figure)


def _figure(width: float, height: float) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots()


def _finish(axes: Any, grid: str = "both") -> None:
    axes.grid(axis=grid, color=_INK, alpha=0.15, linewidth=0.6)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(_INK)
    axes.tick_params(colors=_INK, which="both")
    axes.xaxis.label.set_color(_INK)
    axes.yaxis.label.set_color(_INK)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=8, labelcolor=_INK, ncols=8, loc="lower left", bbox_to_anchor=(0.0, 1.0))


def _svg(figure: Any) -> str:
    from matplotlib import rc_context

    file = io.StringIO()
    # Without the salt and the date, the same figures would give other bytes each time.
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "posed", "font.family": "sans-serif"}):
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = file.getvalue()
    text = text[text.index("<svg") :].replace(_INK, "currentColor")
    head, rest = text.split(">", 1)
    return f"{head}>{_STYLE}{rest}"
