"""The pose on a terminal, drawn anew as it changes."""

import math
from collections import deque

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from posed.cli.pose_text import angle_deg, bearing_deg, status_words, steep_camera, wind
from posed.client import Pose, PoseStatus, Position, ServiceState
from posed.client.pose_client import STALE_AFTER_NS

MAX_WIDTH = 80
# What stands left of a gauge, and the frame.
_BESIDE_GAUGE = 31
_TAPE_DEG_A_CELL = 4
_RATE_WINDOW_NS = 3_000_000_000
_GOOD, _DOUBTFUL, _BAD = "green", "yellow", "red"


class LiveView:
    """What is known of a stream of poses, and its picture."""

    def __init__(self) -> None:
        self._connections = 0
        self._pose: Pose | None = None
        self._received = 0
        self._missed = 0
        self._published_ns: deque[int] = deque()
        self._end = ""

    def count_connection(self) -> None:
        """Note that a daemon has connected: a second one is a return."""
        self._connections += 1
        self._end = ""

    def add(self, pose: Pose) -> None:
        """Take in the next pose of the stream."""
        before, self._pose = self._pose, pose
        self._received += 1
        self._missed += pose.missed
        if before is not None and before.delivery.boot_id != pose.delivery.boot_id:
            self._published_ns.clear()
        now_ns = pose.delivery.published_ns
        self._published_ns.append(now_ns)
        while now_ns - self._published_ns[0] > _RATE_WINDOW_NS:
            self._published_ns.popleft()

    def note_end(self, words: str) -> None:
        """Say so where the poses stop."""
        self._end = words

    def measured_hz(self) -> float | None:
        """Return the rate at which poses were published over the last 3 s, None before the second."""
        if len(self._published_ns) < 2:
            return None
        return (len(self._published_ns) - 1) * 1e9 / (self._published_ns[-1] - self._published_ns[0])

    def render(self, state: ServiceState, reason: str, now_ns: int, width: int = MAX_WIDTH) -> RenderableType:
        """Return the picture at `now_ns` (CLOCK_BOOTTIME), `width` cells wide but never more than MAX_WIDTH."""
        width = min(width, MAX_WIDTH)
        pose = self._pose
        color, news = self._news(state, reason, now_ns)
        headline = Text(news, style=f"bold {color}", overflow="fold")
        parts: list[RenderableType] = [headline]
        if pose is not None:
            live = state is ServiceState.CONNECTED and now_ns - pose.delivery.published_ns <= STALE_AFTER_NS
            parts += [
                Text(),
                _attitude(pose, live, max(1, width - _BESIDE_GAUGE)),
                Text(),
                self._figures(pose, now_ns, live),
            ]
        return Panel(
            Group(*parts),
            title="posed",
            subtitle="Ctrl-C ends",
            border_style=color,
            width=width,
            padding=(0, 1),
        )

    def _news(self, state: ServiceState, reason: str, now_ns: int) -> tuple[str, str]:
        """Return color and text that say where the daemon stands."""
        if state is ServiceState.CONNECTED:
            if self._pose is None:
                return _DOUBTFUL, self._end or "connected; waiting for the first pose"
            silent_ns = now_ns - self._pose.delivery.published_ns
            if silent_ns > STALE_AFTER_NS and self._end:
                return _DOUBTFUL, self._end
            if silent_ns > STALE_AFTER_NS:
                return _DOUBTFUL, f"connected, but no pose for {silent_ns / 1e9:.0f} s"
            if self._connections > 1:
                return _GOOD, f"connected; the daemon has returned {_times(self._connections - 1)}"
            return _GOOD, state_words(state, reason)
        gone = state in (ServiceState.DISCONNECTED, ServiceState.BINDING_DIED)
        return _BAD if gone else _DOUBTFUL, state_words(state, reason)

    def _figures(self, pose: Pose, now_ns: int, live: bool) -> Table:
        hz = self.measured_hz()
        age_ms = (now_ns - pose.delivery.to_boot_ns(pose.timestamp_ns + pose.predicted_ns)) / 1e6
        table = Table.grid(padding=(0, 1))
        for _ in range(2):
            table.add_column(style="dim", min_width=10, no_wrap=True)
            table.add_column(width=26, no_wrap=True)
        table.add_row(
            "pose rate",
            f"{hz:.1f} Hz" if live and hz is not None else "-",
            "age",
            Text(_duration(age_ms), style="" if live else _BAD),
        )
        table.add_row(
            "poses", str(self._received), "missed", Text(str(self._missed), _DOUBTFUL if self._missed else "")
        )
        table.add_row("rate mode", pose.rate_mode, "filter", f"{pose.filter}, {pose.events_fused} events")
        table.add_row(
            "heading", f"±{math.degrees(pose.heading_accuracy):.1f}° (1 sigma)", "sequence", str(pose.sequence)
        )
        figures = Table.grid()
        figures.add_row(table)
        figures.add_row(_wide(("status", _status(pose.status)), ("position", _position(pose.position))))
        return figures


