"""posed fuse: a recording into CSV."""

import csv
import io
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from cli_shell import Shell

from posed.cli import fuse, main
from posed.errors import InvalidArgumentError
from posed.events import Pose
from posed.fusion import DEFAULT_FILTER


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_poses_of_a_recording(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fuse", str(recording)]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert said.out.startswith(f"{fuse.HEADER}\n")
    rows = _rows(said.out)
    numbers = [int(row["sequence"]) for row in rows]
    assert numbers == list(range(numbers[0], 60))
    for row in rows:
        assert math.hypot(*(float(row[axis]) for axis in ("qx", "qy", "qz", "qw"))) == pytest.approx(1)
        assert float(row["qw"]) >= 0
        assert (row["rate_mode"], row["filter"]) == ("GAME", DEFAULT_FILTER)
        assert int(row["timestamp_ns"]) <= 7_000_000_000 + int(row["sequence"]) * 100_000_000
    # Turned by 0.5 rad/s for a second, and back.
    headings = [2 * math.atan2(float(row["qz"]), float(row["qw"])) for row in rows]
    assert max(headings) - min(headings) == pytest.approx(0.5, abs=0.05)


def test_the_same_recording_gives_the_same_bytes(shell: Shell, recording: Path, tmp_path: Path) -> None:
    to_stdout = shell.run("fuse", str(recording), "--mode=FASTEST", "--rate=40")
    to_file = shell.run("fuse", str(recording), "--mode=FASTEST", "--rate=40", "-o", str(tmp_path / "poses.csv"))
    assert (to_stdout.returncode, to_file.returncode) == (0, 0)
    assert (tmp_path / "poses.csv").read_text() == to_stdout.stdout
    assert to_file.stderr == f"{len(_rows(to_stdout.stdout))} poses written to {tmp_path / 'poses.csv'}\n"
    assert list(shell.directory.iterdir()) == []


def test_every_float_is_the_one_computed(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["fuse", str(recording), "--mode", "normal"])
    for row in _rows(capsys.readouterr().out):
        for name in ("qx", "qy", "qz", "qw", "wx", "wy", "wz", "heading_accuracy_rad"):
            assert repr(float(row[name])) == row[name]


def test_rows_out_of_order_are_told(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with recording.open("a") as file:
        file.write("gyroscope,7000000000,0,0,0\n")
    assert main(["fuse", str(recording)]) == 0
    assert capsys.readouterr().err == "posed: note: 1 gyroscope rows out of time order are left out\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.csv"], "missing.csv cannot be read"),
        (["RECORDING", "--filter=best"], "no filter is named 'best'"),
        (["RECORDING", "--profile=pixel"], "profile 'pixel' is not shipped"),
        (["RECORDING", "-o", "/nowhere/poses.csv"], "cannot write /nowhere/poses.csv"),
    ],
)
def test_what_cannot_be_fused_is_said(
    arguments: list[str], words: str, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fuse", *(str(recording) if word == "RECORDING" else word for word in arguments)]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"posed: error: {words}")
    assert said.count("\n") == 1


def test_a_recording_without_a_magnetometer_has_no_pose(
    recording: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    kept = [line for line in recording.read_text().splitlines() if not line.startswith("magnetic_field")]
    path = tmp_path / "two.csv"
    path.write_text("\n".join(kept))
    assert main(["fuse", str(path)]) == 1
    assert "it has no android.sensor.magnetic_field" in capsys.readouterr().err


def test_a_recording_that_gives_no_pose_is_an_error(
    recording: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    header, *rows = recording.read_text().splitlines()
    path = tmp_path / "backwards.csv"
    path.write_text("\n".join([header, *reversed(rows)]))
    output = tmp_path / "poses.csv"
    assert main(["fuse", str(path), "-o", str(output)]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "posed: note: 599 accelerometer rows out of time order are left out"
    assert said[-1].startswith("posed: error: backwards gives no pose: in time order it has 1 accelerometer, ")
    assert [line for line in said if "error" in line] == said[-1:]
    assert not output.exists()
    assert main(["fuse", str(path)]) == 1
    assert capsys.readouterr().out == ""


def test_filters_side_by_side_have_the_poses_that_each_has_alone(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("vqf")
    assert main(["fuse", str(recording), "--filter", "dcm,vqf"]) == 0
    both = _rows(capsys.readouterr().out)
    for name in ("dcm", "vqf"):
        main(["fuse", str(recording), "--filter", name])
        alone = _rows(capsys.readouterr().out)
        assert alone
        assert [row for row in both if row["filter"] == name] == alone
    numbers = [int(row["sequence"]) for row in both]
    assert numbers == sorted(numbers)


def test_the_same_filter_twice_is_a_usage_error(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["fuse", str(recording), "--filter", "dcm,dcm"])
    assert "'dcm,dcm' names a filter twice" in capsys.readouterr().err


def test_aligned_poses_say_how_far_they_were_turned_on(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["fuse", str(recording), "--mode", "normal"])
    held = _rows(capsys.readouterr().out)
    assert main(["fuse", str(recording), "--mode", "normal", "--aligned"]) == 0
    turned = _rows(capsys.readouterr().out)
    assert {row["predicted_ns"] for row in held} == {"0"}
    assert len(turned) == len(held)
    for one, other in zip(held, turned, strict=True):
        instant_ns = 7_000_000_000 + int(other["sequence"]) * 100_000_000
        assert int(other["timestamp_ns"]) + int(other["predicted_ns"]) == instant_ns
        same = [one[name] == other[name] for name in ("timestamp_ns", "wz", "status")]
        assert all(same)
        # Turned about the vertical by the rate.
        turn = 2 * (math.atan2(float(other["qz"]), float(other["qw"])) - math.atan2(float(one["qz"]), float(one["qw"])))
        assert turn == pytest.approx(float(one["wz"]) * int(other["predicted_ns"]) * 1e-9, abs=1e-3)
    assert max(int(row["predicted_ns"]) for row in turned) >= 100_000_000


def test_a_failed_fuse_writes_nothing(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object, **__: object) -> Iterator[Pose]:
        raise InvalidArgumentError("no magnetometer")
        yield

    output = tmp_path / "poses.csv"
    output.write_text("precious")
    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr(fuse, "fuse_recording", broken)
    assert main(["fuse", str(recording), "-o", str(output)]) == 1
    assert main(["fuse", str(recording)]) == 1
    assert output.read_text() == "precious"
    assert sorted(tmp_path.iterdir()) == before
    assert capsys.readouterr().out == ""


def test_a_fuse_that_breaks_midway_leaves_the_old_output(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: Pose) -> str:
        raise InvalidArgumentError("midway")

    output = tmp_path / "poses.csv"
    output.write_text("precious")
    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr(fuse, "csv_row", broken)
    assert main(["fuse", str(recording), "-o", str(output)]) == 1
    assert output.read_text() == "precious"
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("link", [None, Path.symlink_to, Path.hardlink_to])
def test_the_recording_is_no_output(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], link: Callable[[Path, Path], None] | None
) -> None:
    output = recording
    if link is not None:
        output = tmp_path / "link.csv"
        link(output, recording)
    before = recording.read_bytes()
    assert main(["fuse", str(recording), "-o", str(output)]) == 1
    assert "is the recording itself" in capsys.readouterr().err
    assert recording.read_bytes() == before
