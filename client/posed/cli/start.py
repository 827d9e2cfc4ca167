"""`posed start`: the daemon in the background."""

import argparse
import sys

from posed.binder.runtime import runtime_directory
from posed.cli.connection import connect, service_manager
from posed.cli.options import add_daemon_options, daemon_command_line, given_daemon_options
from posed.client.launcher import ensure_daemon
from posed.proto import binder_pb2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a daemon can be told."""
    add_daemon_options(parser)
    parser.epilog = """\
Returns when the daemon is ready. One that runs already keeps its options; it is told to stay when its last client
leaves. The daemon's log is daemon.log in the runtime directory ($XDG_RUNTIME_DIR/posed).

Exit codes: 0 it runs; 1 it refused to start, and said why; 69 it crashed, was not ready in time or does not answer."""


def run(arguments: argparse.Namespace) -> int:
    """Start a daemon, or tell the running one to stay."""
    options = given_daemon_options(arguments)
    was_started = ensure_daemon(daemon_command_line(options))
    with connect() as connection:
        manager = service_manager(connection)
        if not was_started:
            manager.startService(binder_pb2.Empty())
        status = manager.getStatus(binder_pb2.Empty())
    facts = f"source {status.source}, profile {status.profile}, filter {status.filter}"
    if was_started:
        print(f"started: process {status.pid}, {facts}; log {runtime_directory() / 'daemon.log'}")
        return 0
    print(f"already running: process {status.pid}, {facts}; it stays until 'posed stop'")
    if options:
        print("posed: note: it keeps the options it was started with; stop it first to change them", file=sys.stderr)
    return 0
