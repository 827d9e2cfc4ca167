"""posed watch, sensors, events and demo, as real commands."""

import contextlib
import json
import math
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from cli_shell import Shell

from posed.cli.pose_text import JSON_KEYS


@pytest.fixture
def short_recording(tmp_path: Path) -> Path:
    """Half a second of a phone that lies still."""
    recording = tmp_path / "short.csv"
    rows = ["accelerometer,{},0,0,9.81", "gyroscope,{},0,0,0", "magnetic_field,{},0,22,-43"]
    lines = (row.format(at_ms * 1_000_000) for at_ms in range(0, 500, 20) for row in rows)
    recording.write_text("sensor,timestamp_ns,x,y,z\n" + "\n".join(lines) + "\n")
    return recording


def test_poses_as_json(shell: Shell) -> None:
    shell.run("start", "--position=40.6,22.9,60")
    watched = shell.run("watch", "--json", "--count=4", "--mode=ui", "--rate=20")
    assert watched.returncode == 0
    poses = [json.loads(line) for line in watched.stdout.splitlines()]
    assert len(poses) == 4
    for pose in poses:
        assert [key for key in pose if key not in JSON_KEYS] == []
        assert math.hypot(*pose["quaternion"]) == pytest.approx(1)
        assert pose["rate_mode"] == "UI"
        assert pose["position"]["latitude_deg"] == 40.6
        assert pose["status"] == []
    numbers = [pose["sequence"] for pose in poses]
    assert numbers == sorted(set(numbers))


def test_poses_as_lines_off_a_terminal(shell: Shell) -> None:
    shell.run("start")
    watched = shell.run("watch", "--count=2")
    assert watched.returncode == 0
    assert [line.split()[1] for line in watched.stdout.splitlines()] == ["azimuth"] * 2


def test_watch_waits_for_a_daemon_and_outlives_it(shell: Shell) -> None:
    watch = shell.begin("watch", "--json")
    assert watch.stdout is not None
    assert watch.stderr is not None
    assert watch.stderr.readline() == "posed: no daemon has answered yet; 'posed start' starts one\n"
    shell.run("start")
    assert watch.stderr.readline() == "posed: connected\n"
    first = json.loads(watch.stdout.readline())
    shell.run("stop")
    while "the daemon" not in (said := watch.stderr.readline()):
        assert said
    shell.run("start")
    while json.loads(watch.stdout.readline())["boot_id"] == first["boot_id"]:
        pass
    code, said = shell.end(watch, signal.SIGINT)
    assert (code, "Traceback" in said) == (0, False)


@pytest.mark.parametrize("command", [["watch"], ["watch", "--json"], ["events", "gyroscope", "--rate=GAME"]])
def test_a_stream_ends_with_its_reader(shell: Shell, command: list[str]) -> None:
    shell.run("start")
    stream = shell.begin(*command)
    assert stream.stdout is not None
    assert stream.stdout.readline()
    stream.stdout.close()
    assert shell.end(stream) == (0, "")


def test_a_stream_ends_with_its_reader_even_while_nothing_comes(shell: Shell) -> None:
    watch = shell.begin("watch", "--json")
    assert watch.stdout is not None
    assert watch.stderr is not None
    assert watch.stderr.readline()
    watch.stdout.close()
    assert shell.end(watch) == (0, "")


@pytest.mark.parametrize("command", [["watch"], ["events", "accelerometer"]])
def test_ctrl_c_ends_a_stream_in_good_order(shell: Shell, command: list[str]) -> None:
    shell.run("start")
    stream = shell.begin(*command)
    assert stream.stdout is not None
    assert stream.stdout.readline()
    assert shell.end(stream, signal.SIGINT) == (0, "")


def test_sigterm_ends_events_with_its_code(shell: Shell) -> None:
    shell.run("start")
    stream = shell.begin("events", "accelerometer")
    assert stream.stdout is not None
    assert stream.stdout.readline()
    assert shell.end(stream, signal.SIGTERM) == (128 + signal.SIGTERM, "")


