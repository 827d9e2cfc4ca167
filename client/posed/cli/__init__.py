"""The `posed` command: a table of subcommands, each imported only when it is called.

A subcommand's module has `add_arguments(parser)` and `run(arguments) -> int`, which returns the exit code.

Exit codes: 0 done; 1 an error that one line on stderr explains; 2 usage; 3 `posed status` found no daemon; 65
`posed evaluate` could not read some of the trials (EX_DATAERR); 69 the daemon is not there, did not come up or does not
answer (EX_UNAVAILABLE); 75 another daemon runs already (EX_TEMPFAIL).
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from posed.errors import AlreadyRunningError, PosedError, ServiceUnavailableError
from posed.version import __version__

COMMANDS: dict[str, tuple[str, str]] = {
    "demo": ("posed.cli.demo", "show the pose of a simulated phone, with a daemon of its own"),
    "serve": ("posed.cli.serve", "run the service daemon in the foreground"),
    "start": ("posed.cli.start", "start the daemon in the background"),
    "stop": ("posed.cli.stop", "stop the daemon"),
    "status": ("posed.cli.status", "say whether the daemon runs, and what it does"),
    "watch": ("posed.cli.watch", "show the fused pose as it comes"),
    "sensors": ("posed.cli.sensors", "list the sensors"),
    "events": ("posed.cli.events", "print a sensor's events as they come"),
    "set": ("posed.cli.set", "set what surrounds the simulated phone, such as light"),
    "dumpsys": ("posed.cli.dumpsys", "print the state of the sensor service, as Android does"),
    "fuse": ("posed.cli.fuse", "turn a recording into poses, without a daemon"),
    "evaluate": ("posed.cli.evaluate", "compare filters on recordings with truth"),
    "ar": ("posed.cli.ar", "open the AR page: georeferenced places held in place by the pose"),
    "verify": ("posed.cli.verify", "verify the running daemon as Android verifies a phone's sensors"),
    "profile": ("posed.cli.profile", "measure the CPU that each rate mode costs"),
}

EX_USAGE = 2
EX_UNAVAILABLE = 69
EX_TEMPFAIL = 75


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand and return the exit code; `--help`, `--version` and usage errors raise SystemExit."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if not arguments:
        _parser().print_help(sys.stderr)
        return EX_USAGE
    # Options before the subcommand take no value, so that the first word decides alone.
    command: str = _parser().parse_args(arguments[:1]).command
    try:
        module = import_module(COMMANDS[command][0])
        code: int = module.run(_parsed(command, module, arguments[1:]))
        sys.stdout.flush()
        return code
    except PosedError as error:
        print(f"posed: error: {error}", file=sys.stderr)
        return _exit_code(error)
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # The reader has had enough, as `head` does; Python would complain once more when it closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"posed: error: {error}", file=sys.stderr)
        return 1


def _parsed(command: str, module: Any, arguments: Sequence[str]) -> argparse.Namespace:
    """Return a subcommand's own arguments; its parser is gone then, and no part of a daemon's memory."""
    summary = COMMANDS[command][1]
    parser = argparse.ArgumentParser(
        prog=f"posed {command}",
        description=f"{summary[0].upper()}{summary[1:]}.",
        formatter_class=_HelpFormatter,
        allow_abbrev=False,
    )
    module.add_arguments(parser)
    return parser.parse_args(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="posed",
        description="A phone's sensor stack on a desk: Android's sensor service and\na fused pose as a Linux daemon.",
        epilog="'posed COMMAND --help' explains a command. To see it work: posed demo",
        formatter_class=_HelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands", required=True)
    for name, (_, summary) in COMMANDS.items():
        commands.add_parser(name, help=summary, add_help=False, formatter_class=_HelpFormatter)
    return parser


class _HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Asks the terminal itself for its width: argparse asks shutil, whose archives cost the daemon 0.5 MB."""

    def __init__(self, prog: str) -> None:
        try:
            columns = int(os.environ["COLUMNS"])
        except (KeyError, ValueError):
            columns = os.get_terminal_size(sys.stdout.fileno()).columns if sys.stdout.isatty() else 0
        super().__init__(prog, width=(columns or 80) - 2)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from posed.fusion.kernel import kernel

        print(f"posed {__version__}, filters {kernel()}")
        parser.exit()


def _exit_code(error: PosedError) -> int:
    if isinstance(error, AlreadyRunningError):
        return EX_TEMPFAIL
    return EX_UNAVAILABLE if isinstance(error, ServiceUnavailableError) else 1
