"""A report as a table: for the terminal, and in Markdown."""

import sys

from posed.cli.profiling.ar_client import WINDOW
from posed.cli.profiling.report import INPUTS, PAPER, ModeReport, Repeated, Report

PAPER_CAPTION = (
    "paper: Patonis et al. 2018, Table 2; its CPU is that of a whole AR application, in percent of a tablet with"
    " four cores"
)


# A rule in front of these rows.
_FIRST_OF_COST = "daemon CPU %"

_FIGURES = (
    (_FIRST_OF_COST, "daemon_cpu_percent", 2),
    ("- its source", "source_cpu_percent", 2),
    ("- its filter", "kernel_cpu_percent", 2),
    ("client CPU %", "client_cpu_percent", 2),
    ("wake-ups/s", "wakeups_per_s", 1),
    ("RSS MB", "rss_mb", 1),
    ("daemon CPU %, raw batched", "batched_cpu_percent", 2),
    ("daemon CPU %, raw streamed", "streaming_cpu_percent", 2),
    ("AR application CPU %", "ar_cpu_percent", 1),
    ("- daemon", "ar_daemon_cpu_percent", 2),
    ("- server", "ar_server_cpu_percent", 2),
    ("- page", "ar_page_cpu_percent", 1),
    ("AR with the drawn world", "ar_world_cpu_percent", 1),
)


def rows(report: Report) -> list[list[str]]:
    """Return the cells as they are shown, a column a mode; the first row and the first column are headings."""
    modes = list(report.modes.values())
    shown = [["", *report.modes]]
    for name in INPUTS:
        shown.append([f"{name.replace('_', ' ')} Hz", *(_sensor(mode, name) for mode in modes)])
    shown.append(["events/s", *(f"{mode.events_per_s.median:.1f}" for mode in modes)])
    shown.append(["- the paper's", *(str(PAPER[name].events_per_s) for name in report.modes)])
    for label, figure, digits in _FIGURES:
        values: list[Repeated | None] = [getattr(mode, figure) for mode in modes]
        cells = [_marked(*pair, digits) for pair in zip(values, [None, *values], strict=False)]
        if any(values):
            shown.append([label, *cells])
    shown.append(["lateness p50 / p99 ms", *(f"{m.lateness_p50_ms:.2f} / {m.lateness_p99_ms:.2f}" for m in modes)])
    shown.append(["the paper's CPU %", *(str(PAPER[name].cpu_percent) for name in report.modes)])
    return shown


def notes(report: Report) -> list[str]:
    """Return what a reader of the tables has to know, a sentence or two each."""
    idle, machine = report.idle, report.machine
    lines = [
        "Hz: asked > configured > measured at a client. CPU: percent of one core, idle subtracted. Figures: median"
        " (spread = largest - smallest); ~ no further from the mode to the left than the spread.",
        f"idle, without our client: {_value(idle.daemon_cpu_percent, 3)} % CPU,"
        f" {_value(idle.wakeups_per_s, 1)} wake-ups/s, {idle.rss_mb.median:.1f} MB.",
        f"{PAPER_CAPTION}.",
        f"machine: {machine['cpu_model']}, {machine['cores']} cores, Linux {machine['kernel']}, Python"
        f" {machine['python']}, libzmq {machine['libzmq']}, protobuf {machine['protobuf']}.",
    ]
    if any(each.streaming_cpu_percent for each in report.modes.values()):
        lines.insert(
            1,
            "raw: accelerometer, gyroscope and magnetic field instead of poses, each event as it happens (streamed) or"
            " 100 ms late at most (batched).",
        )
    if any(each.ar_cpu_percent for each in report.modes.values()):
        lines.insert(
            -2,
            "AR application: daemon, posed ar, and its page over a still picture in a headless Chromium of"
            f" {WINDOW[0]} x {WINDOW[1]} pixels, all its processes, drawing without a GPU: the overlay at 10 Hz, as the"
            " paper's. The drawn world that stands for a camera is drawn at the display's rate.",
        )
    for mode, each in report.modes.items():
        if each.modes_in_force and each.modes_in_force != (mode,):
            lines.append(
                f"{mode} was asked and {', '.join(each.modes_in_force)} was in force: the fastest mode that any client"
                " asks for wins."
            )
    return lines


def print_table(report: Report) -> None:
    """Print the report on stdout for people."""
    from rich.console import Console
    from rich.table import Table

    # A pipe has no width of its own, and rich would fold the table at 80.
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 120)
    header, *body = rows(report)
    table = Table()
    for column, name in enumerate(header):
        table.add_column(name, justify="right" if column else "left")
    for row, below in zip(body, [*body[1:], [""]], strict=True):
        table.add_row(*row, end_section=below[0] == _FIRST_OF_COST)
    console.print(table)
    for line in notes(report):
        console.print(line, markup=False)


def markdown(report: Report) -> str:
    """Return the report as Markdown."""
    header, *body = rows(report)
    rule = ["---", *["---:"] * (len(header) - 1)]
    lines = ["| " + " | ".join(cells) + " |" for cells in (header, rule, *body)]
    return "\n".join([*lines, "", *(f"- {line}" for line in notes(report))]) + "\n"


def _sensor(mode: ModeReport, name: str) -> str:
    hz = mode.sensor_hz.get(name)
    if hz is None:
        return "-"
    measured = "-" if hz.measured is None else f"{hz.measured:.1f}"
    return f"{hz.asked:.4g} > {hz.configured:.4g} > {measured}"


def _marked(figure: Repeated | None, left: Repeated | None, digits: int) -> str:
    if figure is None:
        return "-"
    alike = left is not None and figure.spread is not None and not figure.differs_from(left)
    return f"{'~ ' if alike else ''}{_value(figure, digits)}"


def _value(figure: Repeated, digits: int) -> str:
    # With a client a daemon may measure a hair below idle: no minus in front of a zero.
    median = round(figure.median, digits) + 0.0
    return f"{median:.{digits}f}" + ("" if figure.spread is None else f" ({figure.spread:.{digits}f})")
