"""posed serve, start, stop and status, as real commands with real daemons."""

import configparser
import json
import os
import select
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from cli_shell import Shell

from posed import cli
from posed.cli import serve
from posed.client import PoseClient
from posed.fusion import DEFAULT_FILTER

_NO_DAEMON = "posed: error: no daemon is running; start one with 'posed start'\n"


def test_a_day_of_a_daemon(shell: Shell) -> None:
    assert (shell.run("status").returncode, shell.run("status").stdout) == (3, "posed is not running\n")
    started = shell.run("start", "--source", "sim:walk", "--position=-33.9,18.4,60")
    assert started.returncode == 0
    assert f"started: process {shell.daemon_pid}, source sim:walk, profile patonis2018" in started.stdout

    asked = shell.run("status")
    assert asked.returncode == 0
    assert f"running, process {shell.daemon_pid}" in asked.stdout
    assert "no sensor is active" in asked.stdout

    stopped = shell.run("stop")
    assert (stopped.returncode, stopped.stdout) == (0, f"stopped: process {shell.daemon_pid}\n")
    assert not (shell.directory / "posed" / "control.sock").exists()
    again = shell.run("stop")
    assert (again.returncode, again.stdout) == (0, "posed is not running\n")


def test_a_daemon_that_cannot_open_its_second_socket_leaves_no_first(shell: Shell) -> None:
    directory = shell.directory / "posed"
    directory.mkdir(mode=0o700)
    (directory / "pose.sock").write_text("precious")
    served = shell.run("serve", "--source=sim:still")
    assert served.returncode == 1
    assert "pose.sock" in served.stderr
    assert "Traceback" not in served.stderr
    assert not (directory / "control.sock").exists()
    assert (directory / "pose.sock").read_text() == "precious"


def test_start_finds_a_daemon_and_leaves_its_options(shell: Shell) -> None:
    shell.run("start", "--source=sim:still")
    pid = shell.daemon_pid
    found = shell.run("start", "--source=sim:walk")
    assert found.returncode == 0
    assert f"already running: process {pid}, source sim:still" in found.stdout
    assert "note: it keeps the options" in found.stderr
    assert shell.daemon_pid == pid


def test_start_makes_a_bound_daemon_stay(shell: Shell) -> None:
    with PoseClient(auto_create=True) as client:
        client.wait_connected(20)
        assert json.loads(shell.run("status", "--json").stdout)["started"] is False
        shell.run("start")
        assert json.loads(shell.run("status", "--json").stdout)["started"] is True
    assert shell.run("status").returncode == 0


def test_a_relative_recording_is_found_by_a_daemon_elsewhere(shell: Shell, recording: Path) -> None:
    assert shell.run("start", "--source", f"replay:{recording.name}", cwd=recording.parent).returncode == 0
    assert json.loads(shell.run("status", "--json").stdout)["source"] == f"replay:{recording}"


def test_status_in_json_of_nothing(shell: Shell) -> None:
    asked = shell.run("status", "--json")
    assert (asked.returncode, json.loads(asked.stdout)) == (3, {"running": False})


def test_status_tells_what_a_client_uses_and_is_no_client(shell: Shell) -> None:
    shell.run("start", "--seed=5")
    with PoseClient(auto_create=True) as client:
        assert client.next_pose(20) is not None
        facts = json.loads(shell.run("status", "--json").stdout)
        shown = shell.run("status").stdout
    assert (facts["running"], facts["pid"], facts["filter"]) == (True, shell.daemon_pid, DEFAULT_FILTER)
    assert (facts["bound_clients"], facts["connections"]) == (1, 1)
    assert {sensor["type"]: sensor["configured_hz"] for sensor in facts["sensors"]} == {
        "accelerometer": 50,
        "gyroscope": 50,
        "magnetic_field": 50,
    }
    assert facts["poses_published"] >= 1
    assert facts["lateness_p99_ms"] >= facts["lateness_p50_ms"] > 0
    explained = shell.run("status", "--help").stdout
    assert [key for key in facts if key not in explained] == []
    for word in ("published", "lateness", "gyroscope", "1 bound client, 1 connection"):
        assert word in shown


def test_stop_leaves_a_daemon_to_the_clients_that_need_it(shell: Shell) -> None:
    shell.run("start")
    with PoseClient(auto_create=True) as client:
        client.wait_connected(20)
        refused = shell.run("stop")
        assert refused.returncode == 1
        assert refused.stderr.startswith("posed: error: 1 bound client keeps the daemon alive;")
        pid = shell.daemon_pid
        forced = shell.run("stop", "--force")
        assert (forced.returncode, forced.stdout) == (0, f"stopped: process {pid}\n")


