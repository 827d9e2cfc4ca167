"""posed profile: the accounts it reads, what it makes of its runs, and whole runs against real daemons."""

import json
import os
import re
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from posed.cli import main
from posed.cli.profiling import accounting, plot, table
from posed.cli.profiling.accounting import Reading, Usage
from posed.cli.profiling.clients import Received
from posed.cli.profiling.measurement import MODES, ModeRuns, Observation, steps
from posed.cli.profiling.report import PAPER, Repeated, Report, as_json, report
from posed.errors import InvalidArgumentError, MissingExtraError, ServiceUnavailableError
from posed.proto import sensors_pb2

_NAMES = {1: "accelerometer", 2: "magnetic_field", 4: "gyroscope"}


def test_a_reading_follows_the_cpu_time_of_the_process() -> None:
    before, used_before_ns = accounting.read(os.getpid()), time.process_time_ns()
    while time.process_time_ns() < used_before_ns + 20_000_000:
        pass
    after, used_ns = accounting.read(os.getpid()), time.process_time_ns() - used_before_ns
    assert after.cpu_ns - before.cpu_ns >= 20_000_000
    assert after.cpu_ns - before.cpu_ns <= used_ns + 20_000_000
    assert after.rss_kib > 1000


def test_a_reading_counts_what_goes_to_sleep() -> None:
    before = accounting.read(os.getpid())
    for _ in range(20):
        time.sleep(0.0001)
    assert accounting.read(os.getpid()).wakeups - before.wakeups >= 20


def test_a_process_that_ended_has_no_accounts() -> None:
    ended = subprocess.Popen(["true"])
    ended.wait()
    with pytest.raises(ServiceUnavailableError, match=f"process {ended.pid} ended"):
        accounting.read(ended.pid)


def test_usage_is_per_second_and_per_core() -> None:
    before = Reading(at_ns=0, cpu_ns=5, wakeups=10, rss_kib=1)
    after = Reading(at_ns=2_000_000_000, cpu_ns=500_000_005, wakeups=40, rss_kib=1000)
    assert accounting.usage(before, after) == Usage(25.0, 15.0, 1.024)


@pytest.fixture
def session() -> Iterator[int]:
    script = "sleep 60 & echo begun; wait"
    shell = subprocess.Popen(["sh", "-c", script], stdout=subprocess.PIPE, start_new_session=True)
    assert shell.stdout is not None
    shell.stdout.readline()
    yield shell.pid
    for pid in accounting.session_members(shell.pid):
        os.kill(pid, 9)
    shell.wait()
    shell.stdout.close()


def test_the_accounts_of_a_session_hold_its_children(session: int) -> None:
    assert len(accounting.session_members(session)) == 2
    assert accounting.read_session(session).cpu_ns > accounting.read(session).cpu_ns


def test_a_difference_below_the_spread_is_none() -> None:
    assert Repeated.of([3.0, 1.0, 2.0]) == Repeated(2.0, 2.0)
    assert not Repeated(2.0, 0.5).differs_from(Repeated(1.6, 0.1))
    assert Repeated(2.0, 0.3).differs_from(Repeated(1.6, 0.1))


def test_a_single_value_shows_no_difference() -> None:
    assert Repeated.of([3.0]) == Repeated(3.0, None)
    assert not Repeated.of([3.0]).differs_from(Repeated.of([9.0]))


def test_the_paper_s_table_is_the_modes_of_android() -> None:
    assert list(PAPER) == list(MODES)
    assert [row.events_per_s for row in PAPER.values()] == [25, 45, 150, 350]


def test_there_is_a_step_a_run_and_one_for_idle() -> None:
    assert steps(modes=4, repeats=5) == 5 * 13
    assert steps(modes=4, repeats=5, command=["client"]) == 5 * 5
    assert steps(modes=4, repeats=5, with_ar=True) == 5 * 21


def _observation(cpu: float, *, source: float = 0.0, client: float | None = None) -> Observation:
    return Observation(
        daemon=Usage(cpu, 20.0, 40.0),
        client=None if client is None else Usage(client, 30.0, 30.0),
        source_cpu_percent=source,
        filter_cpu_percent=source,
        events_fused_per_s=149.0,
        statistics=sensors_pb2.Statistics(
            lateness_p50_ms=0.25,
            lateness_p99_ms=0.5,
            sensors=[
                sensors_pb2.SensorStatistics(handle=handle, requested_period_us=20_000, configured_period_ns=20_000_000)
                for handle in (4, 1, 2, 9)
            ],
        ),
    )


def _runs(mode: str, daemon_cpu: tuple[float, float, float]) -> ModeRuns:
    return ModeRuns(
        sensor_names={**_NAMES, 9: "gravity"},
        idle=[_observation(0.25, source=0.0625) for _ in range(3)],
        pose=[_observation(cpu, source=0.5, client=0.75) for cpu in daemon_cpu],
        poses=[Received(30, events, (mode,)) for events in (450, 453, 450)],
        streaming=[_observation(3.25) for _ in range(3)],
        batched=[_observation(1.25) for _ in range(3)],
        raw=[Received(sensors=dict.fromkeys(_NAMES.values(), (51, 0, 1000000000))) for _ in range(6)],
    )


