"""`posed serve`: the daemon in the foreground."""

import argparse
import json
import logging
import os
import sys
import time
from pathlib import Path

from posed.cli.options import add_daemon_options, given_daemon_options

_UNIT = Path(__file__).with_name("posed.service")
# The unit names the place of a --user install; in a virtual environment the command stands beside the interpreter.
_COMMAND = Path(sys.executable).with_name("posed")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a daemon can be told."""
    add_daemon_options(parser)
    parser.add_argument("--bound", action="store_true", help="the daemon lives only while clients bind it")
    parser.epilog = f"""\
It serves until SIGTERM, Ctrl-C or 'posed stop'. Exit code 75: another daemon of this user runs already.

As a systemd user service:
  mkdir -p ~/.config/systemd/user
  sed 's|^ExecStart=.*|ExecStart={_COMMAND} serve|' {_UNIT} > ~/.config/systemd/user/posed.service
  systemctl --user enable --now posed"""


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to stop."""
    options = given_daemon_options(arguments)
    _log_to_stderr(options.pop("log_format", "text"))

    # Before numpy comes: its BLAS would start a thread a core, and the daemon multiplies nothing larger than 3 by 3.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from posed.daemon import DaemonConfig
    from posed.daemon import run as serve
    from posed.events import Position

    if "position" in options:
        options["position"] = Position(*options["position"])
    serve(DaemonConfig(**options, started=not arguments.bound))
    return 0


class JsonFormatter(logging.Formatter):
    """One JSON object a line: time (UTC), level, logger, message, and traceback where there is one."""

    def format(self, record: logging.LogRecord) -> str:
        stamp = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line = {
            "time": f"{stamp}.{int(record.msecs):03d}Z",
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            line["traceback"] = self.formatException(record.exc_info)
        return json.dumps(line)


def _log_to_stderr(log_format: str) -> None:
    handler = logging.StreamHandler()
    handler.setFormatter(
        JsonFormatter() if log_format == "json" else logging.Formatter("%(asctime)s %(levelname)s %(message)s")
    )
    logging.basicConfig(level=logging.INFO, handlers=[handler])
