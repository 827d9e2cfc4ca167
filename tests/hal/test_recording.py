"""Reading recordings: trial folders, comma-separated text, and what is said about broken ones."""

import builtins
import gzip
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posed.errors import MissingExtraError, RecordingError
from posed.events import SensorType
from posed.hal.attitude_trial import load_trial
from posed.hal.csv_recording import load_csv
from posed.hal.recording import Recording, TruthTrack, in_time_order
from posed.hal.replay import load_recording

Q90_ABOUT_UP = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))


def write_trial(folder: Path, compress: bool = False) -> Path:
    folder.mkdir()
    files = {
        "accelerometer.txt": "0.10 0.0 0.1 9.8\n0.11 0.0 0.2 9.8\n0.11 5 5 5\n0.12 nan 0.3 9.8\n",
        "gyroscope-calibrated.txt": "0.105 0.01 0.02 0.03\n0.115 0.01 0.02 0.03\n0.104 9 9 9\n",
        "gyroscope.txt": "0.105 0.11 0.22 0.33 0.1 0.2 0.3\n",
        "magnetometer.txt": "0.100000001 70 -20 300 60 -40 340\n",
        "magnetometer-calibrated.txt": "0.12 10 20 -40\n",
        "rotation-vector.txt": "0.1 0 0 0 1 0.17\n0.2 0 0 0 1 0.17\n",
        "timeAlignment.txt": "  -2.4000000e+00\n",
    }
    for name, content in files.items():
        if compress and name != "timeAlignment.txt":
            (folder / f"{name}.gz").write_bytes(gzip.compress(content.encode()))
        else:
            (folder / name).write_text(content)
    return folder


def write_capture(folder: Path, rotations: np.ndarray, positions: np.ndarray, rate: float = 60.0) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    body = {"Rotations": rotations, "Positions": positions}
    scipy_io.savemat(folder / "qualisys.mat", {"trial": {"FrameRate": rate, "RigidBodies": body}})


@pytest.mark.parametrize("compress", [False, True])
def test_trial_streams_become_android_sensors(tmp_path: Path, compress: bool) -> None:
    recording = load_recording(write_trial(tmp_path / "walk", compress))
    assert recording.name == "walk"
    assert set(recording.columns) == {
        SensorType.ACCELEROMETER,
        SensorType.GYROSCOPE,
        SensorType.MAGNETIC_FIELD,
        SensorType.ACCELEROMETER_UNCALIBRATED,
        SensorType.GYROSCOPE_UNCALIBRATED,
        SensorType.MAGNETIC_FIELD_UNCALIBRATED,
    }
    accelerometer = recording.columns[SensorType.ACCELEROMETER]
    assert accelerometer.timestamp_ns.tolist() == [100_000_000, 110_000_000, 120_000_000]
    assert math.isnan(accelerometer.values[2, 0])
    assert recording.columns[SensorType.MAGNETIC_FIELD_UNCALIBRATED].timestamp_ns.tolist() == [100_000_001]
    raw = recording.columns[SensorType.ACCELEROMETER_UNCALIBRATED].values
    assert raw[0].tolist() == [0.0, 0.1, 9.8, 0.0, 0.0, 0.0]
    assert recording.dropped_rows[SensorType.ACCELEROMETER] == 1
    assert recording.dropped_rows[SensorType.GYROSCOPE] == 1
    assert (recording.start_ns, recording.end_ns) == (100_000_000, 120_000_000)
    assert recording.truth is None
    assert recording.rotation_vector is not None
    assert recording.rotation_vector.values[1].tolist() == [0, 0, 0, 1, 0.17]
    assert math.degrees(recording.declination) == pytest.approx(1.75)


def test_a_stream_that_is_not_there_is_a_sensor_less(tmp_path: Path) -> None:
    folder = write_trial(tmp_path / "walk")
    (folder / "magnetometer-calibrated.txt").unlink()
    assert SensorType.MAGNETIC_FIELD not in load_trial(folder).columns


