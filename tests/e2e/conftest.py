"""Real daemons and clients in a runtime directory of their own."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

_PATIENCE_S = 20.0


class Desk:
    """A private runtime directory, and the processes that run in it."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._processes: list[subprocess.Popen[str]] = []

    def posed(self, *arguments: str) -> "subprocess.CompletedProcess[str]":
        """Run a `posed` command to its end."""
        return subprocess.run(
            [sys.executable, "-m", "posed.cli", *arguments],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )

    def serve(self, *arguments: str) -> "subprocess.Popen[str]":
        """Run `posed serve` and return it once it is ready."""
        return self._serve([sys.executable, "-m", "posed.cli", "serve", *arguments])

    def serve_bench_phone(self, profile: str = "patonis2018") -> "subprocess.Popen[str]":
        """Run a daemon over the phone of bench_phone.py and return it once it is ready."""
        return self._serve([sys.executable, str(Path(__file__).with_name("bench_phone.py")), profile])

    def tell_phone(self, word: str, is_so: bool) -> None:
        """Have the bench phone be "lost", or have its "dynamic" sensor."""
        path = self.directory / word
        if is_so:
            path.touch()
        else:
            path.unlink()

    def _serve(self, command: list[str]) -> "subprocess.Popen[str]":
        path = self.directory / "notify.sock"
        path.unlink(missing_ok=True)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
            notify.bind(str(path))
            notify.settimeout(_PATIENCE_S)
            daemon = self.spawn(command, {"NOTIFY_SOCKET": str(path)})
            assert b"READY=1" in notify.recv(256)
        return daemon

    def client(self, script: str) -> "subprocess.Popen[str]":
        """Run a Python client and return it once it has printed a line."""
        process = self.spawn([sys.executable, "-c", script])
        assert process.stdout is not None
        assert process.stdout.readline().strip(), "the client ended without a word"
        return process

    def spawn(self, command: list[str], environment: dict[str, str] | None = None) -> "subprocess.Popen[str]":
        """Start a process that is ended with the test."""
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, **(environment or {})},
        )
        self._processes.append(process)
        return process

    @property
    def daemon_pid(self) -> int:
        """Process id of the daemon that holds the directory."""
        return int((self.directory / "posed" / "daemon.lock").read_text())

    def clear(self) -> None:
        """End what still runs."""
        with contextlib.suppress(FileNotFoundError, ProcessLookupError, ValueError):
            os.kill(self.daemon_pid, signal.SIGKILL)
        for process in self._processes:
            with contextlib.suppress(ProcessLookupError):
                process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    pipe.close()
        shutil.rmtree(self.directory)


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    # Not tmp_path: a socket's path may have 107 bytes.
    made = Desk(Path(tempfile.mkdtemp(prefix="posed-")))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(made.directory))
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    yield made
    made.clear()
