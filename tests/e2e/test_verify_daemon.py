"""`posed verify` against a real daemon, with a short matrix."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

# Of a machine that is busy with other things, how late events are says nothing about the daemon.
_OF_LATENESS = {"EventTimestampSynchronization", "TimestampClockSource"}


@pytest.mark.parametrize("profile", ["patonis2018", "modern", "cdd-minimum"])
def test_the_daemon_is_what_android_asks_for(desk: Any, tmp_path: Path, profile: str) -> None:
    desk.serve("--source", "sim:still", "--profile", profile)
    report = tmp_path / "verify.xml"
    ended = desk.posed(
        "verify", "--sensors", "gyroscope,rotation_vector", "--rates", "10", "--seconds", "4", "--still",
        "--junit", str(report),
    )  # fmt: skip
    cases = ElementTree.parse(report).getroot().findall("testsuite/testcase")
    failed = [(case.get("classname"), case.get("name")) for case in cases if case.find("failure") is not None]
    assert [each for each in failed if each[0] not in _OF_LATENESS] == []
    assert ended.returncode == bool(failed), ended.stderr
    # A FIFO that takes minutes to fill is not tried.
    skipped = sum(case.find("skipped") is not None for case in cases)
    assert skipped == (2 if profile == "modern" else 0)
    passed = len(cases) - len(failed) - skipped
    assert f"{passed} passed, {len(failed)} failed, {skipped} skipped" in ended.stdout
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
