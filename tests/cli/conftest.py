"""The `posed` command in a runtime directory of its own, and a recording to give it."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from cli_shell import Shell


@pytest.fixture
def shell(monkeypatch: pytest.MonkeyPatch) -> Iterator[Shell]:
    # Not tmp_path: a socket's path may have 107 bytes.
    made = Shell(Path(tempfile.mkdtemp(prefix="posed-")))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(made.directory))
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    monkeypatch.setenv("COLUMNS", "80")
    yield made
    made.clear()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Six seconds of a phone that lies on its back and is turned to and fro, in posed's own CSV layout."""
    lines = ["sensor,timestamp_ns,x,y,z"]
    for row in range(1200):
        time_ns = 7_000_000_000 + row * 5_000_000
        rate = 0.5 if row // 200 % 2 else -0.5
        lines.append(f"gyroscope,{time_ns},0.001,-0.002,{rate}")
        if row % 2 == 0:
            lines.append(f"accelerometer,{time_ns + 1000},0.02,-0.01,9.81")
        if row % 4 == 0:
            lines.append(f"magnetic_field,{time_ns + 2000},0.5,22.0,-40.0")
    path = tmp_path / "turned.csv"
    path.write_text("\n".join(lines) + "\n")
    return path
