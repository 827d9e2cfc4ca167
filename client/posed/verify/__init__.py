"""Android's conformance checks (CTS, VTS) over any source of events with the SDK's interface.

Each verification is a pure function of recorded events; the suite records them. Thresholds and names are CTS's
(cts/tests/sensor, android.hardware.cts.helpers.sensorverification) unless a docstring says otherwise.
"""
