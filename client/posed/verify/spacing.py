"""EventGapVerification and JitterVerification: how evenly events are spaced."""

import math

from posed.verify.finding import Finding, Verdict, judged, skipped
from posed.verify.recording import Recording

GAP = "EventGap"
JITTER = "Jitter"
_GAP = 1.8
_ALLOWED_SHARE, _ALLOWED_MOST = 0.02, 20
_TAIL = 0.025
_HIFI_JITTER = 0.02


def verify_gaps(recording: Recording) -> Finding:
    """Judge gaps above 1.8 expected periods, the first event left out: at most ceil(min(20, 2 % of the events))."""
    limit_ns = _GAP * recording.expected_us * 1000
    gaps = [spacing for spacing in recording.spacings[1:] if spacing > limit_ns]
    allowed = math.ceil(min(_ALLOWED_MOST, _ALLOWED_SHARE * len(recording.timestamps)))
    longest = max(recording.spacings[1:], default=0) / 1e6
    return judged(
        GAP,
        recording.subject,
        f"{len(gaps)} gaps, longest {longest:.1f} ms",
        f"at most {allowed} above {limit_ns / 1e6:.1f} ms",
        len(gaps) <= allowed,
    )


def verify_jitter(recording: Recording) -> Finding:
    """Judge the middle 95 % of spacings: at most 2 x 2 % of the period wide on a Hi-Fi device, unlimited on others."""
    spacings = sorted(recording.spacings)
    if len(spacings) < 2:
        return skipped(JITTER, recording.subject, "too few events")
    width = spacings[math.ceil((1 - _TAIL) * len(spacings)) - 1] - spacings[int(_TAIL * len(spacings))]
    share = width / (sum(spacings) / len(spacings) or 1)
    measured = f"{100 * share:.2f} % of the period"
    if not recording.hifi:
        return Finding(JITTER, recording.subject, measured, "unlimited without Hi-Fi", Verdict.PASS)
    return judged(JITTER, recording.subject, measured, f"{200 * _HIFI_JITTER:.0f} %", share <= 2 * _HIFI_JITTER)
