"""EventBasicVerification: enough events arrive, and none of another sensor."""

from posed.verify.finding import Finding, judged
from posed.verify.recording import Recording

NAME = "EventBasic"
_SHARE = 0.8
_START_NS = 1_000_000_000
_LATENCY_NS = 1_000_000_000


def verify_delivery(recording: Recording) -> Finding:
    """Judge that 80 % of (duration - 1 s to start - 1 s - report latency) / period arrived, all of the one sensor."""
    taken_ns = recording.ended_ns - recording.begun_ns
    full_ns = taken_ns - _START_NS - _LATENCY_NS - recording.max_report_latency_us * 1000
    least = int(_SHARE * max(0, full_ns) / (recording.expected_us * 1000))
    foreign = sum(each.event.sensor != recording.sensor for each in recording.received)
    own = len(recording.received) - foreign
    return judged(
        NAME,
        recording.subject,
        f"{own} events, {foreign} of other sensors",
        f"at least {max(1, least)}, 0",
        own >= max(1, least) and foreign == 0,
    )
