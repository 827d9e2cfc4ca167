"""`posed watch`: the fused pose as it comes, drawn, as lines, or as JSON."""

import argparse
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.live import Live

import posed.client as sdk
from posed.cli.connection import connect, service_manager, source_has_ended
from posed.cli.live_view import LiveView, state_words
from posed.cli.options import FILTER_NAMES, add_pose_rate_option, add_rate_mode_option, positive_count
from posed.cli.pose_text import JSON_KEYS, pose_json, pose_line
from posed.client import Pose, PoseClient, ServiceState
from posed.client.launcher import daemon_listens
from posed.client.pose import boot_time_ns
from posed.errors import InvalidArgumentError, PosedError
from posed.proto import binder_pb2

# How often the view is drawn though nothing came, so that the age and the state stay true.
_TICK_S = 0.25
# After so many without anything it is asked whether there is more to come.
_SILENT_TICKS = 4

_SOURCE_ENDED = "the recording has ended, so nothing more comes; 'posed serve' and 'posed start' repeat it with --loop"
# A frame takes 4 ms to draw; poses can come at 200 Hz.
_FRAME_S = 0.1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to ask for and how to show it."""
    add_rate_mode_option(parser)
    add_pose_rate_option(parser)
    parser.add_argument(
        "--filter", metavar="NAME", help=f"which of the daemon's filters, of {FILTER_NAMES} (default: its first)"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.add_argument("--count", type=positive_count, metavar="N", help="end after N poses")
    parser.epilog = f"""\
Waits while no daemon is there and goes on when it returns. Where stdout is no terminal, each pose is a line. Lines, and
what --count limits, end with the recording that a daemon replays: exit code 1 if no pose of it came, else 0.

Keys of --json:
{JSON_KEYS}"""


def run(arguments: argparse.Namespace) -> int:
    """Show poses until Ctrl-C, --count, or the end of the reader or of the recording."""
    rate_mode = getattr(sdk, f"SENSOR_DELAY_{arguments.mode}")
    exit_on_signals()
    if arguments.filter is not None and daemon_listens():
        _require_filter(arguments.filter)
    view = LiveView()
    try:
        with PoseClient(
            rate_mode,
            pose_rate_hz=arguments.rate,
            filter=arguments.filter,
            every=True,
            on_service_connected=view.count_connection,
        ) as client:
            if arguments.json:
                print_poses(client, pose_json, count=arguments.count)
            elif sys.stdout.isatty():
                draw_poses(client, view, count=arguments.count)
            else:
                print_poses(client, pose_line, count=arguments.count)
    except KeyboardInterrupt:
        pass
    return 0


def _require_filter(name: str) -> None:
    """Raise InvalidArgumentError unless the running daemon has the filter."""
    with connect() as connection:
        running: list[str] = service_manager(connection).getStatus(binder_pb2.Empty()).filter.split(",")
    if name not in running:
        raise InvalidArgumentError(f"the daemon runs no filter {name!r}; it runs {', '.join(running)}")


class Silence:
    """Finds out that nothing comes because the daemon's source has ended."""

    def __init__(self) -> None:
        self._ticks = 0

    def is_the_end(self, heard: bool) -> bool:
        """Return True if the source has ended; asked at every tick and everything heard, it looks once a second."""
        self._ticks = 0 if heard else self._ticks + 1
        return self._ticks > 0 and self._ticks % _SILENT_TICKS == 0 and source_has_ended()


def tell_end(printed: int) -> None:
    """Say on stderr that the recording has ended; raises PosedError if nothing of it came."""
    if not printed:
        raise PosedError(_SOURCE_ENDED)
    print(f"posed: {_SOURCE_ENDED}", file=sys.stderr)


def exit_on_signals() -> None:
    """Have SIGTERM and SIGHUP unwind the stack, so that the terminal gets its cursor back and what was made goes."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _frame: sys.exit(128 + number))


def draw_poses(client: PoseClient, view: LiveView, *, count: int | None = None, seconds: float | None = None) -> None:
    """Draw the view on the terminal until `count` poses or `seconds` have passed.

    At the end of a recording the last pose stays, unless `count` poses were asked for: there will not be so many.
    """

    def picture() -> None:
        live.update(view.render(client.state, client.reason, boot_time_ns(), live.console.width), refresh=True)

    with Live(console=Console(), auto_refresh=False) as live:
        next_frame = 0.0
        silence = Silence()
        shown = 0
        for pose in _poses(client, count, seconds):
            if pose is not None:
                view.add(pose)
                shown += 1
            if silence.is_the_end(_is_news(client, pose)):
                view.note_end(_SOURCE_ENDED)
                if count is not None:
                    picture()
                    tell_end(shown)
                    return
            now = time.monotonic()
            if pose is None or now >= next_frame:
                picture()
                next_frame = now + _FRAME_S
        picture()


def print_poses(
    client: PoseClient,
    text_of: Callable[[Pose], str],
    *,
    count: int | None = None,
    seconds: float | None = None,
) -> None:
    """Print each pose as a line until `count` poses or `seconds` have passed, or the recording or the reader ends.

    What happens to the daemon is told on stderr. Raises PosedError if the recording has ended and no pose came.
    """
    reader = select.poll()
    reader.register(sys.stdout, 0)
    told = ServiceState.CONNECTED
    silence = Silence()
    printed = 0
    for pose in _poses(client, count, seconds):
        if silence.is_the_end(_is_news(client, pose)):
            tell_end(printed)
            return
        if client.state is not told:
            told = client.state
            print(f"posed: {state_words(told, client.reason)}", file=sys.stderr)
        if pose is not None:
            print(text_of(pose), flush=True)
            printed += 1
        elif reader.poll(0):
            return  # a pipe without its reader would only be noticed at the next pose


def _is_news(client: PoseClient, pose: Pose | None) -> bool:
    """Return whether it is known why there is a pose, or none."""
    return pose is not None or client.state is not ServiceState.CONNECTED


def _poses(client: PoseClient, count: int | None, seconds: float | None) -> Iterator[Pose | None]:
    """Yield each pose, and None whenever nothing came for a while."""
    end = None if seconds is None else time.monotonic() + seconds
    received = 0
    while received != count:
        wait_s = _TICK_S if end is None else min(_TICK_S, end - time.monotonic())
        if wait_s <= 0:
            return
        pose = client.next_pose(wait_s)
        yield pose
        received += pose is not None
