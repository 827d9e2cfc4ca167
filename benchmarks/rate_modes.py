"""What each rate mode delivers over a minute, and what a live change of mode does to the heading.

    python benchmarks/rate_modes.py          # 80 s, with --seconds 10 for a trial

The events fused, summed over the poses that a client gets, stand beside the paper's Table 2, all four modes at the
same time. The change is made between every two modes on a phone that looks around: how long until the first pose in
the new mode, and how far the error of the pose against the truth jumps there.
"""

import argparse
import itertools
import math
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from figures import Figure, show

from posed.cli.profiling.daemons import PrivateDaemon
from posed.cli.profiling.measurement import MODES
from posed.cli.profiling.report import PAPER, machine
from posed.client import SENSOR_DELAY_FASTEST, Pose, PoseClient, Truth

_TOLERANCE = 0.02
_SETTLE_POSES = 30


def main() -> int:
    """Measure, print the table, return 1 if a target was missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long poses are taken (default: 60)")
    arguments = parser.parse_args()
    figures = [*_events_fused(arguments.seconds), *_changes()]
    facts = machine()
    return show(f"Rate modes on {facts['cpu_model']}, Linux {facts['kernel']}, Python {facts['python']}", figures)


def _events_fused(seconds: float) -> list[Figure]:
    """Sum the events of consecutive poses, in each mode by a client and a daemon of its own."""
    poses = round(seconds * 10)
    taken: dict[str, list[Pose]] = {}

    def take(mode: str, client: PoseClient) -> None:
        client.next_pose()  # counts what was fused before the client came
        taken[mode] = list(itertools.islice(client, poses))

    with ExitStack() as stack:
        threads = []
        for mode, code in MODES.items():
            client = stack.enter_context(_pose_client(code))
            threads.append(threading.Thread(target=take, args=(mode, client)))
            threads[-1].start()
        for thread in threads:
            thread.join()
    figures = []
    for mode, got in taken.items():
        expected = PAPER[mode].events_per_s * (got[-1].sequence - got[0].sequence + 1) / 10
        fused = sum(pose.events_fused for pose in got)
        low, high = expected * (1 - _TOLERANCE), expected * (1 + _TOLERANCE)
        figures.append(Figure(f"{mode}: events fused, {expected:.0f} expected", fused, "", high, low))
        figures.append(Figure("- poses missed", sum(pose.missed for pose in got), "", 0))
    return figures


def _changes() -> list[Figure]:
    """Change the mode of a running client from each to each other."""
    truths: dict[int, Truth] = {}
    waits, jumps = [0.0], [0.0]
    with _pose_client(SENSOR_DELAY_FASTEST, truths) as client:
        for _ in range(_SETTLE_POSES):
            before = client.next_pose()
        for (_, first), (name, then) in itertools.permutations(MODES.items(), 2):
            client.set_rate_mode(first)
            for _ in range(_SETTLE_POSES // 3):
                before = client.next_pose()
            client.set_rate_mode(then)
            asked_ns = before.delivery.published_ns if before else 0
            for pose in client:
                if before is not None and {pose.sequence, before.sequence} <= truths.keys():
                    error, error_before = (_heading_error(each, truths[each.sequence]) for each in (pose, before))
                    jumps.append(abs(math.remainder(error - error_before, 2 * math.pi)))
                before = pose
                if pose.rate_mode == name:
                    waits.append((pose.delivery.published_ns - asked_ns) / 1e9)
                    break
    return [
        Figure("live change in force after, slowest", max(waits), "s", 1.0),
        Figure("largest jump of the heading error there", math.degrees(max(jumps)), "deg", 0.5),
    ]


@contextmanager
def _pose_client(rate_mode: int, truths: dict[int, Truth] | None = None) -> Iterator[PoseClient]:
    def keep(truth: Truth) -> None:
        if truths is not None:
            truths[truth.delivery.sequence] = truth

    with PrivateDaemon(["--source=sim"]) as daemon:
        os.environ.update(daemon.environment())
        with PoseClient(rate_mode, every=True, on_truth=keep if truths is not None else None) as client:
            client.wait_connected()
            yield client


def _heading_error(pose: Pose, truth: Truth) -> float:
    """Return the heading of the camera less the true one (rad), both against magnetic north."""
    x, y, z, w = truth.quaternion
    true = math.atan2(-2 * (x * z + y * w), -2 * (y * z - x * w))
    return math.remainder(pose.camera_heading - (true - truth.declination), 2 * math.pi)


if __name__ == "__main__":
    sys.exit(main())
