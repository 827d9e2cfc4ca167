"""How punctual the pose is: `python benchmarks/pose_clock.py` (10 minutes), with --minutes 0.5 for a trial.

Beside it stands how late a bare timer of the kernel's wakes a process that does nothing else: on a virtual machine that
shares its cores, most of the lateness is not the daemon's.
"""

import argparse
import itertools
import os
import sys
import threading

from figures import Figure, show

from posed.cli.profiling.daemons import PrivateDaemon
from posed.cli.profiling.report import machine
from posed.client import SENSOR_DELAY_FASTEST, PoseClient
from posed.client.pose import boot_time_ns
from posed.daemon.waiting import Waiter

_PERIOD_MS = 100.0


def main() -> int:
    """Take poses at 10 Hz for a while, print the table, return 1 if a target was missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="how long (default: 10)")
    minutes = parser.parse_args().minutes
    published: list[int] = []
    received: list[int] = []
    bare = _BareTimer()
    with PrivateDaemon(["--source=sim"]) as daemon, bare:
        os.environ.update(daemon.environment())
        with PoseClient(SENSOR_DELAY_FASTEST, every=True) as client:
            end_ns = None
            for pose in client:
                now_ns = boot_time_ns()
                end_ns = end_ns or now_ns + round(minutes * 60e9)
                if now_ns >= end_ns:
                    break
                published.append(pose.delivery.published_ns)
                received.append(now_ns)
            missed = client.poses_missed
        statistics = daemon.statistics()
    expected = round(minutes * 600)
    facts = machine()
    return show(
        f"10 Hz for {minutes:g} min on {facts['cpu_model']}, Linux {facts['kernel']}, Python {facts['python']}",
        [
            Figure("poses", len(published), "", expected + 1, expected - 1),
            Figure("- missed by the client", missed, "", 0),
            Figure("- skipped by the daemon", statistics.poses_skipped, "", 0),
            Figure("interval error of the publication, p50", _interval_error_ms(published, 50), "ms"),
            Figure("interval error of the publication, p99", _interval_error_ms(published, 99), "ms", 5.0),
            Figure("interval error at the client, p99", _interval_error_ms(received, 99), "ms", 5.0),
            Figure("lateness, p50", statistics.lateness_p50_ms, "ms"),
            Figure("lateness, p99", statistics.lateness_p99_ms, "ms", 2.0),
            Figure("lateness of a bare timer, p50", _percentile(bare.lateness_ms, 50), "ms"),
            Figure("lateness of a bare timer, p99", _percentile(bare.lateness_ms, 99), "ms"),
        ],
    )


class _BareTimer(threading.Thread):
    """Wakes ten times a second while the `with` block runs."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.lateness_ms: list[float] = []
        self._over = False

    def run(self) -> None:
        waiter = Waiter(())
        due_ns = boot_time_ns()
        while not self._over:
            due_ns += round(_PERIOD_MS * 1e6)
            waiter.wait(due_ns)
            self.lateness_ms.append((boot_time_ns() - due_ns) / 1e6)
        waiter.close()

    def __enter__(self) -> "_BareTimer":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self.join()


def _interval_error_ms(times_ns: list[int], percentile: int) -> float:
    intervals = itertools.pairwise(times_ns)
    return _percentile([abs((later - earlier) / 1e6 - _PERIOD_MS) for earlier, later in intervals], percentile)


def _percentile(values: list[float], percentile: int) -> float:
    return sorted(values)[min(len(values) - 1, len(values) * percentile // 100)]


if __name__ == "__main__":
    sys.exit(main())
