"""Options that several subcommands share, and how their values are read."""

import argparse
import math
import os
from typing import Any

RATE_MODES = ("NORMAL", "UI", "GAME", "FASTEST")

FILTER_NAMES = "dcm-adaptive, dcm, dcm-literal, game, geomag, vqf, imufusion"
"""Written down for the help alone, so that a daemon reads its options before it has numpy."""

_DAEMON_OPTIONS = ("source", "profile", "filters", "seed", "speed", "loop", "position", "aligned", "log_format")


def add_daemon_options(parser: argparse.ArgumentParser) -> None:
    """Add what a daemon can be told; an option that is not given leaves nothing behind (see `given_daemon_options`)."""
    group = parser.add_argument_group("daemon", argument_default=argparse.SUPPRESS)
    group.add_argument(
        "--source",
        type=_source,
        metavar="SOURCE",
        help="where samples come from: sim, sim:SCRIPT or replay:PATH (default: sim)",
    )
    add_profile_option(group)
    add_filters_option(group)
    group.add_argument("--seed", type=int, metavar="N", help="of the simulated phone's noise and errors (default: 0)")
    group.add_argument("--speed", type=float, metavar="X", help="of a replay, times real time (default: 1)")
    group.add_argument("--loop", action="store_true", help="begin a replay again when it ends")
    group.add_argument(
        "--position",
        type=position,
        metavar="LAT,LON,HEIGHT",
        help="where the phone is: degrees and metres above the ellipsoid (south of the equator: --position=-33.9,...)",
    )
    add_aligned_option(group)
    group.add_argument(
        "--log-format", choices=("text", "json"), help="of the lines on stderr; json: one object a line (default: text)"
    )


def add_profile_option(parser: "argparse._ActionsContainer", default: str = argparse.SUPPRESS) -> None:
    """Add --profile; a path is made absolute, as the daemon's working directory is another one."""
    parser.add_argument(
        "--profile",
        type=_profile,
        default=default,
        metavar="NAME|PATH",
        help="device profile: a shipped one or a .toml file (default: patonis2018)",
    )


def add_filters_option(parser: "argparse._ActionsContainer", default: Any = argparse.SUPPRESS) -> None:
    """Add --filter, one or several names, as `filters`."""
    parser.add_argument(
        "--filter",
        dest="filters",
        type=_filters,
        default=default,
        metavar="NAME,NAME",
        help=f"orientation filters, one or several side by side, of {FILTER_NAMES} (default: dcm-adaptive)",
    )


def add_aligned_option(parser: "argparse._ActionsContainer") -> None:
    """Add --aligned."""
    parser.add_argument(
        "--aligned",
        action="store_true",
        help="turn each pose on to its instant by the newest angular rate, so that it does not lag",
    )


def add_rate_mode_option(parser: argparse.ArgumentParser) -> None:
    """Add --mode, one of RATE_MODES in either case."""
    parser.add_argument(
        "--mode",
        type=str.upper,
        choices=RATE_MODES,
        default="GAME",
        help="rate mode asked of the sensors (default: GAME)",
    )


def add_pose_rate_option(parser: argparse.ArgumentParser) -> None:
    """Add --rate, poses a second."""
    parser.add_argument(
        "--rate", type=_pose_rate, default=10.0, metavar="HZ", help="poses a second, 1 to 200 (default: 10)"
    )


def given_daemon_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the daemon options that were given, by name."""
    return {name: getattr(arguments, name) for name in _DAEMON_OPTIONS if hasattr(arguments, name)}


def daemon_command_line(options: dict[str, Any]) -> list[str]:
    """Return the words that give `posed serve` these options."""
    words = []
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        if name == "position":
            value = ",".join(map(repr, value))
        elif name == "filters":
            option, value = "--filter", ",".join(value)
        words.append(option if value is True else f"{option}={value}")
    return words


def positive_count(text: str) -> int:
    """Read a count of 1 or more."""
    try:
        count = int(text)
    except ValueError:
        count = 0
    if count < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no count; give a whole number from 1")
    return count


def positive_seconds(text: str) -> float:
    """Read a finite duration above 0."""
    seconds = _number(text)
    if not seconds > 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no duration; give seconds above 0")
    return seconds


def position(text: str) -> tuple[float, float, float]:
    """Read a latitude, a longitude (degrees) and a height (m)."""
    parts = [_number(part) for part in text.split(",")]
    if len(parts) != 3 or not (abs(parts[0]) <= 90 and abs(parts[1]) <= 180 and math.isfinite(parts[2])):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no position; give LAT,LON,HEIGHT: -90 to 90 and -180 to 180 degrees, metres"
        )
    return parts[0], parts[1], parts[2]


def _pose_rate(text: str) -> float:
    rate = _number(text)
    if not 1 <= rate <= 200:
        raise argparse.ArgumentTypeError(f"{text!r} is no pose rate; give 1 to 200 Hz")
    return rate


def _filters(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(","))
    if len(set(names)) != len(names):
        raise argparse.ArgumentTypeError(f"{text!r} names a filter twice")
    return names


def _source(text: str) -> str:
    kind, _, rest = text.partition(":")
    return f"replay:{_absolute(rest)}" if kind == "replay" and rest else text


def _profile(text: str) -> str:
    return _absolute(text) if text.endswith(".toml") else text


def _absolute(path: str) -> str:
    # A shell expands ~ only at the start of a word, not behind `replay:`.
    return os.path.abspath(os.path.expanduser(path))


def _number(text: str) -> float:
    """Return a finite number, NaN for anything else."""
    try:
        number = float(text)
    except ValueError:
        return math.nan
    return number if math.isfinite(number) else math.nan
