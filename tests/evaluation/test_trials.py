"""Recordings with truth of every kind, found, read and refused."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from made_trials import (
    ANDROID_OFF,
    DECLINATION,
    quaternion,
    sensed,
    write_attitude_set,
    write_broad_trial,
    write_csv_trial,
    write_groups,
)

from posed.errors import MissingExtraError, RecordingError
from posed.evaluation.attitude_trials import CalibrationChoice
from posed.evaluation.measures import total_error
from posed.evaluation.trials import find_trials, load_trial
from posed.events import SensorType


def test_a_trial_of_broad(tmp_path: Path) -> None:
    trial = load_trial(write_broad_trial(tmp_path / "01_undisturbed_slow_rotation_A.mat"))
    assert (trial.dataset, trial.name) == ("broad", "01_undisturbed_slow_rotation_A")
    t = np.arange(1200) / 100
    for kind, wanted in zip(
        (SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD), sensed(t, 0.01), strict=True
    ):
        assert trial.recording.columns[kind].values == pytest.approx(wanted)
    stamps = trial.recording.columns[SensorType.GYROSCOPE].timestamp_ns
    assert stamps.tolist() == [k * 10_000_000 for k in range(1200)]
    truth = trial.truth_at(stamps)
    # Only movement counts.
    assert np.isnan(truth[:401]).all()
    assert total_error(truth[401:], quaternion(t[401:])) == pytest.approx(0.0, abs=1e-9)


def test_groups_of_broad_are_listed_or_told_by_the_name(tmp_path: Path) -> None:
    path = write_broad_trial(tmp_path / "08_undisturbed_fast_rotation_with_breaks_A.mat")
    named = {"all_trials", "undisturbed", "fast", "rotation", "with_breaks"}
    assert set(load_trial(path).groups) == named
    other = write_broad_trial(tmp_path / "32_disturbed_attached_magnet_1cm.mat")
    assert load_trial(other).groups == ("all_trials", "disturbed", "attached_magnet")
    assert "no_breaks" in load_trial(write_broad_trial(tmp_path / "21_undisturbed_fast_combined.mat")).groups
    write_groups(tmp_path, **{path.stem: ["all_trials", "mine"]})
    assert load_trial(path).groups == ("all_trials", "mine")
    assert load_trial(other).groups == ("all_trials", "disturbed", "attached_magnet")
    (tmp_path / "trials.json").write_text("{")
    with pytest.raises(RecordingError, match=r"trials\.json is not as expected"):
        load_trial(path)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"imu_mag": None}, r"lacks imu_mag"),
        ({"imu_gyr": np.zeros((1200, 2))}, r"imu_gyr has shape \(1200, 2\); expected n x 3"),
        ({"imu_acc": np.zeros((7, 3))}, r"lengths .*imu_acc 7"),
        ({"sampling_rate": 0.0}, r"sampling_rate is 0"),
        ({"movement": np.zeros(1200)}, r"no truth at any instant that counts"),
        ({"opt_quat": "text"}, r"opt_quat holds no numbers"),
    ],
)
def test_a_broken_trial_of_broad_is_refused(tmp_path: Path, changed: dict[str, object], said: str) -> None:
    with pytest.raises(RecordingError, match=said):
        load_trial(write_broad_trial(tmp_path / "x.mat", **changed))


def test_a_truncated_matlab_file_is_refused(tmp_path: Path) -> None:
    path = write_broad_trial(tmp_path / "x.mat")
    path.write_bytes(path.read_bytes()[:20_000])
    with pytest.raises(RecordingError, match=r"x\.mat is not a readable MATLAB file"):
        load_trial(path)


def test_scipy_is_asked_for_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_broad_trial(tmp_path / "x.mat")
    monkeypatch.setitem(__import__("sys").modules, "scipy.io", None)
    with pytest.raises(MissingExtraError, match=r"posed\[evaluate\]"):
        load_trial(path)


@pytest.mark.parametrize("compress", [True, False])
def test_a_phone_calibrated_of_its_own_recordings(tmp_path: Path, compress: bool) -> None:
    root = write_attitude_set(tmp_path / "set", ["A_NoDist_AR"], compress=compress, excluded="2-3 5.5-6")
    trial = load_trial(root / "trials" / "A_NoDist_AR")
    assert (trial.dataset, trial.groups) == ("smartphone-attitude", ("all_trials", "undisturbed", "ar"))
    t = np.arange(1200) / 100
    _, gyr, mag = sensed(t, 0.01)
    assert trial.recording.columns[SensorType.GYROSCOPE].values == pytest.approx(gyr, abs=2e-4)
    assert trial.recording.columns[SensorType.MAGNETIC_FIELD].values == pytest.approx(mag, abs=1e-3)
    assert trial.recording.declination == pytest.approx(DECLINATION)
    stamps = trial.recording.columns[SensorType.GYROSCOPE].timestamp_ns
    truth = trial.truth_at(stamps)
    # Motion capture began a second before: its seconds 2 to 3 are 1 to 2 here.
    lost = np.isnan(truth[:, 0])
    assert lost[102:199].all()
    assert lost[455:495].all()
    assert not lost[:98].any()
    assert not lost[510:].any()
    assert np.degrees(total_error(truth[~lost], quaternion(t[~lost]))).max() < 0.05


@pytest.mark.parametrize("span", ["3-2", "2-2", "nan-3", "2-inf", "2", "a-b"])
def test_an_excluded_span_that_is_none_is_named(tmp_path: Path, span: str) -> None:
    root = write_attitude_set(tmp_path / "set", ["A_NoDist_AR"], excluded=f"1-1.5 {span}")
    with pytest.raises(RecordingError, match=f"trials.csv excludes '{span}' from A_NoDist_AR; expected .* FROM before"):
        load_trial(root / "trials" / "A_NoDist_AR")


def test_a_list_of_trials_that_is_no_csv_is_named(tmp_path: Path) -> None:
    root = write_attitude_set(tmp_path / "set", ["A_NoDist_AR"])
    (root / "trials.csv").write_text("trial,motion\nB," + "4" * 200_000 + "\n")
    with pytest.raises(RecordingError, match=r"trials\.csv is not comma-separated text"):
        load_trial(root / "trials" / "A_NoDist_AR")


def test_a_phone_with_androids_calibration(tmp_path: Path) -> None:
    root = write_attitude_set(tmp_path / "set", ["A_Dist_AR"])
    shutil.rmtree(root / "calibration")
    folder = root / "trials" / "A_Dist_AR"
    trial = load_trial(folder, CalibrationChoice.ANDROID)
    _, gyr, _ = sensed(np.arange(1200) / 100, 0.01)
    assert trial.recording.columns[SensorType.GYROSCOPE].values == pytest.approx(gyr + ANDROID_OFF)
    assert trial.groups[1] == "disturbed"
    with pytest.raises(RecordingError, match=r"no calibration d1 for A_Dist_AR .* use Android's"):
        load_trial(folder)


def test_a_phones_trial_without_its_list(tmp_path: Path) -> None:
    root = write_attitude_set(tmp_path / "set", ["A_Dist_Texting"], excluded="2-3")
    (root / "trials.csv").unlink()
    trial = load_trial(root / "trials" / "A_Dist_Texting")
    assert trial.groups == ("all_trials", "disturbed", "texting")
    assert trial.counted.all()


def test_a_csv_with_truth(tmp_path: Path) -> None:
    trial = load_trial(write_csv_trial(tmp_path / "walk.csv"))
    assert (trial.dataset, trial.name, trial.groups) == ("csv", "walk", ("all_trials", tmp_path.name))
    t = np.array([1.5, 2.5, 2.51, 11.0])
    truth = trial.truth_at(((t + 5.0) * 1e9).astype(np.int64))
    assert np.isnan(truth[0]).all()
    assert total_error(truth[1:], quaternion(t[1:])) == pytest.approx(0.0, abs=1e-4)


def test_a_csv_of_ones_own_layout(tmp_path: Path) -> None:
    names = ["t", *(f"{kind}{axis}" for kind in "agm" for axis in "xyz"), "q0", "q1", "q2", "q3"]
    t = np.arange(100) / 100
    rows = np.hstack([t[:, None], *sensed(t, 0.01), quaternion(t, -0.1)])
    text = "\n".join([",".join(names), *(",".join(map(repr, row)) for row in rows.tolist())])
    (tmp_path / "mine.csv").write_text(text)
    (tmp_path / "mine.toml").write_text(
        """
        time = {column = "t", unit = "s"}
        truth = {columns = ["q0", "q1", "q2", "q3"], declination_deg = DECLINATION}
        [sensors]
        accelerometer = {columns = ["ax", "ay", "az"], unit = "m/s2"}
        gyroscope = {columns = ["gx", "gy", "gz"], unit = "rad/s"}
        magnetic_field = {columns = ["mx", "my", "mz"], unit = "uT"}
        """.replace("DECLINATION", repr(math.degrees(0.1)))
    )
    assert find_trials([tmp_path]) == [tmp_path / "mine.csv"]
    trial = load_trial(tmp_path / "mine.csv")
    truth = trial.truth_at(trial.recording.columns[SensorType.GYROSCOPE].timestamp_ns)
    assert total_error(truth, quaternion(t)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("truth,99000000000,0,0,0,2", "no unit quaternion"),
        ("truth,99000000000,0,0,1", "column w: '' is not a number"),
        ("accelerometer,99000000000,0,0", "4 columns"),
    ],
)
def test_a_csv_that_is_wrong_is_refused(tmp_path: Path, line: str, said: str) -> None:
    path = write_csv_trial(tmp_path / "walk.csv")
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(RecordingError, match=said):
        load_trial(path)


def test_a_csv_without_truth_is_no_trial(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_text("sensor,timestamp_ns,x,y,z\naccelerometer,1,0,0,9.8\n")
    with pytest.raises(RecordingError, match="holds no truth"):
        load_trial(path)
    with pytest.raises(RecordingError, match="holds no trial"):
        find_trials([tmp_path])
    path.write_text("sensor,timestamp_ns,x,y,z,w\naccelerometer,1,0,0,9.8\ntruth,1,0,0,0,1\n")
    with pytest.raises(RecordingError, match="holds no magnetic_field sample"):
        load_trial(path)


@pytest.mark.parametrize("header", ['"sensor","timestamp_ns","x","y","z","w"', "\n , \n\nsensor, timestamp_ns,x,y,z,w"])
def test_a_csv_is_found_by_the_header_it_is_read_by(tmp_path: Path, header: str) -> None:
    path = write_csv_trial(tmp_path / "walk.csv")
    path.write_text(path.read_text().replace("sensor,timestamp_ns,x,y,z,w", header, 1))
    assert find_trials([tmp_path]) == [path]
    assert load_trial(path).name == "walk"


def test_trials_are_found_at_any_depth_and_once(tmp_path: Path) -> None:
    root = write_attitude_set(tmp_path / "b" / "set", ["A_NoDist_AR", "B_Dist_AR"])
    (tmp_path / "a").mkdir()
    first = write_broad_trial(tmp_path / "a" / "x.mat")
    last = write_csv_trial(tmp_path / "c.csv")
    (tmp_path / "notes.txt").write_text("no trial")
    (tmp_path / "steps.csv").write_text("a,b\n1,2\n")
    (tmp_path / "empty.csv").write_text("")
    wanted = [first, root / "trials" / "A_NoDist_AR", root / "trials" / "B_Dist_AR", last, tmp_path / "empty.csv"]
    assert find_trials([tmp_path]) == wanted
    assert find_trials([last, tmp_path, first]) == [last, *(path for path in wanted if path != last)]
    for path, said in ((tmp_path / "none", "is missing"), (tmp_path / "notes.txt", "is no trial")):
        with pytest.raises(RecordingError, match=said):
            find_trials([path])
    with pytest.raises(RecordingError, match="empty"):
        load_trial(tmp_path / "empty.csv")
