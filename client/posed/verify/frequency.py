"""FrequencyVerification: events come at the rate that was asked."""

from posed.verify.finding import Finding, judged, skipped
from posed.verify.recording import Recording, is_fused

NAME = "Frequency"
_LOWER, _UPPER = 0.90, 2.20
# A part that has few rates answers with one of them: as near to it as Android wants a rate outside the range.
_UPPER_OF_PROFILE = 1.10
# Fused sensors follow the accelerometer, of which they never ask less (SensorFusion::setDelay).
_FUSED_HZ = 20.0


def verify_frequency(recording: Recording) -> Finding:
    """Judge f = (n - 1) / (last - first): 0.90 of the rate asked < f < 2.20 of it, both within the sensor's range.

    A fused sensor may run at 2.20 times the 20 Hz that are asked of the accelerometer for it, whatever was asked of it.
    Where the sensor's slowest rate that is not slower than the request lies above 2.20 of it, that rate's own 1.10 is
    the upper bound, and the note says so. CTS skips a sensor that another client overloads.
    """
    if recording.overloaded:
        return skipped(NAME, recording.subject, "another client asks this sensor for more")
    if len(recording.timestamps) < 2:
        return judged(NAME, recording.subject, f"{len(recording.timestamps)} events", "2 events or more", False)
    span_ns = recording.timestamps[-1] - recording.timestamps[0]
    found = (len(recording.timestamps) - 1) * 1e9 / span_ns if span_ns else float("inf")
    lower = _LOWER * 1e6 / recording.shortest_expected_us
    upper = _UPPER * 1e6 / recording.expected_us
    note = ""
    if is_fused(recording.sensor):
        upper = max(upper, _UPPER * _FUSED_HZ)
    own = _rate_of_profile(recording)
    if own is not None and own > upper / _UPPER_OF_PROFILE:
        upper = own * _UPPER_OF_PROFILE
        note = f"bound by the profile: its slowest rate that serves is {own:g} Hz"
    return judged(
        NAME, recording.subject, f"{found:.2f} Hz", f"{lower:.2f} to {upper:.2f} Hz", lower < found < upper, note
    )


def _rate_of_profile(recording: Recording) -> float | None:
    """Return the slowest rate that is not slower than the period asked, else the fastest; None if unknown."""
    if not recording.rates_hz:
        return None
    asked = 1e6 / recording.expected_us
    if is_fused(recording.sensor):
        asked = max(asked, _FUSED_HZ)
    # Delays are whole microseconds: 15 Hz is asked back as 66667 us.
    serving = [rate for rate in recording.rates_hz if rate >= asked * (1 - 1e-4)]
    return min(serving) if serving else max(recording.rates_hz)