def test_a_daemon_that_hangs_is_told_from_none(shell: Shell, stop_process: Callable[[int], None]) -> None:
    shell.run("start")
    stop_process(shell.daemon_pid)
    for command in ("status", "stop"):
        asked = shell.run(command)
        assert asked.returncode == cli.EX_UNAVAILABLE
        assert "does not answer" in asked.stderr


def test_a_killed_daemon_is_no_daemon(shell: Shell) -> None:
    shell.run("start")
    daemon = os.pidfd_open(shell.daemon_pid)
    os.kill(shell.daemon_pid, signal.SIGKILL)
    assert select.select([daemon], [], [], 20)[0]
    os.close(daemon)
    assert shell.run("status").returncode == 3
    assert shell.run("stop").returncode == 0


@pytest.mark.parametrize("command", [["sensors"], ["events", "gyroscope"]])
def test_commands_that_need_a_daemon_say_how_to_start_one(shell: Shell, command: list[str]) -> None:
    asked = shell.run(*command)
    assert (asked.returncode, asked.stderr) == (cli.EX_UNAVAILABLE, _NO_DAEMON)


def test_a_daemon_in_the_foreground_ends_at_ctrl_c(shell: Shell) -> None:
    daemon = shell.begin("serve", "--log-format=json", "--profile=modern")
    assert daemon.stderr is not None
    ready = json.loads(daemon.stderr.readline())
    assert ready["level"] == "info"
    assert ready["message"].startswith("ready: ")
    second = shell.run("serve")
    assert second.returncode == cli.EX_TEMPFAIL
    assert second.stderr.count("\n") == 1
    assert f"already in {shell.directory}/posed (process {daemon.pid})" in second.stderr
    code, said = shell.end(daemon, signal.SIGINT)
    assert code == 0
    assert "SIGINT" in json.loads(said)["message"]


def test_a_bound_daemon_says_so(shell: Shell) -> None:
    daemon = shell.begin("serve", "--bound")
    assert daemon.stderr is not None
    assert " INFO ready: " in daemon.stderr.readline()
    assert json.loads(shell.run("status", "--json").stdout)["started"] is False


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("--source=replay:/nowhere", "recording /nowhere is missing"),
        ("--source=radio", "source 'radio' is unknown"),
        ("--source=replay:", "source 'replay:' lacks its path"),
        ("--loop", "loop with source 'sim"),
        ("--filter=best", "no filter is named 'best'"),
        ("--profile=pixel", "profile 'pixel' is not shipped"),
    ],
)
def test_what_keeps_a_daemon_from_starting_is_said(shell: Shell, option: str, words: str) -> None:
    served = shell.run("serve", option)
    assert (served.returncode, served.stderr.count("\n")) == (1, 1)
    assert served.stderr.startswith(f"posed: error: {words}")
    started = shell.run("start", option)
    assert started.returncode == 1
    assert started.stderr.startswith(f"posed: error: the daemon did not start: {words}")


def test_a_daemon_that_ends_without_a_word_is_unavailable(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Only the daemon that another process starts is told where to say that it is ready.
    (tmp_path / "sitecustomize.py").write_text("import os\n'NOTIFY_SOCKET' in os.environ and os._exit(3)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    started = shell.run("start")
    assert started.returncode == cli.EX_UNAVAILABLE
    assert started.stderr == "posed: error: the daemon did not start: it said nothing\n"


def test_the_systemd_unit_names_a_command_that_exists() -> None:
    unit = configparser.ConfigParser(interpolation=None)
    unit.optionxform = str  # type: ignore[assignment, method-assign]
    path = Path(serve.__file__).with_name("posed.service")
    unit.read_string(path.read_text())
    program, command = unit["Service"]["ExecStart"].split()
    assert program.endswith("/posed")
    assert command in cli.COMMANDS
    assert unit["Service"]["Type"] == "notify"
    assert unit["Service"]["RestartPreventExitStatus"] == str(cli.EX_TEMPFAIL)


def test_the_systemd_recipe_names_the_command_that_runs(shell: Shell) -> None:
    command = Path(sys.executable).with_name("posed")
    assert f"ExecStart={command} serve" in shell.run("serve", "--help").stdout


def test_a_daemon_told_to_align_its_poses_says_so_in_each(shell: Shell) -> None:
    assert shell.run("start", "--source=sim:pan", "--aligned").returncode == 0
    seen = shell.run("watch", "--json", "--count", "3", "--mode", "normal")
    poses = [json.loads(line) for line in seen.stdout.splitlines()]
    assert len(poses) == 3
    assert max(pose["predicted_ns"] for pose in poses) > 50_000_000
    shell.run("stop")
    shell.run("start", "--source=sim:pan")
    seen = shell.run("watch", "--json", "--count", "2", "--mode", "normal")
    assert [json.loads(line)["predicted_ns"] for line in seen.stdout.splitlines()] == [0, 0]
