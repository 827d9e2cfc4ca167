"""EventOrderingVerification: sample times rise."""

from posed.verify.finding import Finding, judged
from posed.verify.recording import Recording

NAME = "EventOrdering"


def verify_ordering(recording: Recording) -> Finding:
    """Judge that each timestamp is above every one received before it."""
    newest = None
    wrong = 0
    for each in recording.received:
        if each.event.sensor != recording.sensor:
            continue
        if newest is not None and each.event.timestamp <= newest:
            wrong += 1
        newest = max(each.event.timestamp, newest or each.event.timestamp)
    return judged(NAME, recording.subject, f"{wrong} out of order", "0", wrong == 0)
