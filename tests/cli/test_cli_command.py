"""The `posed` command itself: its table, its imports, its exit codes."""

import re
import subprocess
import sys
from importlib.metadata import entry_points, version
from types import ModuleType

import pytest

from posed import cli
from posed.errors import AlreadyRunningError, PosedError, ServiceUnavailableError

_MODULES_AFTER_HELP = """
import sys
import posed.cli
try:
    posed.cli.main(["--help"])
except SystemExit:
    pass
print(*sys.modules, file=sys.stderr)
"""


def test_help_imports_no_library_and_no_room() -> None:
    ran = subprocess.run([sys.executable, "-c", _MODULES_AFTER_HELP], capture_output=True, text=True, check=True)
    modules = set(ran.stderr.split())
    assert not modules & {"numpy", "zmq", "rich", "google.protobuf", "asyncio", "importlib.metadata", "subprocess"}
    assert {name for name in modules if name.startswith("posed.")} == {"posed.cli", "posed.errors", "posed.version"}


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    for name, (_, summary) in cli.COMMANDS.items():
        assert re.search(rf"^ +{name} +{re.escape(summary)}$", said, re.MULTILINE)


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_every_command_explains_itself(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([command, "--help"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.startswith(f"usage: posed {command}")


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert ended.value.code == 0
    assert re.fullmatch(
        rf"posed {re.escape(version('posed'))}, filters (compiled|interpreted)\n", capsys.readouterr().out
    )


def test_the_script_leads_to_main() -> None:
    (script,) = entry_points(group="console_scripts", name="posed")
    assert script.load() is cli.main


def test_without_a_command_it_shows_the_help_and_fails(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == cli.EX_USAGE
    assert capsys.readouterr().err.startswith("usage: posed")


@pytest.mark.parametrize("arguments", [["dance"], ["--json", "status"], ["stop", "--now"], ["fuse"]])
def test_wrong_usage_is_exit_code_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    assert ended.value.code == cli.EX_USAGE
    assert "error:" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (PosedError("no good"), 1),
        (OSError(28, "No space left on device"), 1),
        (ServiceUnavailableError("not there"), cli.EX_UNAVAILABLE),
        (AlreadyRunningError("one runs"), cli.EX_TEMPFAIL),
    ],
)
def test_an_error_is_one_line_and_an_exit_code(
    error: Exception, code: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(arguments: object) -> int:
        raise error

    module = ModuleType("posed_failing_command")
    module.__dict__.update(add_arguments=lambda parser: None, run=run)
    monkeypatch.setitem(sys.modules, "posed_failing_command", module)
    monkeypatch.setitem(cli.COMMANDS, "fail", ("posed_failing_command", "fail"))
    assert cli.main(["fail"]) == code
    assert capsys.readouterr().err == f"posed: error: {error}\n"