def test_columns_are_locked(tmp_path: Path) -> None:
    column = load_trial(write_trial(tmp_path / "walk")).columns[SensorType.GYROSCOPE]
    with pytest.raises(ValueError, match="read-only"):
        column.values[0, 0] = 1.0


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        (" \n\n", "is empty"),
        ("0.1 1 2 3\n0.2 1 2\n", r"accelerometer.txt:2: 3 columns; expected a time in seconds and 3 numbers"),
        ("0.1 1 2 3 4\n", r"accelerometer.txt:1: 5 columns"),
        ("0.1 1 2 3\n\n0.2 1 x 3\n", r"accelerometer.txt:3, column 3: 'x' is not a number"),
        ("0.1 1 2 3\nnan 1 2 3\n", r"accelerometer.txt:2, column 1: 'nan' is not a time in seconds"),
        ("1e30 1 2 3\n", r"accelerometer.txt:1, column 1: '1e30' is not a time in seconds"),
        ("0.1,1,2,3\n", r"accelerometer.txt:1: 1 columns; .* separated by blanks"),
    ],
)
def test_broken_stream_is_named_with_line_and_column(tmp_path: Path, content: str, message: str) -> None:
    folder = write_trial(tmp_path / "walk")
    (folder / "accelerometer.txt").write_text(content)
    with pytest.raises(RecordingError, match=message):
        load_trial(folder)


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(lambda raw: raw[:40], id="cut"),
        pytest.param(lambda raw: b"plain text", id="not gzip"),
        pytest.param(lambda raw: raw[:-6] + b"?" + raw[-5:], id="checksum"),
    ],
)
def test_broken_gzip_is_named(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    folder = write_trial(tmp_path / "walk", compress=True)
    path = folder / "accelerometer.txt.gz"
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(RecordingError, match=r"accelerometer.txt.gz is not a whole gzip file"):
        load_trial(folder)


def test_missing_and_wrong_paths_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "log.txt").write_text("x")
    with pytest.raises(RecordingError, match=r"nowhere is missing; name a FILE.csv or"):
        load_recording(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match=r"log.txt is a file that does not end in .csv"):
        load_recording(tmp_path / "log.txt")
    with pytest.raises(
        RecordingError, match=r"empty holds no sensor stream; expected one or more of accelerometer.txt"
    ):
        load_recording(tmp_path / "empty")
    with pytest.raises(RecordingError, match=r"no.csv cannot be read \(No such file"):
        load_recording(tmp_path / "no.csv")
    with pytest.raises(RecordingError, match="is not a folder"):
        load_trial(tmp_path / "log.txt")


def test_text_that_is_not_utf8_is_named(tmp_path: Path) -> None:
    (tmp_path / "walk.csv").write_bytes(b"sensor,\xff\xfe")
    with pytest.raises(RecordingError, match="is not UTF-8 text"):
        load_csv(tmp_path / "walk.csv")


def test_truth_is_read_column_by_column_and_put_on_the_phones_clock(tmp_path: Path) -> None:
    folder = write_trial(tmp_path / "walk")
    turned = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], float)  # device x points north: 90 deg about up
    rotations = np.column_stack([np.eye(3).ravel(order="F"), turned.ravel(order="F"), np.full(9, np.nan)])
    positions = np.array([[1000.0, 2000, np.nan], [0, 500, np.nan], [0, 0, np.nan]])
    write_capture(folder, rotations, positions)
    recording = load_trial(folder)
    truth = recording.truth
    assert truth is not None
    assert truth.timestamp_ns.tolist() == [2_400_000_000, 2_416_666_667, 2_433_333_333]
    np.testing.assert_allclose(truth.quaternion[:2], [(0, 0, 0, 1), Q90_ABOUT_UP], atol=1e-12)
    assert np.isnan(truth.quaternion[2]).all()
    np.testing.assert_allclose(truth.position_enu[:2], [(0, 0, 0), (1, 0.5, 0)])
    assert recording.truth is truth


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda folder: (folder / "qualisys.mat").write_bytes(b"no matlab" * 50),
            "qualisys.mat is not a readable MATLAB",
        ),
        (
            lambda folder: (folder / "qualisys.mat").write_bytes((folder / "qualisys.mat").read_bytes()[:300]),
            "qualisys.mat is not a readable MATLAB file",
        ),
        (
            lambda folder: (folder / "timeAlignment.txt").write_text("soon"),
            r"timeAlignment.txt: 'soon' is not a number",
        ),
        (lambda folder: (folder / "timeAlignment.txt").write_text("nan"), r"timeAlignment.txt: 'nan' is not a time"),
        (lambda folder: (folder / "timeAlignment.txt").unlink(), r"timeAlignment.txt cannot be read"),
        (
            lambda folder: write_capture(folder, np.zeros((4, 3)), np.zeros((3, 3))),
            r"rotations \(4, 3\), positions \(3, 3\), 60.0 Hz; expected one body: 9 x n",
        ),
        (lambda folder: write_capture(folder, np.zeros((9, 3)), np.zeros((3, 3)), 0.0), "0.0 Hz; expected"),
        (lambda folder: write_capture(folder, np.zeros((9, 3)), np.zeros((3, 3))), "are not all rotation matrices"),
        (lambda folder: write_capture(folder, np.full((9, 3), 1e200), np.zeros((3, 3))), "not all rotation matrices"),
    ],
)
def test_broken_truth_is_named_when_it_is_asked_for(
    tmp_path: Path, damage: Callable[[Path], object], message: str
) -> None:
    folder = write_trial(tmp_path / "walk")
    write_capture(folder, np.tile(np.eye(3).ravel(), (3, 1)).T, np.zeros((3, 3)))
    damage(folder)
    recording = load_trial(folder)
    with pytest.raises(RecordingError, match=message):
        _ = recording.truth