@pytest.fixture
def two_modes() -> Report:
    return report({"UI": _runs("UI", (1.25, 1.5, 1.75)), "GAME": _runs("FASTEST", (1.5, 1.75, 2.0))})


def test_a_report_subtracts_idle_and_takes_the_median(two_modes: Report) -> None:
    game = two_modes.modes["GAME"]
    assert game.daemon_cpu_percent == Repeated(1.5, 0.5)
    assert game.source_cpu_percent == Repeated(0.4375, 0.0)
    assert game.client_cpu_percent == Repeated(0.75, 0.0)
    assert game.streaming_cpu_percent == Repeated(3.0, 0.0)
    assert game.batched_cpu_percent == Repeated(1.0, 0.0)
    assert two_modes.idle.daemon_cpu_percent.median == 0.25


def test_events_are_counted_over_all_poses_of_all_repeats(two_modes: Report) -> None:
    assert two_modes.modes["GAME"].events_per_s.median == pytest.approx(1353 / 9.0)


def test_the_rates_are_those_of_the_pose_s_inputs(two_modes: Report) -> None:
    assert list(two_modes.modes["GAME"].sensor_hz) == ["accelerometer", "gyroscope", "magnetic_field"]
    ui = two_modes.modes["UI"].sensor_hz["gyroscope"]
    assert [ui.asked, ui.configured, ui.measured] == pytest.approx([15.0, 50.0, 50.0], rel=1e-5)


def test_the_json_has_the_figures_and_their_spreads(two_modes: Report) -> None:
    found = as_json(two_modes)
    assert set(found) == {"modes", "idle", "machine"}
    spread = found["modes"]["GAME"].pop("spread")
    assert set(found["modes"]["GAME"]) == {
        "sensor_hz",
        "events_per_s",
        "daemon_cpu_percent",
        "source_cpu_percent",
        "kernel_cpu_percent",
        "client_cpu_percent",
        "streaming_cpu_percent",
        "batched_cpu_percent",
        "wakeups_per_s",
        "rss_mb",
        "lateness_p50_ms",
        "lateness_p99_ms",
        "ar_cpu_percent",
        "ar_daemon_cpu_percent",
        "ar_server_cpu_percent",
        "ar_page_cpu_percent",
        "ar_world_cpu_percent",
    }
    assert found["modes"]["GAME"]["ar_cpu_percent"] is None
    assert spread["daemon_cpu_percent"] == 0.5
    assert found["modes"]["GAME"]["sensor_hz"]["accelerometer"] == {"asked": 50.0, "configured": 50.0, "measured": 50.0}
    assert set(found["machine"]) == {"cpu_model", "cores", "kernel", "python", "libzmq", "protobuf"}


def test_the_table_marks_what_does_not_differ(two_modes: Report) -> None:
    cells = {row[0]: row[1:] for row in table.rows(two_modes)}
    assert cells["daemon CPU %"] == ["1.25 (0.50)", "~ 1.50 (0.50)"]
    assert cells["- the paper's"] == ["45", "150"]


def test_the_ar_application_is_the_sum_of_its_parts() -> None:
    runs = _runs("GAME", (1.5, 1.75, 2.0))
    runs.ar = [replace(_observation(2.25, client=1.5), page=Usage(page, 30.0, 300.0)) for page in (20.0, 21.0, 25.0)]
    runs.ar_world = [replace(one, page=Usage(70.0, 60.0, 300.0)) for one in runs.ar]
    made = report({"GAME": runs})
    game = made.modes["GAME"]
    assert game.ar_daemon_cpu_percent == Repeated(2.0, 0.0)
    assert game.ar_server_cpu_percent == Repeated(1.5, 0.0)
    assert game.ar_page_cpu_percent == Repeated(21.0, 5.0)
    assert game.ar_cpu_percent == Repeated(24.5, 5.0)
    assert game.ar_world_cpu_percent == Repeated(73.5, 0.0)
    cells = {row[0]: row[1:] for row in table.rows(made)}
    assert cells["AR application CPU %"] == ["24.5 (5.0)"]
    assert cells["the paper's CPU %"] == ["13"]
    assert any("headless Chromium" in note for note in table.notes(made))


def test_the_notes_say_which_mode_was_in_force(two_modes: Report) -> None:
    assert table.notes(two_modes)[-1].startswith("GAME was asked and FASTEST was in force")


def test_markdown_is_one_table(two_modes: Report) -> None:
    lines = table.markdown(two_modes).splitlines()
    assert lines[:2] == ["|  | UI | GAME |", "| --- | ---: | ---: |"]
    assert {line.count("|") for line in lines if line.startswith("|")} == {4}


