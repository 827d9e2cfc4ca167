"""Every command and every program in README.md runs."""

import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

_README = (Path(__file__).parents[2] / "README.md").read_text()
_COMMANDS = [
    [line.removeprefix("$ ") for line in block.splitlines() if line.startswith("$ ")]
    for block in re.findall(r"```console\n(.*?)```", _README, re.DOTALL)
]
_PROGRAMS = re.findall(r"```python\n(.*?)```", _README, re.DOTALL)
# What takes minutes is run with less of the same.
_SHORTER = {
    "posed profile": ["--seconds", "0.5", "--repeats", "1"],
    "posed verify --quick": ["--sensors", "gyroscope", "--seconds", "1", "--rates", "50"],
}
# Its verdict on the daemon's timing is that on the machine as well.
_VERDICTS = {"posed verify --quick": (0, 1)}
# What serves until Ctrl-C: it is to end in good order once it has said where.
_SERVES = {"posed ar": ["--port", "0"]}


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """A private runtime directory, and recordings to work on in the current one."""
    rows = ["sensor,timestamp_ns,x,y,z"]
    for k in range(400):
        rows.append(f"gyroscope,{k * 5_000_000},0,0,0")
        rows.append(f"accelerometer,{k * 5_000_000},0,0,9.8")
        rows.append(f"magnetic_field,{k * 5_000_000},0,25,-40")
    (tmp_path / "walk.csv").write_text("\n".join(rows))
    (tmp_path / "recordings").mkdir()
    truth = [f"{row}," for row in rows[1:]] + [f"truth,{k * 5_000_000},0,0,0,1" for k in range(400)]
    (tmp_path / "recordings" / "known.csv").write_text("\n".join(["sensor,timestamp_ns,x,y,z,w", *truth]))
    with tempfile.TemporaryDirectory(prefix="posed-") as directory:
        monkeypatch.setenv("XDG_RUNTIME_DIR", directory)
        monkeypatch.chdir(tmp_path)
        yield tmp_path
        subprocess.run([sys.executable, "-m", "posed.cli", "stop", "--force"], check=True, capture_output=True)


@pytest.mark.parametrize("commands", _COMMANDS, ids=lambda commands: commands[0])
def test_the_commands_of_a_block_run_one_after_the_other(desk: Path, commands: list[str]) -> None:
    for command in commands:
        words = shlex.split(command)
        assert words[0] == "posed", command
        if command in _SERVES:
            _serve(words[1:] + _SERVES[command])
            continue
        done = subprocess.run(
            [sys.executable, "-m", "posed.cli", *words[1:], *_SHORTER.get(command, [])],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode in _VERDICTS.get(command, (0,)), (command, done.stderr)
        assert done.stdout or done.stderr, command


def _serve(words: list[str]) -> None:
    with subprocess.Popen(
        [sys.executable, "-u", "-m", "posed.cli", *words], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            assert "http://127.0.0.1:" in process.stdout.readline()
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()


@pytest.mark.parametrize("program", _PROGRAMS, ids=["poses", "events", "stream", "android"])
def test_the_programs_print_what_they_promise(desk: Path, program: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", program],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert process.stdout is not None
    assert process.stdin is not None
    with process:
        lines = [process.stdout.readline() for _ in range(5)]
        process.kill()
    assert all(re.search(r"\d\.\d|Enter", line) for line in lines), lines


def test_the_install_commands_are_those_that_ci_runs() -> None:
    assert "pip install -e '.[all,test]' && .venv/bin/pytest" in _README
    ci = (Path(__file__).parents[2] / ".ci" / "run").read_text()
    assert "-e '.[all,test]'" in ci
    assert _COMMANDS
    assert len(_PROGRAMS) == 4
