"""A built wheel holds all that runs, and nothing else."""

import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from posed.fusion.kernel import kernel

_ROOT = Path(__file__).parents[2]


def build_wheel(out: Path, **environment: str) -> Path:
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(_ROOT)],
        env={**os.environ, **environment},
        check=True,
        capture_output=True,
    )
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel as this machine builds it: compiled where it has a C compiler."""
    return build_wheel(tmp_path_factory.mktemp("wheel"))


def test_the_wheel_holds_every_module_and_data_file_of_the_three_roots(wheel: Path) -> None:
    tracked = subprocess.run(
        ["git", "ls-files", "service", "client", "proto/posed"], cwd=_ROOT, check=True, capture_output=True, text=True
    ).stdout.split()
    made: set[str] = set()
    # Where the filters of this installation are compiled, those of the wheel must be.
    if kernel() == "compiled" or not wheel.name.endswith("-py3-none-any.whl"):
        suffix = sysconfig.get_config_var("EXT_SUFFIX")
        made = {name.removesuffix(".pxd") + suffix for name in tracked if name.endswith(".pxd")}
        assert made
        made.add(f"service/posed/fusion/kernel{suffix}.json")
    expected = {name.split("/", 1)[1] for name in (*tracked, *made)}
    held = {name for name in zipfile.ZipFile(wheel).namelist() if not name.startswith("posed-")}
    assert held == expected


@pytest.mark.parametrize("environment", [{"CC": "/nonexistent"}, {"POSED_PURE": "1"}], ids=["no compiler", "pure"])
def test_a_wheel_without_compiled_filters_runs_them_interpreted(environment: dict[str, str], tmp_path: Path) -> None:
    built = build_wheel(tmp_path / "wheel", **environment)
    assert built.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(built) as archive:
        archive.extractall(tmp_path / "installed")
    path = os.pathsep.join(
        [str(tmp_path / "installed"), sysconfig.get_paths()["purelib"], sysconfig.get_paths()["platlib"]]
    )
    done = subprocess.run(
        [sys.executable, "-S", "-m", "posed.cli", "--version"],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout.endswith(", filters interpreted\n")


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