def test_a_plot_is_a_picture(two_modes: Report, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    plot.save_plot(two_modes, tmp_path / "cost.png")
    assert (tmp_path / "cost.png").read_bytes().startswith(b"\x89PNG")


def test_a_plot_that_cannot_be_written_is_said(two_modes: Report, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    with pytest.raises(InvalidArgumentError, match="cannot write the plot"):
        plot.save_plot(two_modes, tmp_path / "cost.unheard-of")


def test_without_matplotlib_a_plot_is_refused_before_anything_is_measured(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"posed\[plot\]"):
        plot.require_matplotlib()
    assert main(["profile", "--plot", "cost.png"]) == 1
    assert "pip install 'posed[plot]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--modes", "UI,GAMES"], "'GAMES' is no rate mode"),
        (["--seconds", "0"], "'0' is no duration"),
        (["--repeats", "0.5"], "'0.5' is no count"),
    ],
)
def test_a_bad_value_is_a_usage_error(arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_info:
        main(["profile", *arguments])
    assert exit_info.value.code == 2
    assert said in capsys.readouterr().err


def test_a_running_daemon_takes_no_source(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["profile", "--attach", "--source", "sim"]) == 1
    assert "--source has no use" in capsys.readouterr().err


def _profile(runtime_base: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "posed.cli", "profile", "--seconds", "0.3", "--repeats", "1", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "XDG_RUNTIME_DIR": str(runtime_base)},
    )


def test_a_mode_is_measured(tmp_path: Path) -> None:
    done = _profile(tmp_path, "--modes", "game", "--json")
    assert done.stderr == ""
    game = json.loads(done.stdout)["modes"]["GAME"]
    # One event more or less of each sensor in three poses or more.
    assert game["events_per_s"] == pytest.approx(150, abs=10)
    assert [hz["measured"] for hz in game["sensor_hz"].values()] == pytest.approx([50.0] * 3, abs=0.5)
    assert 0 < game["source_cpu_percent"] + game["kernel_cpu_percent"] < game["daemon_cpu_percent"]
    assert list(tmp_path.iterdir()) == []


def test_the_ar_application_is_measured(tmp_path: Path, browser_path: str) -> None:
    done = _profile(tmp_path, "--modes", "game", "--with-ar", "--json")
    assert done.stderr == ""
    game = json.loads(done.stdout)["modes"]["GAME"]
    parts = [game[f"ar_{part}cpu_percent"] for part in ("daemon_", "server_", "page_")]
    assert min(parts) > 0
    assert game["ar_cpu_percent"] == pytest.approx(sum(parts), abs=1e-3)
    assert game["ar_world_cpu_percent"] > 0
    assert list(tmp_path.iterdir()) == []


def test_without_a_browser_the_ar_application_is_refused_before_anything_is_measured(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["profile", "--with-ar"]) == 1
    assert "needs a browser, one of chromium, chromium-browser, google-chrome" in capsys.readouterr().err


_CLIENT = """\
import sys, posed.client
with posed.client.PoseClient(getattr(posed.client, "SENSOR_DELAY_" + sys.argv[1])) as client:
    for pose in client:
        pass
"""


def test_the_user_s_own_client_is_measured(tmp_path: Path) -> None:
    command = [sys.executable, "-c", _CLIENT, "{mode}"]
    done = _profile(tmp_path, "--modes", "ui", "--json", str(tmp_path / "ui.json"), "--", *command)
    assert done.stderr == ""
    ui = json.loads((tmp_path / "ui.json").read_text())["modes"]["UI"]
    assert ui["client_cpu_percent"] > 0
    assert ui["streaming_cpu_percent"] is None
    assert ui["sensor_hz"]["magnetic_field"] == {"asked": 15.0, "configured": 15.0, "measured": None}
    assert "client CPU %" in done.stdout


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["/does/not/exist"], "cannot run '/does/not/exist': No such file or directory"),
        ([sys.executable, "-c", "import sys; sys.exit('no phone')"], "ended with exit code 1 .*: no phone"),
    ],
)
def test_a_command_that_does_not_run_is_said(tmp_path: Path, command: list[str], said: str) -> None:
    done = _profile(tmp_path, "--modes", "ui", "--", *command)
    assert done.returncode == 1
    assert re.search(said, done.stderr)


def test_a_daemon_that_does_not_start_is_said(tmp_path: Path) -> None:
    done = _profile(tmp_path, "--source", "replay:/does/not/exist.csv")
    assert done.returncode == 1
    assert "did not start: /does/not/exist.csv cannot be read" in done.stderr


_MEASURER = """\
from posed.cli.profiling.daemons import PrivateDaemon
with PrivateDaemon(["--source=sim:still"]) as daemon:
    print(daemon.pid, daemon.runtime_base, flush=True)
    input()
"""


def test_a_daemon_that_is_measured_ends_with_a_measurer_that_is_killed() -> None:
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", _MEASURER], text=True, **pipes) as measurer:
        assert measurer.stdout is not None
        pid, runtime_base = measurer.stdout.readline().split()
        daemon = os.pidfd_open(int(pid))
        try:
            measurer.kill()
            ended, _, _ = select.select([daemon], [], [], 10.0)
            assert ended == [daemon]
        finally:
            os.close(daemon)
            shutil.rmtree(runtime_base)