def state_words(state: ServiceState, reason: str) -> str:
    """Return where the daemon stands, for people at a terminal."""
    if state is ServiceState.CONNECTED:
        return "connected"
    if state is ServiceState.DISCONNECTED:
        return "the daemon died or hangs; waiting for its return"
    if state is ServiceState.BINDING_DIED:
        return f"{reason}; waiting for another"
    return "no daemon has answered yet; 'posed start' starts one"


def _attitude(pose: Pose, live: bool, gauge: int) -> Table:
    table = Table.grid(padding=(0, 1))
    table.add_column(style="dim", width=10, no_wrap=True)
    table.add_column(width=13, no_wrap=True)
    table.add_column(width=gauge, no_wrap=True)
    for label, heading in (("camera", pose.camera_heading), ("azimuth", pose.azimuth)):
        steep = steep_camera(pose) if label == "camera" else ""
        if steep:
            table.add_row(label, f"straight {steep}", "")
        else:
            table.add_row(label, f"{bearing_deg(heading):6.1f}° {wind(heading)}", tape(heading, gauge))
    for label, angle, limit in (("pitch", pose.pitch, math.pi / 2), ("roll", pose.roll, math.pi)):
        table.add_row(label, f"{angle_deg(angle):+6.1f}°", bar(angle / limit, gauge))
    table.add_row()
    quaternion = "  ".join(f"{axis} {q:+.4f}" for axis, q in zip("xyzw", pose.quaternion, strict=True))
    rates = "  ".join(f"{axis} {math.degrees(w):+7.1f}" for axis, w in zip("xyz", pose.angular_rate, strict=True))
    attitude = Table.grid()
    attitude.add_row(table, style="" if live else "dim")
    attitude.add_row(_wide(("quaternion", quaternion), ("turn rate", f"{rates}  °/s")), style="" if live else "dim")
    return attitude


def _wide(*rows: tuple[str, str | Text]) -> Table:
    """Return labels with what is too long to stand two in a row."""
    table = Table.grid(padding=(0, 1))
    table.add_column(style="dim", min_width=10, no_wrap=True)
    table.add_column(no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table


def tape(heading: float, width: int) -> Text:
    """Return the compass as a strip about a heading (rad), 4 degrees a cell; the middle cell is the heading."""
    cells = [" "] * width
    degrees = math.degrees(heading)
    for tick in range(0, 360, 15):
        offset = (tick - degrees + 180.0) % 360.0 - 180.0
        middle = width // 2 + round(offset / _TAPE_DEG_A_CELL)
        letters = "·" if tick % 45 else wind(math.radians(tick))
        for index, letter in enumerate(letters, middle - (len(letters) - 1) // 2):
            if 0 <= index < width:
                cells[index] = letter
    text = Text("".join(cells), style="cyan")
    text.stylize("reverse bold", width // 2, width // 2 + 1)
    return text


def bar(fraction: float, width: int) -> Text:
    """Return a bar from the middle to a marker: left of it for -1 to 0, right of it for 0 to 1."""
    middle = width // 2
    length = round(max(-1.0, min(1.0, fraction)) * middle)
    filled = "━" * abs(length)
    left, right = "─" * (middle + min(length, 0)), "─" * (width - 1 - middle - max(length, 0))
    drawn = f"{filled}┃" if length > 0 else f"┃{filled}"
    return Text.assemble((left, "bright_black"), (drawn, "cyan"), (right, "bright_black"))


def _status(status: PoseStatus) -> Text:
    words = [word.replace("_", " ") for word in status_words(status)]
    quiet = PoseStatus.AT_REST
    return Text(", ".join(words) or "ok", style=_DOUBTFUL if status & ~quiet else _GOOD)


def _position(position: Position | None) -> str:
    if position is None:
        return "-"
    return (
        f"{position.latitude_deg:.6f}° {position.longitude_deg:.6f}°  {position.ellipsoidal_height_m:.1f} m"
        f"  ({position.source})"
    )


def _duration(ms: float) -> str:
    return f"{ms:.0f} ms" if ms < 1000 else f"{ms / 1000:.1f} s"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