def test_a_capture_without_a_body_is_named(tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    folder = write_trial(tmp_path / "walk")
    scipy_io.savemat(folder / "qualisys.mat", {"trial": {"FrameRate": 60.0}})
    with pytest.raises(RecordingError, match=r"expected FrameRate, RigidBodies.Rotations"):
        _ = load_trial(folder).truth
    scipy_io.savemat(folder / "qualisys.mat", {"a": 1, "b": 2})
    with pytest.raises(RecordingError, match=r"holds 2 variables; expected the one struct"):
        _ = load_trial(folder).truth


def test_truth_without_scipy_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_trial(tmp_path / "walk")
    (folder / "qualisys.mat").write_bytes(b"")
    recording = load_trial(folder)
    real_import = builtins.__import__

    def without_scipy(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("scipy"):
            raise ImportError(name)
        return real_import(name, *args, **kwargs)

    for module in [name for name in sys.modules if name.split(".")[0] == "scipy"]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setattr(builtins, "__import__", without_scipy)
    with pytest.raises(MissingExtraError, match=r"pip install 'posed\[evaluate\]'"):
        _ = recording.truth


def track_of(angles_deg: list[float], frame_ns: int = 10) -> TruthTrack:
    half = np.radians(np.array(angles_deg)) / 2
    zero = np.zeros(len(half))
    quaternion = np.column_stack([zero + 0 * half, zero + 0 * half, np.sin(half), np.cos(half)])
    return TruthTrack(
        np.arange(len(half), dtype=np.int64) * frame_ns, quaternion, np.column_stack([half, zero + 0 * half, zero])
    )


def test_truth_is_interpolated_near_known_frames_only() -> None:
    track = track_of([0.0, 40.0, math.nan, math.nan, 100.0, math.nan, math.nan, math.nan, 20.0])

    def heading(timestamp_ns: int) -> float | None:
        truth = track.at(timestamp_ns, 0.1)
        if truth is None:
            return None
        assert truth.timestamp_ns == timestamp_ns
        assert truth.declination == 0.1
        return math.degrees(2 * math.atan2(truth.quaternion[2], truth.quaternion[3]))

    assert heading(0) == pytest.approx(0.0)
    assert heading(5) == pytest.approx(20.0)
    assert heading(25) == pytest.approx(70.0)
    assert heading(40) == pytest.approx(100.0)
    assert heading(60) is None
    assert heading(80) == pytest.approx(20.0)
    assert heading(-1) is None
    assert heading(81) is None


def test_truth_takes_the_short_way_round_and_keeps_w_positive() -> None:
    track = track_of([170.0, 190.0, 210.0])
    for timestamp_ns, expected in ((5, 180.0), (15, 200.0)):
        truth = track.at(timestamp_ns, 0.0)
        assert truth is not None
        angle = math.degrees(2 * math.atan2(truth.quaternion[2], truth.quaternion[3]))
        assert angle % 360 == pytest.approx(expected)
        assert truth.quaternion[3] >= 0
        assert math.hypot(*truth.quaternion) == pytest.approx(1.0)


def test_truth_with_attitude_but_no_position() -> None:
    track = track_of([0.0, 1.0])
    lost = TruthTrack(track.timestamp_ns, track.quaternion, np.full((2, 3), np.nan))
    truth = lost.at(4, 0.0)
    assert truth is not None
    assert truth.position_enu is None


def test_truth_with_no_known_frame() -> None:
    assert track_of([math.nan, math.nan]).at(5, 0.0) is None


def test_rows_that_do_not_advance_are_dropped_and_counted() -> None:
    times = np.array([5, 5, 7, 6, 7, 8, 2, 9], np.int64)
    column, dropped = in_time_order(times, np.arange(24.0).reshape(8, 3))
    assert column.timestamp_ns.tolist() == [5, 7, 8, 9]
    assert column.values[:, 0].tolist() == [0, 6, 15, 21]
    assert column.accuracy.tolist() == [3, 3, 3, 3]
    assert dropped == 4


def test_a_recording_without_samples_is_refused() -> None:
    column, _ = in_time_order(np.empty(0, np.int64), np.empty((0, 3)))
    with pytest.raises(RecordingError, match="recording 'void' holds no sample"):
        Recording("void", {SensorType.GYROSCOPE: column}, {})


@pytest.mark.parametrize("days", [30, 31])
def test_a_recording_of_more_than_30_days_has_a_wrong_stamp(days: int) -> None:
    end_ns = days * 86_400_000_000_000
    gyroscope, _ = in_time_order(np.array([0, 5], np.int64), np.zeros((2, 3)))
    accelerometer, _ = in_time_order(np.array([7, end_ns], np.int64), np.zeros((2, 3)))
    columns = {SensorType.GYROSCOPE: gyroscope, SensorType.ACCELEROMETER: accelerometer}
    if days == 30:
        assert Recording("long", columns, {}).end_ns == end_ns
        return
    with pytest.raises(RecordingError, match=f"recording 'long' goes from 0 ns to {end_ns} ns; .*time column .* unit"):
        Recording("long", columns, {})


def write_csv(folder: Path, content: str, sidecar: str | None = None) -> Path:
    path = folder / "walk.csv"
    path.write_text(content)
    if sidecar is not None:
        (folder / "walk.toml").write_text(sidecar)
    return path


def test_own_layout(tmp_path: Path) -> None:
    recording = load_recording(
        write_csv(
            tmp_path,
            "\ufeffsensor,timestamp_ns,x,y,z,bx,by,bz\r\n"
            "accelerometer,1592345678000000001,0,0.1,9.8\r\n"
            "gyroscope_uncalibrated,1592345678000000002,1,2,3,0.1,0.2,0.3\r\n"
            "\r\n"
            "magnetic_field_uncalibrated, 1592345678000000003, 1,2,3,,,\r\n"
            "accelerometer,1592345678000000001,7,7,7,,,\r\n"
            "accelerometer,1592345678000000009,nan,0.1,9.8,,,\r\n",
        )
    )
    accelerometer = recording.columns[SensorType.ACCELEROMETER]
    assert accelerometer.timestamp_ns.tolist() == [1592345678000000001, 1592345678000000009]
    assert accelerometer.values[0].tolist() == [0, 0.1, 9.8]
    assert math.isnan(accelerometer.values[1, 0])
    assert recording.dropped_rows[SensorType.ACCELEROMETER] == 1
    assert recording.columns[SensorType.GYROSCOPE_UNCALIBRATED].values.tolist() == [[1, 2, 3, 0.1, 0.2, 0.3]]
    assert recording.columns[SensorType.MAGNETIC_FIELD_UNCALIBRATED].values.tolist() == [[1, 2, 3, 0, 0, 0]]
    assert set(recording.columns) == {
        SensorType.ACCELEROMETER,
        SensorType.GYROSCOPE_UNCALIBRATED,
        SensorType.MAGNETIC_FIELD_UNCALIBRATED,
    }
    assert recording.name == "walk"
    assert recording.truth is None
    assert recording.rotation_vector is None


def test_own_layout_without_bias_columns(tmp_path: Path) -> None:
    path = write_csv(tmp_path, "sensor,timestamp_ns,x,y,z\ngyroscope,-5,1,2,3\ngyroscope_uncalibrated,6,1,2,3\n")
    recording = load_csv(path)
    assert recording.columns[SensorType.GYROSCOPE].timestamp_ns.tolist() == [-5]
    assert recording.columns[SensorType.GYROSCOPE_UNCALIBRATED].values.tolist() == [[1, 2, 3, 0, 0, 0]]


MAPPING = """
[time]
column = "t"
unit = "us"
[sensors.accelerometer]
columns = ["ax", "ay", "az"]
unit = "g"
[sensors.gyroscope]
columns = ["gx", "gy", "gz"]
unit = "deg/s"
[sensors.magnetic_field_uncalibrated]
columns = ["mx", "my", "mz", "bx", "by", "bz"]
unit = "Gauss"
"""
MAPPED_HEADER = "note,t,ax,ay,az,gx,gy,gz,mx,my,mz,bx,by,bz\n"


def test_mapped_layout_converts_units_and_skips_empty_cells(tmp_path: Path) -> None:
    path = write_csv(
        tmp_path,
        MAPPED_HEADER
        + "a,1000,0,0,1,180,0,0,,,,,,\n"
        + ",2000.5,,,,0,90,0,0.5,0,0,0.1,0,0\n"
        + ",3000,0,1,0,,,,0.5,0,0,,,\n",
        MAPPING,
    )
    columns = load_csv(path).columns
    assert columns[SensorType.ACCELEROMETER].timestamp_ns.tolist() == [1_000_000, 3_000_000]
    assert columns[SensorType.ACCELEROMETER].values[0].tolist() == [0, 0, 9.80665]
    assert columns[SensorType.GYROSCOPE].timestamp_ns.tolist() == [1_000_000, 2_000_500]
    np.testing.assert_allclose(columns[SensorType.GYROSCOPE].values, [[math.pi, 0, 0], [0, math.pi / 2, 0]])
    np.testing.assert_allclose(
        columns[SensorType.MAGNETIC_FIELD_UNCALIBRATED].values, [[50, 0, 0, 10, 0, 0], [50, 0, 0, 0, 0, 0]]
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "time,x,y\n1,2,3\n",
            r"walk.csv:1: header 'time,x,y'; expected sensor,timestamp_ns,x,y,z.* or walk.toml beside",
        ),
        ("sensor,timestamp_ns,x,y,z\n", "holds a header and no sample"),
        ("sensor,timestamp_ns,x,y,z\nbarometer,1,2,3,4\n", r"walk.csv:2, column sensor: 'barometer'.* accelerometer"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,1,2,3\n", r"walk.csv:2: 4 columns; expected 5: sensor, timestamp_ns"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,1,2,3,4,5\n", r"walk.csv:2: 6 columns; expected 5"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,soon,2,3,4\n", r"walk.csv:2, column timestamp_ns: 'soon' is not a time"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,inf,2,3,4\n", r"column timestamp_ns: 'inf' is not a time"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,nan,2,3,4\n", r"column timestamp_ns: 'nan' is not a time"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,1e25,2,3,4\n", r"'1e25' does not fit 64-bit nanoseconds"),
        ("sensor,timestamp_ns,x,y,z\n\ngyroscope,1,2,,4\n", r"walk.csv:3, column y: '' is not a number"),
        ("sensor,timestamp_ns,x,y,z\ngyroscope,1,2,three,4\n", r"walk.csv:2, column y: 'three' is not a number"),
        ('sensor,timestamp_ns,x,y,z\ngyroscope,1,2,3,"' + "4" * 200_000 + '"\n', "not comma-separated text"),
    ],
)
def test_broken_csv_is_named_with_line_and_column(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        load_csv(write_csv(tmp_path, content))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "us"', 'unit = "min"', r"walk.toml: \[time\] unit is 'min'; expected one of s, ms, us, ns"),
        ('unit = "us"', "", r"\[time\] unit is None"),
        ('column = "t"', 'column = "zeit"', r"\[time\] column names 'zeit'; expected a column that walk.csv has once"),
        ("[time]", "[times]", "the file has times; expected only sensors, time"),
        ('unit = "us"', 'unit = "us"\nzone = 1', r"\[time\] has zone; expected only column, unit"),
        ("sensors.gyroscope", "sensors.gyro", "sensor is 'gyro'; expected one of accelerometer"),
        ('unit = "deg/s"', 'unit = "rpm"', r"\[sensors.gyroscope\] unit is 'rpm'; expected one of rad/s, deg/s"),
        ('unit = "g"', 'unit = "Gauss"', r"\[sensors.accelerometer\] unit is 'Gauss'; expected one of m/s2, g"),
        (
            '["ax", "ay", "az"]',
            '["ax", "ay"]',
            r"\[sensors.accelerometer\] columns is .*; expected a list of 3 column names",
        ),
        ('["ax", "ay", "az"]', '["ax", "ay", "up"]', r"\[sensors.accelerometer\] columns names 'up'"),
        ("[sensors.gyroscope]", "[sensors.gyroscope", "walk.toml is not TOML"),
        ('unit = "us"', f"unit = {'1' * 5000}", "walk.toml is not TOML: an integer of thousands of digits"),
        ('unit = "us"', f"unit = {'[' * 3000}{']' * 3000}", "walk.toml is not TOML: .* nested too deep"),
    ],
)
def test_broken_mapping_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in MAPPING
    path = write_csv(tmp_path, MAPPED_HEADER + "a,1000,0,0,1,180,0,0,,,,,,\n", MAPPING.replace(old, new, 1))
    with pytest.raises(RecordingError, match=message):
        load_csv(path)


