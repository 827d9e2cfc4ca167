"""EventTimestampSynchronizationVerification and TimestampClockSourceVerification: timestamps are on the boot clock."""

from posed.verify.finding import Finding, judged
from posed.verify.recording import Recording

SYNCHRONIZATION = "EventTimestampSynchronization"
CLOCK_SOURCE = "TimestampClockSource"
_SLACK_NS = 500_000_000
_PERIODS = 2.5
_PERIOD_SHARE = 0.9


def verify_synchronization(recording: Recording) -> Finding:
    """Judge each event's age: 0 to 500 ms + L, L = min(latency, FIFO) + 2.5 periods of expected / 0.9."""
    limit_ns = _SLACK_NS + latency_ns(recording)
    ages = _ages(recording)
    wrong = [age for age in ages if not 0 <= age <= limit_ns]
    worst = max(wrong or ages or [0], key=abs)
    return judged(
        SYNCHRONIZATION,
        recording.subject,
        f"{len(wrong)} wrong, {'worst' if wrong else 'oldest'} {worst / 1e6:.1f} ms",
        f"0, ages 0 to {limit_ns / 1e6:.0f} ms",
        not wrong,
    )


def verify_clock_source(recording: Recording) -> Finding:
    """Judge that the clock is the boot clock: some event's age lies within L, which another clock never meets."""
    limit_ns = latency_ns(recording)
    ages = _ages(recording)
    right = sum(0 <= age <= limit_ns for age in ages)
    return judged(
        CLOCK_SOURCE,
        recording.subject,
        f"{right} of {len(ages)} within",
        f"1 with an age of 0 to {limit_ns / 1e6:.0f} ms",
        right > 0,
    )


def latency_ns(recording: Recording) -> int:
    """Return how old an event may be by what was asked, ns."""
    period_us = recording.expected_us / _PERIOD_SHARE
    fifo_us = recording.sensor.fifo_max_event_count * period_us
    return round(1000 * (min(recording.max_report_latency_us, fifo_us) + _PERIODS * period_us))


def _ages(recording: Recording) -> list[int]:
    return [each.received_ns - each.event.timestamp for each in recording.received]
