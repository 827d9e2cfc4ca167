"""The worked examples of Android's rate and latency arbitration."""

import pytest

from posed.events import SensorInfo, SensorType
from posed.sensors.arbitration import BatchParams, arbitrate, clamp_period_ns

_MS = 1_000_000
_ACCELEROMETER = SensorInfo(
    handle=1,
    type=SensorType.ACCELEROMETER,
    name="a",
    vendor="v",
    version=1,
    max_range=20.0,
    resolution=0.01,
    power_ma=0.1,
    min_delay_us=5_000,
    max_delay_us=200_000,
)


def _hal_gets(*clients: tuple[int, int]) -> tuple[int, int]:
    """What the HAL is given for clients of (period us, latency us), in ms."""
    params = arbitrate(
        BatchParams(clamp_period_ns(period_us, _ACCELEROMETER), latency_us * 1000) for period_us, latency_us in clients
    )
    assert params is not None
    assert params.max_report_latency_ns is not None
    return params.sampling_period_ns // _MS, params.max_report_latency_ns // _MS


def test_one_streaming_client_gets_what_it_asks() -> None:
    assert _hal_gets((200_000, 0)) == (200, 0)


def test_the_faster_of_two_streaming_clients_wins() -> None:
    assert _hal_gets((200_000, 0), (20_000, 0)) == (20, 0)


def test_one_batching_client_gets_its_latency() -> None:
    assert _hal_gets((20_000, 1_000_000)) == (20, 1000)


def test_a_slow_streaming_client_does_not_force_latency_zero() -> None:
    assert _hal_gets((20_000, 1_000_000), (200_000, 0)) == (20, 200)


def test_a_latency_no_longer_than_the_period_is_streaming() -> None:
    assert _hal_gets((20_000, 1_000_000), (20_000, 0)) == (20, 0)


def test_without_a_client_there_is_nothing_to_set() -> None:
    assert arbitrate([]) is None


def test_a_request_for_a_rate_only_leaves_the_latency_to_the_others() -> None:
    rate_only = BatchParams(5 * _MS, None)
    assert arbitrate([rate_only]) == BatchParams(5 * _MS, None)
    assert arbitrate([rate_only, BatchParams(20 * _MS, 1000 * _MS)]) == BatchParams(5 * _MS, 1000 * _MS)


@pytest.mark.parametrize(
    ("asked_us", "clamped_ms"), [(0, 5), (4_999, 5), (5_000, 5), (20_000, 20), (200_000, 200), (1_000_000, 200)]
)
def test_a_period_is_clamped_to_what_the_sensor_can(asked_us: int, clamped_ms: int) -> None:
    assert clamp_period_ns(asked_us, _ACCELEROMETER) == clamped_ms * _MS
