"""The daemons that are measured: one started for the purpose, or the user's own."""

import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

from posed.cli.connection import connect, sensor_service, service_manager
from posed.client.launcher import daemon_listens, start_error
from posed.errors import ServiceUnavailableError
from posed.proto import binder_pb2, sensors_pb2

_READY_TIMEOUT_S = 20.0
_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None)


class Daemon:
    """The user's running daemon, as it is.

    Its counters are read over a connection that is closed again at once: one kept open would cost heartbeats.
    """

    runtime_base: Path | None = None
    """What XDG_RUNTIME_DIR must be to reach it, None if it is that already."""

    def __init__(self) -> None:
        with self._reached(), connect() as connection:
            self.pid: int = service_manager(connection).getStatus(binder_pb2.Empty()).pid
            sensors = sensor_service(connection).getSensorList(binder_pb2.Empty()).sensors
        self.sensor_names: dict[int, str] = {
            sensor.handle: sensor.string_type.removeprefix("android.sensor.") for sensor in sensors
        }
        """Sensor handles and what Android calls their types."""

    def statistics(self) -> sensors_pb2.Statistics:
        """Return the daemon's counters."""
        with self._reached(), connect() as connection:
            statistics: sensors_pb2.Statistics = sensor_service(connection).getStatistics(binder_pb2.Empty())
        return statistics

    def environment(self) -> dict[str, str]:
        """Return the environment of a process that is to be the daemon's client."""
        if self.runtime_base is None:
            return dict(os.environ)
        return {**os.environ, "XDG_RUNTIME_DIR": str(self.runtime_base)}

    @contextlib.contextmanager
    def _reached(self) -> Iterator[None]:
        if self.runtime_base is None:
            yield
            return
        before = os.environ.get("XDG_RUNTIME_DIR")
        os.environ["XDG_RUNTIME_DIR"] = str(self.runtime_base)
        try:
            yield
        finally:
            if before is None:
                del os.environ["XDG_RUNTIME_DIR"]
            else:
                os.environ["XDG_RUNTIME_DIR"] = before


class PrivateDaemon(Daemon):
    """A daemon in a runtime directory of its own, which nobody else finds; ends with the `with` block."""

    def __init__(self, arguments: Sequence[str]) -> None:
        """Start `posed serve` with these arguments.

        Raises ServiceUnavailableError with the daemon's last words if it does not come up.
        """
        self.runtime_base = Path(tempfile.mkdtemp(prefix="posed-"))
        self._log = self.runtime_base / "log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "posed.cli", "serve", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=self.environment(),
                preexec_fn=_end_with_parent,
            )
        try:
            self._await_ready()
            super().__init__()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "PrivateDaemon":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the daemon and remove its directory."""
        self._process.terminate()
        try:
            self._process.wait(3.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self.runtime_base is not None:
            shutil.rmtree(self.runtime_base, ignore_errors=True)

    def _await_ready(self) -> None:
        deadline = time.monotonic() + _READY_TIMEOUT_S
        with self._reached():
            while not daemon_listens():
                if self._process.poll() is not None:
                    said = self._log.read_text(errors="replace").strip().splitlines()
                    why = said[-1] if said else f"exit code {self._process.returncode}"
                    raise start_error("the daemon to be measured", why)
                if time.monotonic() > deadline:
                    raise ServiceUnavailableError(
                        f"the daemon to be measured was not ready after {_READY_TIMEOUT_S:.0f} s"
                    )
                time.sleep(0.02)


def _end_with_parent() -> None:
    """Have the kernel end this process, just forked, with the one that measures, which may be killed (prctl(2))."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
