"""posed evaluate: filters against recordings with truth."""

import json
import math
from pathlib import Path

import pytest
from cli_shell import Shell

from posed.cli import main


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    """Eight seconds of a phone on its back that is turned to and fro, with truth."""
    lines = ["sensor,timestamp_ns,x,y,z,w"]
    heading = 0.0
    for row in range(800):
        time_ns = 7_000_000_000 + row * 10_000_000
        rate = 0.5 if row // 200 % 2 else -0.5
        heading += 0.01 * rate
        north_x, north_y = 22.0 * math.sin(heading), 22.0 * math.cos(heading)
        lines.append(f"accelerometer,{time_ns},0,0,9.81,")
        lines.append(f"gyroscope,{time_ns},0,0,{rate},")
        lines.append(f"magnetic_field,{time_ns},{north_x},{north_y},-40,")
        lines.append(f"truth,{time_ns},0,0,{math.sin(heading / 2)},{math.cos(heading / 2)}")
    folder = tmp_path / "trials"
    folder.mkdir()
    (folder / "turned.csv").write_text("\n".join(lines) + "\n")
    return folder / "turned.csv"


def test_a_trial_is_evaluated_and_written_down(trial: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    outputs = {name: tmp_path / f"report.{name}" for name in ("json", "markdown", "html")}
    options = [f"--{name}={path}" for name, path in outputs.items()]
    assert main(["evaluate", str(trial), "--filters=dcm", "--modes=native,game,NORMAL", "--jobs=1", *options]) == 0
    said = capsys.readouterr()
    assert "csv: means over trials" in said.out
    assert "turned" in said.out
    assert "trials skipped" not in said.err
    written = json.loads(outputs["json"].read_text())
    assert [(each["filter"], each["mode"]) for each in written["results"]] == [
        ("dcm", "native"),
        ("dcm", "GAME"),
        ("dcm", "NORMAL"),
    ]
    for each in written["results"]:
        assert (each["dataset"], each["trial"], each["groups"]) == ("csv", "turned", ["all_trials", "trials"])
        assert each["total"] < 1.0
        assert each["ns_per_event"] > 0
    # Up to 100 ms behind a turn of 29 deg/s.
    normal = written["results"][2]
    assert 1.0 < normal["pose10hz_total"] < 3.0
    assert written["summary"][0]["trials"] == 1
    assert outputs["markdown"].read_text().startswith("# Orientation error\n")
    assert outputs["html"].read_text().startswith("<!doctype html>")


def test_broken_trials_are_named_skipped_and_counted(shell: Shell, trial: Path) -> None:
    (trial.parent / "broken.csv").write_text("sensor,timestamp_ns,x,y,z,w\ngyroscope,1,0,zero,0,\n")
    (trial.parent / "cut.mat").write_bytes(b"MATLAB 5.0 MAT-file, and no more")
    done = shell.run("evaluate", str(trial.parent), "--filters", "dcm", "--modes", "GAME")
    assert done.returncode == 65
    assert "csv: total error of each trial" in done.stdout
    lines = done.stderr.splitlines()
    assert lines[0].startswith(f"posed: skipped: {trial.parent / 'broken.csv'}:2, column y: 'zero' is not a number")
    assert lines[1].startswith(f"posed: skipped: {trial.parent / 'cut.mat'} is not a readable MATLAB file")
    assert lines[2] == "posed: 2 of 3 trials skipped, 1 evaluated"
    assert "Traceback" not in done.stderr


def test_nothing_that_can_be_read(trial: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trial.write_text("")
    assert main(["evaluate", str(trial)]) == 65
    said = capsys.readouterr()
    assert said.out == ""
    assert "is empty" in said.err
    assert main(["evaluate", str(trial), "--json", str(trial.with_name("none.json"))]) == 65
    assert not trial.with_name("none.json").exists()
    assert "1 of 1 trials skipped, 0 evaluated" in said.err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["nowhere"], "posed: error: nowhere is missing; name a trial or a folder of trials"),
        (["TRIAL", "--filters=best"], "posed: error: no filter is named 'best'; choose one of"),
        (["TRIAL", "--filters=dcm,dcm"], "none twice"),
        (["TRIAL", "--modes=GAME", "--json=/nowhere/x.json"], "posed: error: cannot write /nowhere/x.json"),
        (["TRIAL", "--filters=phone"], "posed: error: no trial has what phone needs"),
    ],
)
def test_mistakes_are_one_line(trial: Path, options: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", *(option.replace("TRIAL", str(trial)) for option in options), "--jobs=1"]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert said in lines[0]


def test_an_unknown_mode_is_a_usage_error(trial: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["evaluate", str(trial), "--modes=HASTY"])
    assert "'HASTY' is no mode; allowed: native, FASTEST, GAME, UI, NORMAL" in capsys.readouterr().err
