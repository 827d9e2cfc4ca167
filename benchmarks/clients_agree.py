"""Whether 20 clients at mixed rates get what dumpsys says they got: `python benchmarks/clients_agree.py` (a minute).

One of them is stopped now and again, so that the daemon has to drop events; the others are to lose nothing. The
recording is replayed at five times its speed, and the counts are compared when it has ended and nothing waits any more.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from figures import Figure, show
from recording import write_recording

from posed.cli.profiling.clients import Workload
from posed.cli.profiling.daemons import PrivateDaemon
from posed.cli.profiling.report import machine
from posed.proto import sensors_pb2

_LOAD = str(Path(__file__).with_name("load.py"))
_SPEED = 5
_SLOW = 25
"""Number of the client that is stopped: every sensor at FASTEST, each event as it happens."""
_SLOW_NAME = f"com.example.client{_SLOW:02d}"
_STOPS = 5


def main() -> int:
    """Measure, print the table, return 1 if a target was missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long the clients listen (default: 60)")
    parser.add_argument("--clients", type=int, default=20, help="how many there are (default: 20)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="posed-") as directory:
        recording = Path(directory) / "walk.csv"
        write_recording(recording, arguments.seconds * _SPEED)
        figures = _measure(recording, arguments.clients)
    facts = machine()
    return show(f"Clients on {facts['cpu_model']}, Linux {facts['kernel']}, Python {facts['python']}", figures)


def _measure(recording: Path, count: int) -> list[Figure]:
    with (
        PrivateDaemon([f"--source=replay:{recording}", f"--speed={_SPEED}"]) as daemon,
        Workload([_LOAD, "count", *map(str, range(count - 1))], daemon.environment()) as crowd,
        Workload([_LOAD, "count", str(_SLOW)], daemon.environment()) as slow,
    ):
        for _ in range(_STOPS):
            _stop_until_it_loses(daemon)
        while True:
            statistics = daemon.statistics()
            if statistics.source_ended and not any(each.events_cached for each in statistics.listeners):
                break
            time.sleep(0.2)
        time.sleep(1.0)
        said = _said_by_dumpsys(daemon)
        received = crowd.result() | slow.result()
    agreeing = sum(
        said.get(name) == (got["count"] + got["dropped"], got["count"], 0, got["dropped"])
        for name, got in received.items()
    )
    disorder = sum(got["disorder"] for got in received.values())
    lost = {name: got["dropped"] for name, got in received.items()}
    return [
        Figure("clients whose counts are those of dumpsys", agreeing, "", at_least=count),
        Figure("events received in all", sum(got["count"] for got in received.values())),
        Figure("events out of order or twice", disorder, "", at_most=0),
        Figure("dropped of the one that was stopped", lost.pop(_SLOW_NAME), "", at_least=1),
        Figure("dropped of the others", sum(lost.values()), "", at_most=0),
    ]


def _stop_until_it_loses(daemon: PrivateDaemon) -> None:
    """Stop the slow client until another event of its was dropped, or for a second: then it would be taken for dead."""
    listeners = daemon.statistics().listeners
    pid = next(each.pid for each in listeners if each.package_name == _SLOW_NAME)
    dropped = _dropped(daemon.statistics())
    os.kill(pid, signal.SIGSTOP)
    deadline = time.monotonic() + 1.0
    while _dropped(daemon.statistics()) == dropped and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(pid, signal.SIGCONT)
    time.sleep(2.0)


def _dropped(statistics: sensors_pb2.Statistics) -> int:
    return sum(each.events_dropped for each in statistics.listeners)


def _said_by_dumpsys(daemon: PrivateDaemon) -> dict[str, tuple[int, ...]]:
    """Return (received, sent, cached, dropped) by package."""
    command = [sys.executable, "-m", "posed.cli", "dumpsys", "sensorservice"]
    text = subprocess.run(command, env=daemon.environment(), capture_output=True, text=True, check=True).stdout
    who = r"\t (com\.example\S+) \|.*\n(?:\t .* \| status: .*\n)+"
    what = r"\t events recvd: (\d+) \| sent (\d+) \| cache (\d+) \| dropped (\d+)"
    return {name: tuple(map(int, counts)) for name, *counts in re.findall(who + what, text)}


if __name__ == "__main__":
    sys.exit(main())
