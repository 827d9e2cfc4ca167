"""The clients that load a daemon while it is measured, each in processes of its own."""

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, Protocol

from posed.cli.profiling.accounting import Reading, read, read_session, session_members
from posed.cli.profiling.daemons import Daemon
from posed.errors import PosedError

_WORKLOAD = "posed.cli.profiling.workload"
_BEGIN_TIMEOUT_S = 15.0
_END_TIMEOUT_S = 5.0
_FAREWELL_S = 2.0


@dataclass(frozen=True, slots=True)
class Received:
    """What a client of ours got while it ran."""

    poses: int = 0
    events: int = 0
    """Sensor events fused into these poses."""
    modes: tuple[str, ...] = ()
    """Rate modes that were in force."""
    sensors: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    """By sensor: count, first and last timestamp (ns) of its events."""


class Client(Protocol):
    """A client at work; leaving the `with` block ends it."""

    def __enter__(self) -> "Client":
        """Wait until it is at work."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it."""

    def read(self) -> Reading:
        """Return its accounts."""

    def finish(self) -> Received:
        """End it and return what it got."""


class Workload:
    """A client of our own: a process that keeps to the rules of posed.cli.profiling.workload."""

    def __init__(self, words: Sequence[str], environment: Mapping[str, str]) -> None:
        """Start this Python with these words as its command line."""
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the process)
        self._process = subprocess.Popen(
            [sys.executable, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            env=environment,
        )

    @classmethod
    def poses(cls, daemon: Daemon, rate_mode: int) -> "Workload":
        """Return a pose client at 10 Hz."""
        return cls(["-m", _WORKLOAD, "pose", str(rate_mode)], daemon.environment())

    @classmethod
    def events(cls, daemon: Daemon, rate_mode: int, max_report_latency_us: int) -> "Workload":
        """Return a listener to accelerometer, gyroscope and magnetic field."""
        return cls(["-m", _WORKLOAD, "raw", str(rate_mode), str(max_report_latency_us)], daemon.environment())

    def __enter__(self) -> "Workload":
        try:
            if self._line(_BEGIN_TIMEOUT_S) != "begin":
                raise PosedError(f"the measuring client got nothing from the daemon{self._last_words()}")
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def read(self) -> Reading:
        return read(self._process.pid)

    def finish(self) -> Received:
        got = self.result()
        sensors = {
            name.removeprefix("android.sensor."): (count, first, last)
            for name, (count, first, last) in got.get("sensors", {}).items()
        }
        return Received(got.get("poses", 0), got.get("events", 0), tuple(got.get("modes", ())), sensors)

    def result(self) -> dict[str, Any]:
        """End it and return what it says it got."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        line = self._line(_END_TIMEOUT_S)
        if not line:
            raise PosedError(f"the measuring client ended without a result{self._last_words()}")
        result: dict[str, Any] = json.loads(line)
        return result

    def _line(self, timeout_s: float) -> str:
        """Return its next line, empty if it ends or says nothing in time."""
        stdout = self._process.stdout
        if stdout is None or not select.select([stdout], [], [], timeout_s)[0]:
            return ""
        return stdout.readline().decode().strip()

    def _last_words(self) -> str:
        return _last_line(self._stderr)

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()
        self._stderr.close()


class Command:
    """The user's own client, with every process that it starts in its session."""

    def __init__(self, daemon: Daemon, words: Sequence[str]) -> None:
        self._daemon = daemon
        self._words = list(words)
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the process)
        try:
            self._process = subprocess.Popen(
                self._words,
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
                env=daemon.environment(),
                start_new_session=True,
            )
        except OSError as error:
            self._output.close()
            raise PosedError(f"cannot run {self._words[0]!r}: {error.strerror}; give a command that starts") from error

    def __enter__(self) -> "Command":
        try:
            self._await_registered()
        except BaseException:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def read(self) -> Reading:
        self._check_alive()
        return read_session(self._process.pid)

    def finish(self) -> Received:
        self._check_alive()
        return Received()

    def _await_registered(self) -> None:
        deadline = time.monotonic() + _BEGIN_TIMEOUT_S
        while not self._daemon.statistics().sensors:
            self._check_alive()
            if time.monotonic() > deadline:
                raise PosedError(
                    f"{self._words[0]!r} registered no pose and no sensor within {_BEGIN_TIMEOUT_S:.0f} s;"
                    " it must find the daemon by XDG_RUNTIME_DIR"
                )
            time.sleep(0.1)

    def _check_alive(self) -> None:
        if self._process.poll() is not None:
            raise PosedError(
                f"{self._words[0]!r} ended with exit code {self._process.returncode} before it was measured;"
                f" it has to run until it is stopped{_last_line(self._output)}"
            )

    def _end(self) -> None:
        end_session(self._process)
        self._output.close()


def end_session(process: "subprocess.Popen[bytes]") -> None:
    """End every process of the session that a process leads: asked first, then made to."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        for pid in session_members(process.pid):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, number)
        deadline = time.monotonic() + _FAREWELL_S
        while session_members(process.pid) and time.monotonic() < deadline:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(0.05)
    process.wait()


def _last_line(output: Any) -> str:
    output.seek(0)
    lines = output.read().decode(errors="replace").strip().splitlines()
    return f": {lines[-1]}" if lines else ""
