"""A report as a picture: the cost of each mode here, and in the paper."""

from pathlib import Path

from posed.cli.profiling.report import PAPER, Repeated, Report
from posed.cli.profiling.table import PAPER_CAPTION
from posed.errors import InvalidArgumentError, MissingExtraError

_PARTS = (
    ("daemon, 10 Hz pose", "daemon_cpu_percent", "tab:blue"),
    ("pose client", "client_cpu_percent", "tab:green"),
    ("daemon, raw events batched", "batched_cpu_percent", "tab:orange"),
    ("daemon, raw events streamed", "streaming_cpu_percent", "tab:red"),
)


def require_matplotlib() -> None:
    """Raise MissingExtraError with the remedy if matplotlib is not installed."""
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError("a plot needs matplotlib: pip install 'posed[plot]'") from error


def save_plot(report: Report, path: Path) -> None:
    """Write the picture, in the format that the name's ending says.

    Raises MissingExtraError without matplotlib, InvalidArgumentError if the file cannot be written.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    ours, papers = figure.subplots(1, 2, width_ratios=(2, 1))
    modes = list(report.modes)
    shown = [part for part in _PARTS if all(getattr(each, part[1]) is not None for each in report.modes.values())]
    width = 0.8 / len(shown)
    for index, (label, name, colour) in enumerate(shown):
        figures: list[Repeated] = [getattr(each, name) for each in report.modes.values()]
        ours.bar(
            [place + (index - (len(shown) - 1) / 2) * width for place in range(len(modes))],
            [each.median for each in figures],
            width,
            yerr=[(each.spread or 0.0) / 2 for each in figures],
            label=label,
            color=colour,
            capsize=2,
        )
    ours.set_title("posed: CPU, % of one core (bars: spread)")
    ours.legend()
    papers.bar(range(len(modes)), [PAPER[mode].cpu_percent for mode in modes], color="tab:gray")
    papers.set_title("paper: CPU, % of the tablet")
    for axes, rates in (
        (ours, [each.events_per_s.median for each in report.modes.values()]),
        (papers, [PAPER[mode].events_per_s for mode in modes]),
    ):
        axes.set_xticks(range(len(modes)), [f"{mode}\n{rate:.0f}/s" for mode, rate in zip(modes, rates, strict=True)])
        axes.set_xlabel("mode, sensor events")
        axes.set_ylim(bottom=0)
    figure.supxlabel(f"{PAPER_CAPTION}\nhere: {report.machine['cpu_model']}, idle subtracted", fontsize="small")
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(f"cannot write the plot {path}: {error}") from error
