"""How punctual the pose is: `python benchmarks/pose_clock.py` (10 minutes), with --minutes 0.5 for a trial."""

import argparse
import itertools
import os
import sys

from figures import Figure, show

from posed.cli.profiling.daemons import PrivateDaemon
from posed.cli.profiling.report import machine
from posed.client import SENSOR_DELAY_FASTEST, PoseClient
from posed.client.pose import boot_time_ns

_PERIOD_MS = 100.0


def main() -> int:
    """Take poses at 10 Hz for a while, print the table, return 1 if a target was missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0, help="how long (default: 10)")
    minutes = parser.parse_args().minutes
    published: list[int] = []
    received: list[int] = []
    with PrivateDaemon(["--source=sim"]) as daemon:
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
        ],
    )


def _interval_error_ms(times_ns: list[int], percentile: int) -> float:
    errors = sorted(abs((later - earlier) / 1e6 - _PERIOD_MS) for earlier, later in itertools.pairwise(times_ns))
    return errors[min(len(errors) - 1, len(errors) * percentile // 100)]


if __name__ == "__main__":
    sys.exit(main())
