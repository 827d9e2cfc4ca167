"""How fast deaths are noticed and made good, over real processes.

    python benchmarks/recovery.py [--repeats 10]

A killed and a stopped client's registrations freed (target 0.1 s and 2 s), poses back at two clients after the daemon
was killed and started again (2 s from the new start), and the daemon's end after SIGTERM (1 s).
"""

import argparse
import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from posed.client import PoseClient, Sensor, SensorManager

CLIENT = """
from posed.client import PoseClient, SENSOR_DELAY_FASTEST
client = PoseClient(SENSOR_DELAY_FASTEST)
print(client.next_pose(), flush=True)
for pose in client:
    pass
"""


def start_daemon(directory: Path) -> "subprocess.Popen[bytes]":
    """Start a daemon and return it once it is ready."""
    path = directory / "notify.sock"
    path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
        notify.bind(str(path))
        daemon = subprocess.Popen(
            [sys.executable, "-m", "posed.cli", "serve", "--source", "sim:still"],
            env={**os.environ, "NOTIFY_SOCKET": str(path)},
            stderr=subprocess.DEVNULL,
        )
        notify.recv(256)
    return daemon


@contextlib.contextmanager
def client() -> Iterator["subprocess.Popen[str]"]:
    """Run a client that has had its first pose."""
    process = subprocess.Popen([sys.executable, "-c", CLIENT], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def seconds_until(condition: Callable[[], bool]) -> float:
    """Return how long it takes until something is so, looked at every 2 ms."""
    pause = threading.Event()
    begun = time.monotonic()
    while not condition():
        pause.wait(0.002)
    return time.monotonic() - begun


def main() -> int:
    """Print the table; exit code 1 if a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=10)
    repeats: int = parser.parse_args().repeats
    measured: dict[str, list[float]] = {"killed client": [], "stopped client": [], "daemon back": [], "SIGTERM": []}
    targets = {"killed client": 0.1, "stopped client": 2.0, "daemon back": 2.0, "SIGTERM": 1.0}
    with tempfile.TemporaryDirectory(prefix="posed-") as directory:
        os.environ["XDG_RUNTIME_DIR"] = directory
        for _ in range(repeats):
            daemon = start_daemon(Path(directory))
            with SensorManager() as manager:
                manager.wait_connected()

                def gyroscope_is_free(manager: SensorManager = manager) -> bool:
                    return all(s.handle != Sensor.TYPE_GYROSCOPE for s in manager.get_statistics().sensors)

                for name, number in (("killed client", signal.SIGKILL), ("stopped client", signal.SIGSTOP)):
                    with client() as process:
                        process.send_signal(number)
                        measured[name].append(seconds_until(gyroscope_is_free))
            with PoseClient() as one, PoseClient() as other:
                first = [each.next_pose() for each in (one, other)]
                old = {pose.delivery.boot_id for pose in first if pose is not None}
                daemon.kill()
                daemon.wait()
                begun = time.monotonic()
                daemon = start_daemon(Path(directory))
                for each in (one, other):
                    while (pose := each.next_pose()) is not None and pose.delivery.boot_id in old:
                        pass
                measured["daemon back"].append(time.monotonic() - begun)
                begun = time.monotonic()
                daemon.send_signal(signal.SIGTERM)
                code = daemon.wait()
                measured["SIGTERM"].append(time.monotonic() - begun)
                assert code == 0, code
    missed = False
    print(f"{'seconds':<16}{'median':>8}{'worst':>8}{'at most':>9}")
    for name, values in measured.items():
        values.sort()
        missed |= values[-1] > targets[name]
        verdict = "ok" if values[-1] <= targets[name] else "MISSED"
        print(f"{name:<16}{values[len(values) // 2]:8.3f}{values[-1]:8.3f}{targets[name]:9.1f} {verdict}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
