"""A built wheel holds all that runs, and nothing else."""

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(_ROOT)],
        check=True,
        capture_output=True,
    )
    (built,) = out.glob("*.whl")
    return built


def test_the_wheel_holds_every_module_and_data_file_of_the_three_roots(wheel: Path) -> None:
    tracked = subprocess.run(
        ["git", "ls-files", "service", "client", "proto/posed"], cwd=_ROOT, check=True, capture_output=True, text=True
    ).stdout.split()
    expected = {name.split("/", 1)[1] for name in tracked}
    held = {name for name in zipfile.ZipFile(wheel).namelist() if not name.startswith("posed-")}
    assert held == expected


def test_an_installed_wheel_shows_live_poses(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    # Without site no .pth file is read: the editable install beside it stays out of sight.
    path = os.pathsep.join([str(tmp_path), sysconfig.get_paths()["purelib"], sysconfig.get_paths()["platlib"]])
    where = subprocess.run(
        [sys.executable, "-S", "-c", "import posed.cli; print(posed.cli.__file__, list(posed.__path__))"],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    assert str(_ROOT) not in where
    done = subprocess.run(
        [sys.executable, "-S", "-m", "posed.cli", "demo", "--seconds", "1"],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert "azimuth" in done.stdout
    script = (
        "from posed.hal.profile import load_profile, profile_names\n"
        "print(*[load_profile(name).name for name in profile_names()])"
    )
    profiles = subprocess.run(
        [sys.executable, "-S", "-c", script],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.split()
    assert profiles == ["cdd-minimum", "modern", "patonis2018"]
