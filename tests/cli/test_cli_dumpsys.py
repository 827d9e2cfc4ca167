"""`posed dumpsys` as a user runs it."""

from cli_shell import Shell


def test_without_a_daemon_it_says_so(shell: Shell) -> None:
    run = shell.run("dumpsys", "sensorservice")
    assert (run.returncode, run.stdout) == (69, "")
    assert "no daemon is running" in run.stderr


def test_it_knows_one_service(shell: Shell) -> None:
    run = shell.run("dumpsys", "window")
    assert run.returncode == 2
    assert "sensorservice" in run.stderr


def test_it_prints_the_state_whole(shell: Shell) -> None:
    assert shell.run("start").returncode == 0
    run = shell.run("dumpsys", "sensorservice")
    assert (run.returncode, run.stderr) == (0, "")
    lines = run.stdout.splitlines()
    assert lines[0].startswith("Captured at: ")
    assert "0 active connections" in lines
    assert lines[-1] == "Previous Registrations:"
