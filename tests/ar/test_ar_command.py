"""`posed ar` refuses in one line what it could not serve, before it listens."""

import subprocess
import sys
from pathlib import Path

import pytest

# No address of this machine's: what is not refused before ends here.
_NOWHERE = ("--host", "192.0.2.1", "--port", "0")
_PATIENCE_S = 60.0


def _said(*options: str) -> str:
    words = [sys.executable, "-m", "posed.cli", "ar", *_NOWHERE, *options]
    done = subprocess.run(words, capture_output=True, text=True, timeout=_PATIENCE_S, check=False)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    return done.stderr


@pytest.mark.parametrize("options", [("--crs", "EPSG:2100"), ("--heights", "geoid:43")])
def test_how_to_read_a_file_is_said_of_a_file(options: tuple[str, str]) -> None:
    assert "--crs and --heights say how to read the file of --places" in _said(*options)


def test_a_runtime_directory_that_cannot_be_made_is_said_before_anybody_follows_a_link(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "nowhere"))
    assert "cannot make" in _said()
