"""`posed demo`: the pose of a simulated phone, from a daemon of its own that nobody else sees."""

import argparse
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from posed.cli.live_view import LiveView
from posed.cli.options import positive_seconds
from posed.cli.pose_text import pose_line
from posed.cli.watch import draw_poses, exit_on_signals, print_poses
from posed.client import PoseClient
from posed.client.launcher import daemon_listens, ensure_daemon

_SECONDS_OFF_TERMINAL = 10.0
# A daemon without a client ends within milliseconds; it is looked for until then, so that nothing is left behind.
_END_TIMEOUT_S = 3.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --seconds."""
    parser.add_argument(
        "--seconds",
        type=positive_seconds,
        metavar="N",
        help="end after N seconds (default: at Ctrl-C; after 10 where stdout is no terminal)",
    )
    parser.epilog = """\
A daemon of its own in a runtime directory of its own: one that runs already is not touched. Where stdout is no
terminal, each pose is a line."""


def run(arguments: argparse.Namespace) -> int:
    """Run daemon and view until Ctrl-C or the time is over."""
    exit_on_signals()
    view = LiveView()
    try:
        with _private_runtime_directory():
            ensure_daemon(("--bound",))
            with PoseClient(auto_create=True, every=True, on_service_connected=view.count_connection) as client:
                if sys.stdout.isatty():
                    draw_poses(client, view, seconds=arguments.seconds)
                else:
                    print_poses(client, pose_line, seconds=arguments.seconds or _SECONDS_OFF_TERMINAL)
    except KeyboardInterrupt:
        pass
    return 0


@contextmanager
def _private_runtime_directory() -> Iterator[None]:
    """Give this process and its children a runtime directory of their own, and remove it when its daemon has ended."""
    # Beside the user's own where there is one: a socket's path must be short, and that one is.
    base = os.environ.get("XDG_RUNTIME_DIR", "")
    made = Path(tempfile.mkdtemp(prefix="posed-demo-", dir=base if os.path.isdir(base) else None))
    os.environ["XDG_RUNTIME_DIR"] = str(made)
    try:
        yield
    finally:
        _await_end()
        shutil.rmtree(made, ignore_errors=True)


def _await_end() -> None:
    deadline = time.monotonic() + _END_TIMEOUT_S
    while daemon_listens() and time.monotonic() < deadline:
        time.sleep(0.02)
