"""Starting a daemon when there is none: exactly one, however many clients ask at once."""

import contextlib
import fcntl
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from posed.binder import runtime
from posed.errors import AlreadyRunningError, ServiceUnavailableError

_READY_TIMEOUT_S = 10.0
_LOG_NAME = "daemon.log"


def ensure_daemon(arguments: Sequence[str] = ("--bound",)) -> bool:
    """Start `posed serve` with these arguments unless a daemon runs; return whether one was started.

    Returns once it is ready. Raises ServiceUnavailableError with the daemon's own last words if it does not come up.
    """
    directory = runtime.runtime_directory()
    with _start_lock(directory):
        if daemon_runs(directory):
            return False
        _start(directory, arguments)
        return True


def daemon_runs(directory: Path) -> bool:
    """Return whether a daemon holds the runtime directory."""
    if not directory.exists():
        return False
    lock = runtime.InstanceLock(directory)
    try:
        lock.acquire()
    except AlreadyRunningError:
        return True
    lock.release()
    return False


@contextlib.contextmanager
def _start_lock(directory: Path) -> Iterator[None]:
    fd = os.open(directory / "start.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def _start(directory: Path, arguments: Sequence[str]) -> None:
    """Spawn the daemon and wait for its READY=1, the message systemd would get (sd_notify(3))."""
    log_path = directory / _LOG_NAME
    ready_path = directory / f"ready-{os.getpid()}.sock"
    ready_path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as ready, log_path.open("wb") as log:
        ready.bind(str(ready_path))
        try:
            process = subprocess.Popen(
                [sys.executable, "-m", "posed.cli", "serve", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
                env={**os.environ, "NOTIFY_SOCKET": str(ready_path)},
                cwd="/",
                start_new_session=True,
            )
            _await_ready(process, ready, log_path)
        finally:
            ready_path.unlink(missing_ok=True)


def _await_ready(process: "subprocess.Popen[bytes]", ready: socket.socket, log_path: Path) -> None:
    ready.settimeout(0.05)
    deadline = time.monotonic() + _READY_TIMEOUT_S
    while time.monotonic() < deadline:
        with contextlib.suppress(TimeoutError):
            if b"READY=1" in ready.recv(256).split(b"\n"):
                return
        if process.poll() is not None:
            said = log_path.read_text(errors="replace").strip().splitlines()
            why = said[-1] if said else f"exit code {process.returncode}"
            raise ServiceUnavailableError(f"the daemon did not start: {why}")
    process.kill()
    process.wait()
    raise ServiceUnavailableError(f"the daemon was not ready after {_READY_TIMEOUT_S:.0f} s; its log is {log_path}")
