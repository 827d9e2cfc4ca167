"""`posed profile`: what each rate mode costs."""

import argparse
import contextlib
import json
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posed.cli.options import (
    RATE_MODES,
    add_daemon_options,
    daemon_command_line,
    given_daemon_options,
    positive_count,
    positive_seconds,
)
from posed.errors import InvalidArgumentError

if TYPE_CHECKING:
    from posed.cli.profiling.daemons import Daemon
    from posed.cli.profiling.report import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is measured, for how long, and how it is shown."""
    parser.add_argument("command", nargs="*", metavar="-- CMD", help="measure with this client instead of ours")
    parser.add_argument(
        "--modes", type=_modes, default=RATE_MODES, metavar="A,B", help=f"rate modes (default: {','.join(RATE_MODES)})"
    )
    parser.add_argument(
        "--seconds", type=positive_seconds, default=3.0, metavar="S", help="each run takes this long (default: 3)"
    )
    parser.add_argument(
        "--repeats", type=positive_count, default=5, metavar="N", help="runs of each mode and kind (default: 5)"
    )
    parser.add_argument("--attach", action="store_true", help="measure the running daemon instead of one a mode")
    parser.add_argument(
        "--with-ar", action="store_true", help="measure posed ar too, with its page in a headless Chromium"
    )
    shown = parser.add_argument_group("output")
    shown.add_argument("--json", nargs="?", const="-", metavar="FILE", help="write JSON, to stdout without FILE")
    shown.add_argument("--markdown", action="store_true", help="print Markdown instead of a table for the terminal")
    shown.add_argument("--plot", type=Path, metavar="FILE.png", help="draw the cost beside the paper's")
    add_daemon_options(parser)
    parser.epilog = """\
Each mode gets a daemon of its own, out of sight of yours, and in turn a client that takes the pose at 10 Hz, one that
takes accelerometer, gyroscope and magnetic field each as it happens, and one that takes them 100 ms late at most. The
modes alternate, repeat by repeat: five minutes with the default modes, seconds and repeats, and eight more with
--with-ar. A replay is looped.

-- CMD runs your own client, stopped after each run; {mode} in it becomes the mode's name, and without that it chooses
its mode itself. It finds the daemon by XDG_RUNTIME_DIR. Its CPU is that of all the processes it starts.

--attach finds out what our clients cost on top of what your daemon does already, which is shown as idle. Nothing is
forced on it: a faster mode that one of your own clients asks for stays in force."""


def run(arguments: argparse.Namespace) -> int:
    """Measure, then show."""
    options = given_daemon_options(arguments)
    if arguments.attach and options:
        raise InvalidArgumentError(
            f"--attach measures the daemon as it runs, so --{next(iter(options)).replace('_', '-')} has no use;"
            " leave one of them out"
        )
    if arguments.plot is not None:
        from posed.cli.profiling.plot import require_matplotlib

        require_matplotlib()
    if arguments.with_ar:
        from posed.cli.profiling.ar_client import find_browser

        find_browser()
    _show(_measure(arguments, options), arguments)
    return 0


def _measure(arguments: argparse.Namespace, options: dict[str, Any]) -> "Report":
    from posed.cli.profiling.measurement import measure, steps
    from posed.cli.profiling.report import report

    with _daemons(arguments, options) as daemons:
        wanted = {"with_ar": arguments.with_ar}
        with _progress(steps(len(daemons), arguments.repeats, arguments.command, **wanted)) as progress:
            runs = measure(daemons, arguments.seconds, arguments.repeats, arguments.command, progress, **wanted)
    return report(runs)


@contextlib.contextmanager
def _daemons(arguments: argparse.Namespace, options: dict[str, Any]) -> "Iterator[dict[str, Daemon]]":
    """Yield the daemon of each mode."""
    from posed.cli.profiling.daemons import Daemon, PrivateDaemon

    if arguments.attach:
        yield dict.fromkeys(arguments.modes, Daemon())
        return
    if options.get("source", "").startswith("replay:"):
        options = {**options, "loop": True}
    # Daemons that nobody knows of must not outlive this process.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with contextlib.ExitStack() as stack:
        yield {mode: stack.enter_context(PrivateDaemon(daemon_command_line(options))) for mode in arguments.modes}


@contextlib.contextmanager
def _progress(steps: int) -> Iterator[Callable[[str], None]]:
    """Yield what to tell of each step; it shows on stderr if that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda doing: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:24}"), BarColumn(), TimeRemainingColumn())
    # Redrawn between the steps only: the processor is what is being measured.
    with Progress(*columns, console=Console(stderr=True), auto_refresh=False, transient=True) as bar:
        task = bar.add_task("", total=steps)
        begun = 0

        def tell(doing: str) -> None:
            nonlocal begun
            bar.update(task, completed=begun, description=doing, refresh=True)
            begun += 1

        yield tell


def _show(report: "Report", arguments: argparse.Namespace) -> None:
    from posed.cli.profiling.report import as_json
    from posed.cli.profiling.table import markdown, print_table

    if arguments.plot is not None:
        from posed.cli.profiling.plot import save_plot

        save_plot(report, arguments.plot)
    text = json.dumps(as_json(report), indent=2) + "\n"
    if arguments.json == "-":
        sys.stdout.write(text)
        return
    if arguments.json is not None:
        try:
            Path(arguments.json).write_text(text)
        except OSError as error:
            raise InvalidArgumentError(f"cannot write {arguments.json}: {error.strerror}") from error
    if arguments.markdown:
        sys.stdout.write(markdown(report))
    else:
        print_table(report)


def _modes(text: str) -> tuple[str, ...]:
    modes = tuple(dict.fromkeys(word.strip().upper() for word in text.split(",")))
    unknown = [mode for mode in modes if mode not in RATE_MODES]
    if unknown:
        raise argparse.ArgumentTypeError(f"{unknown[0]!r} is no rate mode; give some of {','.join(RATE_MODES)}")
    return modes
