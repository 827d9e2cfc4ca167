"""`posed verify` against a real daemon, with a short matrix."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

# Of a machine that is busy with other things, how late events are says nothing about the daemon.
_OF_LATENESS = {"EventTimestampSynchronization", "TimestampClockSource"}


@pytest.mark.parametrize(
    ("profile", "sensors"),
    [("patonis2018", "gyroscope,rotation_vector"), ("modern", "gyroscope"), ("cdd-minimum", "gyroscope")],
)
def test_the_daemon_is_what_android_asks_for(desk: Any, tmp_path: Path, profile: str, sensors: str) -> None:
    desk.serve("--source", "sim:still", "--profile", profile)
    report = tmp_path / "verify.xml"
    ended = desk.posed(
        "verify", "--sensors", sensors, "--rates", "10", "--seconds", "4", "--still",
        "--junit", str(report),
    )  # fmt: skip
    cases = ElementTree.parse(report).getroot().findall("testsuite/testcase")
    failed = [(case.get("classname"), case.get("name")) for case in cases if case.find("failure") is not None]
    assert [each for each in failed if each[0] not in _OF_LATENESS] == []
    assert ended.returncode == bool(failed), ended.stderr
    skipped = [case.get("classname") for case in cases if case.find("skipped") is not None]
    # A phone at rest has not turned, and a FIFO that takes minutes to fill is not tried.
    assert sorted(filter(None, skipped)) == [*(["FifoLength"] if profile == "modern" else []), "GyroscopeIntegration"]
    passed = len(cases) - len(failed) - len(skipped)
    assert f"{passed} passed, {len(failed)} failed, {len(skipped)} skipped" in ended.stdout
    assert {"Frequency", "EventOrdering", "StandardDeviation", "Flush", "Churn", "MovingRates"} <= {
        case.get("classname") for case in cases
    }


def test_what_is_no_sensor_or_no_rate_is_refused(desk: Any) -> None:
    assert desk.posed("verify").returncode == 69
    assert desk.posed("verify", "--rates", "2000").returncode == 2
    desk.serve("--source", "sim:still")
    refused = desk.posed("verify", "--sensors", "barometer")
    assert refused.returncode == 1
    assert "there is no sensor 'barometer'; there are accelerometer" in refused.stderr
