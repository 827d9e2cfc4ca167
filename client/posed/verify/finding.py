"""What a verification found."""

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """PASS or FAIL; SKIP where the criterion cannot be applied, and the note says why."""

    PASS = "pass"
    FAIL = "FAIL"
    SKIP = "skip"


@dataclass(frozen=True, slots=True)
class Finding:
    """One verification of one subject, such as `gyroscope 50 Hz streaming`, for people to read."""

    verification: str
    subject: str
    measured: str
    threshold: str
    verdict: Verdict
    note: str = ""


def judged(verification: str, subject: str, measured: str, threshold: str, passes: bool, note: str = "") -> Finding:
    """Return a finding that passes or fails."""
    return Finding(verification, subject, measured, threshold, Verdict.PASS if passes else Verdict.FAIL, note)


def skipped(verification: str, subject: str, note: str) -> Finding:
    """Return a finding of what could not be judged."""
    return Finding(verification, subject, "-", "-", Verdict.SKIP, note)