_STREAMS = [["watch"], ["watch", "--json", "--count=1000"], ["events", "gyroscope", "--latency=60000", "--rate=GAME"]]


@pytest.mark.parametrize("command", _STREAMS)
def test_a_stream_ends_with_the_recording(shell: Shell, short_recording: Path, command: list[str]) -> None:
    shell.run("start", f"--source=replay:{short_recording}")
    stream = shell.run(*command)
    assert stream.returncode == 0
    assert len(stream.stdout.splitlines()) >= 4
    assert stream.stderr.startswith("posed: the recording has ended, so nothing more comes; ")
    assert "'posed start'" in stream.stderr
    late = shell.run(*command)
    assert (late.returncode, late.stdout) == (1, "")
    assert late.stderr == stream.stderr.replace("posed: ", "posed: error: ", 1)


def test_a_wait_for_a_one_shot_sensor_ends_with_the_recording(shell: Shell, short_recording: Path) -> None:
    shell.run("start", f"--source=replay:{short_recording}")
    waited = shell.run("events", "significant_motion")
    assert (waited.returncode, waited.stdout) == (1, "")
    assert waited.stderr.startswith("posed: error: the recording has ended, ")


@pytest.mark.parametrize("count", [None, 1000])
def test_the_live_view_of_a_recording_that_ended_stays_unless_poses_are_counted(
    shell: Shell, short_recording: Path, count: int | None
) -> None:
    shell.run("start", f"--source=replay:{short_recording}")
    terminal, its_end = pty.openpty()
    watch = subprocess.Popen(
        [sys.executable, "-m", "posed.cli", "watch", *([f"--count={count}"] if count else [])],
        stdin=its_end,
        stdout=its_end,
        stderr=its_end,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80", "LINES": "24"},
    )
    os.close(its_end)
    seen = b""
    while b"the recording has ended" not in seen:
        seen += os.read(terminal, 65536)
    if count is None:
        assert watch.poll() is None
        watch.send_signal(signal.SIGINT)
    with contextlib.suppress(OSError):  # how a pseudo-terminal tells that nobody writes to it any more
        while os.read(terminal, 65536):
            pass
    os.close(terminal)
    assert watch.wait(20) == 0


def test_a_filter_that_does_not_run_is_answered_with_those_that_do(shell: Shell) -> None:
    shell.run("start", "--filter=dcm,dcm-adaptive")
    assert shell.run("watch", "--filter=dcm-adaptive", "--count=1").returncode == 0
    for more in ([], ["--json"]):
        watched = shell.run("watch", "--filter=vqf", *more)
        assert (watched.returncode, watched.stdout) == (1, "")
        assert watched.stderr == "posed: error: the daemon runs no filter 'vqf'; it runs dcm, dcm-adaptive\n"


def test_sensors(shell: Shell) -> None:
    shell.run("start")
    sensors = {sensor["string_type"]: sensor for sensor in json.loads(shell.run("sensors", "--json").stdout)}
    gyroscope = sensors["android.sensor.gyroscope"]
    assert (gyroscope["name"], gyroscope["min_delay"], gyroscope["max_delay"]) == ("BMI055 Gyroscope", 5000, 200_000)
    assert "android.sensor.rotation_vector" in sensors
    explained = shell.run("sensors", "--help").stdout
    assert [key for key in gyroscope if key not in explained] == []

    heading, *lines = shell.run("sensors").stdout.splitlines()
    assert heading.split()[:2] == ["#", "type"]
    assert [line.split()[1] for line in lines] == [each.removeprefix("android.sensor.") for each in sensors]
    assert all(
        f"{sensor['name']}, {sensor['vendor']}" in line for sensor, line in zip(sensors.values(), lines, strict=True)
    )


