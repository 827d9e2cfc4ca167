"""Runs the `posed` command as a user runs it."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

_PATIENCE_S = 60.0


class Shell:
    """Runs `posed` commands, and ends what they leave behind."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._running: list[subprocess.Popen[str]] = []

    def run(self, *arguments: str, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
        """Run a command to its end, off a terminal."""
        return subprocess.run(
            [sys.executable, "-m", "posed.cli", *arguments],
            capture_output=True,
            text=True,
            timeout=_PATIENCE_S,
            check=False,
            cwd=cwd,
        )

    def begin(self, *arguments: str) -> "subprocess.Popen[str]":
        """Start a command that a signal ends."""
        process = subprocess.Popen(
            [sys.executable, "-m", "posed.cli", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._running.append(process)
        return process

    def end(self, process: "subprocess.Popen[str]", number: signal.Signals | None = None) -> tuple[int, str]:
        """Send a signal, if one is given, and return the exit code and what is left on stderr."""
        if number is not None:
            process.send_signal(number)
        code = process.wait(_PATIENCE_S)
        assert process.stderr is not None
        return code, process.stderr.read()

    @property
    def daemon_pid(self) -> int:
        """Process id of the daemon that holds the directory."""
        return int((self.directory / "posed" / "daemon.lock").read_text())

    def clear(self) -> None:
        """End what still runs."""
        with contextlib.suppress(FileNotFoundError, ProcessLookupError, ValueError):
            os.kill(self.daemon_pid, signal.SIGKILL)
        for process in self._running:
            process.kill()
            process.wait()
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()
        shutil.rmtree(self.directory)
