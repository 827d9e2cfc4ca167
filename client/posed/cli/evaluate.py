"""`posed evaluate`: filters against recordings with truth."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from posed.cli.options import positive_count
from posed.errors import InvalidArgumentError
from posed.evaluation.attitude_trials import CalibrationChoice
from posed.evaluation.evaluate import PHONE, Evaluation, Plan, evaluate
from posed.evaluation.rates import MODES, ModeName
from posed.evaluation.report import NOTES, ReportTable, as_json, as_markdown, tables
from posed.evaluation.trials import find_trials
from posed.fusion import DEFAULT_FILTER, FILTERS, PACKAGED

EX_DATAERR = 65
_DEFAULT_FILTERS = (DEFAULT_FILTER, "dcm")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is evaluated on what, and where the report goes."""
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="a trial, or a folder of trials")
    parser.add_argument(
        "--filters",
        type=_names,
        default=_DEFAULT_FILTERS,
        metavar="A,B",
        help=f"of {', '.join((*sorted(FILTERS), *PACKAGED, PHONE))} (default: {','.join(_DEFAULT_FILTERS)})",
    )
    parser.add_argument(
        "--modes", type=_modes, default=MODES, metavar="A,B", help=f"rate modes (default: {','.join(MODES)})"
    )
    parser.add_argument(
        "--calibration",
        choices=[each.value for each in CalibrationChoice],
        default=CalibrationChoice.OWN.value,
        help="of a phone's magnetometer and gyroscope: fitted of recordings made for it, or Android's (default: own)",
    )
    parser.add_argument(
        "--jobs", type=positive_count, metavar="N", help="trials at a time, each a process (default: one a core)"
    )
    shown = parser.add_argument_group("output")
    shown.add_argument("--json", type=Path, metavar="FILE", help="write JSON: results of each trial, and their summary")
    shown.add_argument("--markdown", type=Path, metavar="FILE", help="write the tables as Markdown")
    shown.add_argument("--html", type=Path, metavar="FILE", help="write one HTML file with the tables and plots")
    parser.epilog = f"""\
A trial is a .mat of BROAD, a folder of the smartphone attitude data set, or a .csv with truth:

  sensor,timestamp_ns,x,y,z,w
  accelerometer,1000000,0.02,0.11,9.80,
  truth,2000000,0.0,0.0,0.7071,0.7071

with rows of gyroscope (rad/s), accelerometer (m/s2) and magnetic_field (uT), and truth as a quaternion from device axes
to east, magnetic north, up. In a folder they are found at any depth.

native is every event as recorded; the modes are the rates of the paper's tablet: the gyroscope by interval mean, the
others by nearest sample. {PHONE} is the phone's own rotation vector, where recorded.

game and geomag are to be judged on inclination: the heading of game is free, as it has no magnetometer, and that of
geomag noisy, as it has no gyroscope.

JSON: "results" has dataset, trial, groups, filter, mode; total, heading, inclination, pose10hz_total (RMSE, degrees);
ns_per_event (CPU time). "summary" has dataset, filter, mode, trials, total_mean, total_median, heading_mean,
inclination_mean. Also "groups", "poses", "differences" and "skipped".

What cannot be read is named, skipped and counted; the exit code is then {EX_DATAERR}."""


def run(arguments: argparse.Namespace) -> int:
    """Evaluate, show and write."""
    if arguments.html:
        from posed.evaluation.html_report import require_matplotlib

        require_matplotlib()
    plan = Plan(arguments.filters, arguments.modes, CalibrationChoice(arguments.calibration))
    plan.check()
    trials = find_trials(arguments.paths)
    for path in (arguments.json, arguments.markdown, arguments.html):
        if path:
            _require_writable(path)
    with _progress(len(trials)) as on_trial:
        evaluation = evaluate(trials, plan, jobs=arguments.jobs, on_trial=on_trial)
    for skipped in evaluation.skipped:
        print(f"posed: skipped: {skipped.reason}", file=sys.stderr)
    if evaluation.results:
        # First what is kept: the reader of what is shown may leave, as `head` does.
        _write(evaluation, arguments)
        _show(evaluation)
    if evaluation.skipped:
        count = len(evaluation.skipped)
        print(f"posed: {count} of {len(trials)} trials skipped, {len(trials) - count} evaluated", file=sys.stderr)
        return EX_DATAERR
    if not evaluation.results:
        names = ", ".join(plan.filters)
        raise InvalidArgumentError(f"no trial has what {names} needs: there is nothing to show; name another filter")
    return 0


def _show(evaluation: Evaluation) -> None:
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 130)
    for each in tables(evaluation):
        # Not as the table's own title: that is folded to the table's width.
        console.print(each.title, style="bold")
        console.print(_rich(each))
    for note in NOTES:
        console.print(note)


def _rich(shown: ReportTable) -> Table:
    table = Table()
    for index, name in enumerate(shown.header):
        table.add_column(name, justify="left" if index < shown.labels else "right", overflow="fold")
    for index, row in enumerate(shown.rows):
        table.add_row(*row, end_section=index in shown.sections)
    return table


def _write(evaluation: Evaluation, arguments: argparse.Namespace) -> None:
    if arguments.json:
        _save(arguments.json, json.dumps(as_json(evaluation), indent=1, allow_nan=False) + "\n")
    if arguments.markdown:
        _save(arguments.markdown, as_markdown(evaluation))
    if arguments.html:
        from posed.evaluation.html_report import as_html

        _save(arguments.html, as_html(evaluation))


def _require_writable(path: Path) -> None:
    """Raise InvalidArgumentError now, not after minutes of work."""
    is_new = not path.exists()
    try:
        with path.open("a"):
            pass
        if is_new:
            path.unlink()
    except OSError as error:
        raise InvalidArgumentError(f"cannot write {path}: {error.strerror}; name a file that can be written") from error


def _save(path: Path, content: str) -> None:
    path.write_text(content, encoding="utf-8")
    print(f"posed: wrote {path}", file=sys.stderr)


@contextmanager
def _progress(count: int) -> Iterator[Callable[[Path], None]]:
    """Yield what moves a bar on stderr on by one trial; silent unless that is a terminal."""
    with Progress(
        TextColumn("trials"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty(),
        transient=True,
    ) as progress:
        bar = progress.add_task("", total=count)
        yield lambda path: progress.update(bar, advance=1, description=path.name)


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _modes(text: str) -> Sequence[ModeName]:
    known = {mode.lower(): mode for mode in MODES}
    chosen = []
    for name in _names(text):
        if name.lower() not in known:
            raise argparse.ArgumentTypeError(f"{name!r} is no mode; allowed: {', '.join(MODES)}")
        chosen.append(known[name.lower()])
    return tuple(chosen)