@pytest.mark.parametrize("name", ["gyroscope", "GYROSCOPE", "android.sensor.gyroscope", "4"])
def test_events_of_a_sensor_by_each_of_its_names(shell: Shell, name: str) -> None:
    shell.run("start")
    listened = shell.run("events", name, "--rate=50", "--count=3", "--json")
    events = [json.loads(line) for line in listened.stdout.splitlines()]
    assert [event["sensor"] for event in events] == ["gyroscope"] * 3
    assert [event["handle"] for event in events] == [4] * 3
    assert all(len(event["values"]) == 3 and event["accuracy"] == 3 for event in events)
    times = [event["timestamp_ns"] for event in events]
    assert times == sorted(times)
    assert times[2] - times[0] == pytest.approx(40e6, abs=8e6)


def test_events_for_people(shell: Shell) -> None:
    shell.run("start", "--source=sim:still")
    lines = shell.run("events", "gravity", "--rate=UI", "--latency=300", "--count=2").stdout.splitlines()
    assert len(lines) == 2
    assert all("m/s²" in line and line.endswith("high") for line in lines)


def test_what_is_set_is_told(shell: Shell) -> None:
    shell.run("start")
    stream = shell.begin("events", "light", "--json")
    assert stream.stdout is not None
    assert json.loads(stream.stdout.readline())["values"] == [300]
    assert shell.run("set", "light", "12").returncode == 0
    assert json.loads(stream.stdout.readline())["values"] == [12]
    refused = shell.run("set", "light", "1e9")
    assert (refused.returncode, refused.stderr.count("\n")) == (1, 1)
    assert "light = 1e+09 is not what its sensor can read; allowed: 0 to 10000" in refused.stderr
    assert shell.run("set", "gyroscope", "1").returncode == 2


def test_an_unknown_sensor_is_answered_with_the_list(shell: Shell) -> None:
    shell.run("start")
    asked = shell.run("events", "thermometer")
    assert asked.returncode == 1
    assert asked.stderr.startswith("posed: error: there is no sensor 'thermometer'; there are accelerometer, ")
    assert asked.stderr.count("\n") == 1


def test_a_heading_without_a_position_is_answered_with_what_it_needs(shell: Shell) -> None:
    shell.run("start")
    asked = shell.run("events", "heading")
    assert (asked.returncode, asked.stderr.count("\n")) == (1, 1)
    assert asked.stderr.endswith("; heading needs --position of 'posed serve' or 'posed start'\n")
    shell.run("stop")
    shell.run("start", "--position=40.6,22.9,60")
    assert shell.run("events", "heading", "--count=1").returncode == 0


def test_a_demo_leaves_nothing_behind_and_the_users_daemon_alone(shell: Shell) -> None:
    shell.run("start")
    ran = shell.run("demo", "--seconds=2")
    assert (ran.returncode, ran.stderr) == (0, "")
    lines = ran.stdout.splitlines()
    assert lines
    assert all(line.split()[1] == "azimuth" for line in lines)
    assert [path.name for path in shell.directory.iterdir()] == ["posed"]
    facts = json.loads(shell.run("status", "--json").stdout)
    assert (facts["pid"], facts["poses_published"]) == (shell.daemon_pid, 0)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_demo_cut_short_leaves_nothing_behind(shell: Shell, number: signal.Signals, code: int) -> None:
    demo = shell.begin("demo", "--seconds=60")
    assert demo.stdout is not None
    assert demo.stdout.readline()
    assert shell.end(demo, number) == (code, "")
    assert list(shell.directory.iterdir()) == []


def test_a_demo_on_a_terminal_draws(shell: Shell) -> None:
    terminal, its_end = pty.openpty()
    demo = subprocess.Popen(
        [sys.executable, "-m", "posed.cli", "demo", "--seconds=3"],
        stdin=its_end,
        stdout=its_end,
        stderr=subprocess.PIPE,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "80", "LINES": "24"},
    )
    os.close(its_end)
    seen = b""
    while True:
        try:
            seen += os.read(terminal, 65536)
        except OSError:  # how a pseudo-terminal tells that nobody writes to it any more
            break
    os.close(terminal)
    _, said = demo.communicate(timeout=20)
    assert (demo.returncode, said) == (0, b"")
    drawn = seen.decode()
    for word in ("posed", "connected", "azimuth", "quaternion", "GAME", "Ctrl-C ends"):
        assert word in drawn
