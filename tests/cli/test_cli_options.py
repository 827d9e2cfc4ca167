"""How option values are read, and handed on to a daemon."""

import argparse
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from posed.cli import events, options
from posed.cli.pose_text import status_words
from posed.client import PoseStatus
from posed.fusion import FILTERS, PACKAGED


def _parse(*words: str) -> dict[str, object]:
    parser = argparse.ArgumentParser(exit_on_error=False)
    options.add_daemon_options(parser)
    return options.given_daemon_options(parser.parse_args(words))


def test_an_option_not_given_leaves_nothing_behind() -> None:
    assert _parse() == {}
    assert _parse("--loop", "--seed=3") == {"loop": True, "seed": 3}


def test_the_filters_of_the_help_and_of_the_readme_are_those_there_are() -> None:
    there_are = sorted({*FILTERS, *PACKAGED})
    assert sorted(options.FILTER_NAMES.split(", ")) == there_are
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    told = readme.partition("**Filters** for `--filter`:")[2].partition("\n\n")[0]
    assert [name for name in there_are if f"`{name}`" not in told] == []


def test_the_readme_explains_every_status() -> None:
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    names = [name.replace("_", " ") for status in PoseStatus for name in status_words(status)]
    assert len(names) == 9
    assert [name for name in names if f"\n| {name} | " not in readme] == []


def test_paths_become_absolute(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "/home/ada")
    assert _parse("--source", "replay:walk.csv") == {"source": f"replay:{tmp_path}/walk.csv"}
    assert _parse("--source", "replay:~/walk.csv") == {"source": "replay:/home/ada/walk.csv"}
    assert _parse("--profile", "my.toml") == {"profile": f"{tmp_path}/my.toml"}
    assert _parse("--profile", "modern", "--source", "sim:walk") == {"profile": "modern", "source": "sim:walk"}


@given(st.floats(-90, 90), st.floats(-180, 180), st.floats(-500, 9000), st.integers(0, 9), st.floats(0.1, 50))
def test_the_command_line_for_a_daemon_says_the_same(
    latitude: float, longitude: float, height: float, seed: int, speed: float
) -> None:
    given_options = _parse(
        f"--position={latitude!r},{longitude!r},{height!r}", f"--seed={seed}", f"--speed={speed!r}", "--loop"
    )
    assert given_options["position"] == (latitude, longitude, height)
    assert _parse(*options.daemon_command_line(given_options)) == given_options


@pytest.mark.parametrize("text", ["1,2", "1,2,3,4", "91,0,0", "0,181,0", "0,0,inf", "a,b,c", ""])
def test_a_position_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentError, match="is no position"):
        _parse(f"--position={text}")


@pytest.mark.parametrize(
    ("text", "period_us"),
    [
        ("NORMAL", 200_000),
        ("ui", 66_667),
        ("GAME", 20_000),
        ("Fastest", 0),
        ("50", 20_000),
        ("12.5hz", 80_000),
        ("5000us", 5000),
    ],
)
def test_a_rate_is_a_mode_a_frequency_or_a_period(text: str, period_us: int) -> None:
    parser = argparse.ArgumentParser()
    events.add_arguments(parser)
    assert parser.parse_args(["gyroscope", "--rate", text]).rate == period_us


@pytest.mark.parametrize("text", ["0", "-1", "1001", "3us", "soon", "nan", "us", "1e400"])
def test_a_rate_that_is_none_is_refused(text: str) -> None:
    parser = argparse.ArgumentParser(exit_on_error=False)
    events.add_arguments(parser)
    with pytest.raises(argparse.ArgumentError, match="is no rate"):
        parser.parse_args(["gyroscope", f"--rate={text}"])
