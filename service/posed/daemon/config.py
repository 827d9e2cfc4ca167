"""What a daemon is started with."""

from dataclasses import dataclass

from posed.events import Position
from posed.fusion import DEFAULT_FILTER


@dataclass(frozen=True, slots=True)
class DaemonConfig:
    """The choices of `posed serve`."""

    source: str = "sim"
    """`sim[:SCRIPT]` or `replay:PATH`."""
    profile: str = "patonis2018"
    """A shipped device profile's name or a path to a TOML file."""
    filters: tuple[str, ...] = (DEFAULT_FILTER,)
    """The first gives the fused sensors, and the poses of those who name no other; all are fed the same events."""
    seed: int = 0
    """Of the simulated phone's noise and errors."""
    speed: float = 1.0
    """Of a replay, times real time."""
    loop: bool = False
    """Begin a replay again when it ends."""
    position: Position | None = None
    aligned: bool = False
    """Turn each pose on to its grid instant by the newest angular rate."""
    started: bool = True
    """False for a daemon that lives only while clients bind it."""