@pytest.mark.parametrize(
    ("sidecar", "message"),
    [
        ('sensors = {}\n[time]\ncolumn = "t"\nunit = "s"\n', r"no \[sensors.NAME\] table"),
        ('[time]\ncolumn = "t"\nunit = "s"\n', r"\[sensors\] is missing or not a table"),
        ('[time]\ncolumn = "t"\nunit = "s"\n[sensors]\ngyroscope = 4\n', r"\[sensors.gyroscope\] is 4"),
    ],
)
def test_mapping_without_sensors_is_named(tmp_path: Path, sidecar: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        load_csv(write_csv(tmp_path, "t,x\n1,2\n", sidecar))


def test_partly_empty_cells_of_a_mapped_sensor_are_named(tmp_path: Path) -> None:
    path = write_csv(tmp_path, MAPPED_HEADER + "a,1000,0,,1,180,0,0,,,,,,\n", MAPPING)
    with pytest.raises(RecordingError, match=r"walk.csv:2, column ay: '' is not a number"):
        load_csv(path)


def test_every_trial_loads(data_dir: Path) -> None:
    folders = sorted((data_dir / "smartphone-attitude" / "trials").iterdir())
    assert len(folders) == 14
    for folder in folders:
        recording = load_trial(folder)
        assert len(recording.columns) == 6
        assert sum(recording.dropped_rows.values()) == 0
        for kind, hz in (
            (SensorType.ACCELEROMETER, 198.6),
            (SensorType.GYROSCOPE, 198.6),
            (SensorType.MAGNETIC_FIELD, 49.65),
        ):
            column = recording.columns[kind]
            assert 1e9 / np.median(np.diff(column.timestamp_ns)) == pytest.approx(hz, rel=1e-3)


def test_truth_is_device_to_true_north(data_dir: Path) -> None:
    """The phone's own fusion, undisturbed, leans a few degrees off it and its heading is off by the declination."""
    pytest.importorskip("scipy.io")
    inclinations, headings = [], []
    for motion in ("Texting", "Phoning", "BackPocket", "FrontPocket", "Swinging"):
        recording = load_trial(data_dir / "smartphone-attitude" / "trials" / f"Guillaume_Nexus5_NoDist_{motion}")
        phone = recording.rotation_vector
        assert phone is not None
        for row in range(2000, len(phone) - 2000, 100):
            truth = recording.truth and recording.truth.at(int(phone.timestamp_ns[row]), recording.declination)
            if not truth:
                continue
            x, y, z, w = phone.values[row, :4] / np.linalg.norm(phone.values[row, :4])
            a, b, c, d = truth.quaternion
            error_z = -w * c + z * d - x * b + y * a
            error_w = w * d + x * a + y * b + z * c
            inclinations.append(2 * math.acos(min(1.0, math.hypot(error_z, error_w))))
            headings.append(2 * math.atan(error_z / error_w))
    assert len(inclinations) > 500
    assert math.degrees(np.median(inclinations)) < 3.0
    assert math.degrees(np.median(headings)) == pytest.approx(1.75, abs=1.5)
