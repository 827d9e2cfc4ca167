"""FifoLengthVerification: a batch holds what the sensor's FIFO is said to hold."""

from itertools import pairwise

from posed.verify.finding import Finding, judged
from posed.verify.recording import Recording

NAME = "FifoLength"
_SHARE = 0.8
_SAME_BATCH = 0.5


def verify_fifo_length(recording: Recording) -> Finding:
    """Judge the longest batch: 80 % of fifoMaxEventCount at least; events less than half a latency apart are one batch.

    The latency that counts is that of the FIFO, which is handed over when it is full.
    """
    fifo_us = recording.sensor.fifo_max_event_count * recording.expected_us
    apart_ns = _SAME_BATCH * 1000 * min(recording.max_report_latency_us, fifo_us)
    longest = run = min(1, len(recording.received))
    for before, after in pairwise(recording.received):
        run = run + 1 if after.received_ns - before.received_ns < apart_ns else 1
        longest = max(longest, run)
    least = _SHARE * recording.sensor.fifo_max_event_count
    return judged(NAME, recording.subject, f"{longest} events", f"at least {least:.0f}", longest >= least)
