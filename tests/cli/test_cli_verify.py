"""What `posed verify` takes from a device profile."""

import dataclasses

import pytest
from cli_shell import Shell

from posed.cli.verify import _rate_table
from posed.client import Sensor

_OF_NONE = dict.fromkeys((each.name for each in dataclasses.fields(Sensor)), 0)


@pytest.mark.parametrize(
    ("kind", "rates_hz"),
    [
        (Sensor.TYPE_GYROSCOPE, (5, 15, 50, 200)),
        (Sensor.TYPE_GYROSCOPE_UNCALIBRATED, (5, 15, 50, 200)),
        (Sensor.TYPE_PRESSURE, (1, 5, 15)),
        (Sensor.TYPE_GAME_ROTATION_VECTOR, (15, 50, 100)),
    ],
)
def test_each_sensor_is_bound_by_the_rates_of_its_own_part(kind: int, rates_hz: tuple[float, ...]) -> None:
    sensor = Sensor(**{**_OF_NONE, "handle": kind, "type": kind})  # type: ignore[arg-type]
    assert _rate_table("patonis2018")(sensor) == rates_hz


def test_no_rates_bind_where_the_profile_is_not_known(capsys: pytest.CaptureFixture[str]) -> None:
    sensor = Sensor(**{**_OF_NONE, "handle": 6})  # type: ignore[arg-type]
    assert _rate_table("no-such-phone")(sensor) == ()
    assert "give one with --profile" in capsys.readouterr().err


def test_off_a_terminal_stderr_tells_how_far_it_is_and_no_refusal_that_was_wanted(shell: Shell) -> None:
    shell.run("start")
    verified = shell.run("verify", "--sensors=significant_motion,light", "--rates=50", "--seconds=0.5")
    assert "OneShot" in verified.stdout
    told = verified.stderr.splitlines()
    assert all(line.startswith("posed: verifying ") for line in told), told
    assert told[0] == "posed: verifying sensor list"
    assert told[-2:] == ["posed: verifying calls of significant_motion", "posed: verifying calls of light"]
    assert len(set(told)) == len(told)
