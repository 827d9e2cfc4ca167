"""Starting a daemon when there is none: exactly one, however many clients ask at once."""

import contextlib
import fcntl
import os
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from posed.binder import runtime
from posed.errors import PosedError, ServiceUnavailableError

_READY_TIMEOUT_S = 10.0
_LOG_NAME = "daemon.log"
# How a daemon's last line begins if it refused to start; after a crash it is another.
_REFUSAL = "posed: error: "


def ensure_daemon(arguments: Sequence[str] = ("--bound",)) -> bool:
    """Start `posed serve` with these arguments unless a daemon runs; return whether one was started.

    Returns once it is ready. Raises PosedError with the daemon's own words if it refused to start, for its options for
    example, ServiceUnavailableError if it crashed or is not ready in time.
    """
    directory = runtime.runtime_directory()
    with _start_lock(directory):
        if daemon_listens():
            return False
        _start(directory, arguments)
        return True


def daemon_listens() -> bool:
    """Return whether a daemon stands at the control socket; taking its lock to find out could keep one from starting.

    Raises RuntimeDirectoryError if the runtime directory is not safe to use.
    """
    path = runtime.control_path(runtime.runtime_directory(create=False))
    runtime.endpoint(path)  # refuses a path that connect could only call too long
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_CLOEXEC) as probe:
        probe.setblocking(False)
        try:
            probe.connect(os.fspath(path))
        except (FileNotFoundError, ConnectionRefusedError):
            return False
        except BlockingIOError:
            pass  # a daemon that accepts nobody at the moment
    return True


def start_error(name: str, last_line: str) -> PosedError:
    """Return the error for a daemon that ended before it was ready: ServiceUnavailableError unless it refused."""
    kind = PosedError if last_line.startswith(_REFUSAL) else ServiceUnavailableError
    return kind(f"{name} did not start: {last_line.removeprefix(_REFUSAL)}")


@contextlib.contextmanager
def _start_lock(directory: Path) -> Iterator[None]:
    fd = os.open(directory / "start.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


# Forks once more, so that the daemon is nobody's child and leaves no zombie behind in a client that outlives it.
_DETACH = (
    "import os, sys; os.fork() and os._exit(0); os.setsid(); os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)


def _start(directory: Path, arguments: Sequence[str]) -> None:
    """Spawn the daemon and wait for its READY=1, the message systemd would get (sd_notify(3))."""
    log_path = directory / _LOG_NAME
    if log_path.exists():
        # The last words of a daemon that crashed are worth keeping when a client starts the next.
        log_path.replace(log_path.with_suffix(".log.1"))
    ready_path = directory / f"ready-{os.getpid()}.sock"
    runtime.endpoint(ready_path)  # refuses a path that bind could only call too long
    ready_path.unlink(missing_ok=True)
    alive, held_by_daemon = os.pipe()
    with (
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as ready,
        log_path.open("wb") as log,
        open(alive, "rb", buffering=0) as alive_pipe,
    ):
        ready.bind(str(ready_path))
        try:
            with open(held_by_daemon, "wb", buffering=0):
                detached = subprocess.run(
                    [sys.executable, "-ISc", _DETACH, "-m", "posed.cli", "serve", *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    env={**os.environ, "NOTIFY_SOCKET": str(ready_path)},
                    cwd="/",
                    pass_fds=(held_by_daemon,),
                    check=False,
                )
            if detached.returncode:
                raise ServiceUnavailableError(
                    f"{sys.executable} could not start the daemon (exit code {detached.returncode}); see {log_path}"
                )
            _await_ready(ready, alive_pipe.fileno(), log_path)
        finally:
            ready_path.unlink(missing_ok=True)


def _await_ready(ready: socket.socket, alive: int, log_path: Path) -> None:
    """Return at READY=1. The pipe `alive` ends when the daemon does."""
    deadline = time.monotonic() + _READY_TIMEOUT_S
    while (remaining := deadline - time.monotonic()) > 0:
        readable, _, _ = select.select([ready.fileno(), alive], [], [], remaining)
        if ready.fileno() in readable and b"READY=1" in ready.recv(256).split(b"\n"):
            return
        if alive in readable:
            if _another_came_first():
                return
            said = log_path.read_text(errors="replace").strip().splitlines()
            last = said[-1] if said else "it said nothing"
            raise start_error("the daemon", last)
    raise ServiceUnavailableError(f"the daemon was not ready after {_READY_TIMEOUT_S:.0f} s; its log is {log_path}")


def _another_came_first() -> bool:
    """Return whether a daemon started by somebody else took the place meanwhile; it may still be on its way."""
    pause = threading.Event()
    for _ in range(20):
        if daemon_listens():
            return True
        pause.wait(0.05)
    return False
