"""What the kernel charges processes: CPU time in nanoseconds, wake-ups, memory."""

import contextlib
import time
from dataclasses import dataclass
from pathlib import Path

from posed.errors import ServiceUnavailableError

_PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Reading:
    """The accounts of a process, or of some together, with all their threads and since they began."""

    at_ns: int
    """CLOCK_BOOTTIME."""
    cpu_ns: int
    wakeups: int
    """Voluntary context switches: how often a thread went to sleep."""
    rss_kib: int


@dataclass(frozen=True, slots=True)
class Usage:
    """What was used between two readings."""

    cpu_percent: float
    """Of one core."""
    wakeups_per_s: float
    rss_mb: float
    """At the end, in 1e6 bytes."""


def read(pid: int) -> Reading:
    """Return a process's accounts; raises ServiceUnavailableError if it is gone."""
    try:
        return _read(pid)
    except OSError:
        raise ServiceUnavailableError(f"process {pid} ended while it was being measured") from None


def read_session(session: int) -> Reading:
    """Return the accounts of all processes of a session together; one that ends takes its own with it."""
    readings = []
    for pid in session_members(session):
        with contextlib.suppress(OSError):
            readings.append(_read(pid))
    return Reading(
        at_ns=_now_ns(),
        cpu_ns=sum(each.cpu_ns for each in readings),
        wakeups=sum(each.wakeups for each in readings),
        rss_kib=sum(each.rss_kib for each in readings),
    )


def usage(before: Reading, after: Reading) -> Usage:
    """Return what was used between two readings of the same processes."""
    elapsed_ns = after.at_ns - before.at_ns
    return Usage(
        cpu_percent=100.0 * (after.cpu_ns - before.cpu_ns) / elapsed_ns,
        wakeups_per_s=1e9 * (after.wakeups - before.wakeups) / elapsed_ns,
        rss_mb=after.rss_kib * 1024 / 1e6,
    )


def session_members(session: int) -> list[int]:
    """Return the processes of a session (setsid(2)) that are alive."""
    members = []
    for directory in _PROC.iterdir():
        if not directory.name.isdigit():
            continue
        try:
            stat = (directory / "stat").read_text()
        except OSError:
            continue
        # The command's name stands in parentheses and may hold any character, spaces and parentheses too.
        state, _parent, _group, found = stat[stat.rindex(")") + 2 :].split()[:4]
        if int(found) == session and state not in "ZX":
            members.append(int(directory.name))
    return members


def _now_ns() -> int:
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME)


def _read(pid: int) -> Reading:
    at_ns = _now_ns()
    # The clock of clock_getcpuclockid(3). Unlike /proc/PID/task/*/schedstat it is there on every kernel, and it keeps
    # the time of threads that have ended.
    cpu_ns = time.clock_gettime_ns((~pid << 3) | 2)
    process = _PROC / str(pid)
    wakeups = sum(_field(thread / "status", "voluntary_ctxt_switches") for thread in (process / "task").iterdir())
    return Reading(at_ns, cpu_ns, wakeups, _field(process / "status", "VmRSS"))


def _field(status: Path, name: str) -> int:
    try:
        lines = status.read_text().splitlines()
    except (FileNotFoundError, ProcessLookupError):
        return 0  # a thread that has just ended
    return next((int(line.split()[1]) for line in lines if line.startswith(f"{name}:")), 0)
