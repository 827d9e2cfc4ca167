"""Who decides a sensor's rate: the fastest registration, as Android's SensorDevice (SensorDevice.h, BatchParams)."""

from collections.abc import Iterable
from dataclasses import dataclass

from posed.events import SensorInfo

MINIMUM_PERIOD_NS = 1_000_000
"""No sensor runs faster than 1 kHz (SensorDevice.cpp, MINIMUM_EVENTS_PERIOD)."""


@dataclass(frozen=True, slots=True)
class BatchParams:
    """What one registration asks, or what all of them come to; ns.

    A max_report_latency_ns of None asks for a rate only and leaves the latency to the others.
    """

    sampling_period_ns: int
    max_report_latency_ns: int | None


def clamp_period_ns(sampling_period_us: int, sensor: SensorInfo) -> int:
    """Return the period asked (us) as ns, within what the sensor and the 1 kHz floor allow (SensorService::enable)."""
    period_us = sampling_period_us
    if sensor.max_delay_us > 0:
        period_us = min(period_us, sensor.max_delay_us)
    return max(period_us * 1000, sensor.min_delay_us * 1000, MINIMUM_PERIOD_NS)


def arbitrate(requests: Iterable[BatchParams]) -> BatchParams | None:
    """Return the period and latency that serve every request, None without any; a latency of 0 is streaming.

    The merge rule is SensorDevice.cpp's: Tsample = min(Tsample_i), Tbatch = min(max(Tbatch_i, Tsample_i)), and
    Tbatch <= Tsample means streaming.
    """
    requests = list(requests)
    if not requests:
        return None
    period = min(request.sampling_period_ns for request in requests)
    latencies = [
        max(request.max_report_latency_ns, request.sampling_period_ns)
        for request in requests
        if request.max_report_latency_ns is not None
    ]
    if not latencies:
        return BatchParams(period, None)
    latency = min(latencies)
    return BatchParams(period, latency if latency > period else 0)
