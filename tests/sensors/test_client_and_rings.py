"""Who may have what, what is remembered, and posed's own decimation."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posed.events import EventColumn, SensorInfo, SensorType
from posed.sensors import Client
from posed.sensors.client import HIGH_SAMPLING_RATE_SENSORS
from posed.sensors.decimation import Decimator
from posed.sensors.recent_events import RecentEventLogger
from posed.sensors.registration_log import RegistrationLog, RegistrationRecord

MakeBench = Callable[..., Any]
GYRO = SensorType.GYROSCOPE
_INFO = SensorInfo(
    handle=4,
    type=GYRO,
    name="g",
    vendor="v",
    version=1,
    max_range=10.035,
    resolution=0.02,
    power_ma=0.0,
    min_delay_us=2_500,
    max_delay_us=200_000,
)


def _column(times: list[int], values: list[list[float]] | None = None) -> EventColumn:
    rows = np.zeros((len(times), 3)) if values is None else np.array(values)
    return EventColumn(np.array(times, np.int64), rows, np.full(len(times), 3, np.int8))


@pytest.mark.parametrize(
    ("client", "kind", "capped"),
    [
        (Client(target_sdk=31), GYRO, True),
        (Client(target_sdk=35), SensorType.MAGNETIC_FIELD_UNCALIBRATED, True),
        (Client(target_sdk=35, permissions=frozenset((HIGH_SAMPLING_RATE_SENSORS,))), GYRO, False),
        (Client(target_sdk=30), GYRO, False),
        (Client(target_sdk=35), SensorType.GRAVITY, False),
        (Client(), GYRO, False),
    ],
)
def test_high_rates_need_the_permission_from_api_31_on(client: Client, kind: SensorType, capped: bool) -> None:
    sensor = replace(_INFO, type=kind)
    assert client.is_rate_capped(sensor) is capped
    assert client.sees(sensor).min_delay_us == (5_000 if capped else 2_500)


def test_a_capped_client_is_sampled_at_200_hz_without_an_error(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    bench.service._table[GYRO].info = replace(bench.service._table[GYRO].info, min_delay_us=2_500)
    bench.service.enable(bench.service.connect(Client("app", target_sdk=35)), GYRO, 0, 0)
    assert bench.source.calls[0] == ("batch", GYRO, 5_000_000, 0)
    bench.service.enable(bench.service.connect(Client("app", target_sdk=30)), GYRO, 0, 0)
    assert bench.source.calls[-1] == ("batch", GYRO, 2_500_000, 0)


def test_a_client_that_asks_for_it_gets_no_more_than_its_period_and_the_others_all(make_bench: MakeBench) -> None:
    bench = make_bench((GYRO,))
    thinned, fast, plain = (bench.service.connect() for _ in range(3))
    bench.service.enable(fast, GYRO, 5_000, 0)
    bench.service.enable(thinned, GYRO, 50_000, 0, decimate=True)
    bench.service.enable(plain, GYRO, 50_000, 0)
    bench.advance_ms(1000)
    counts = [len(each.take(1000).columns[GYRO]) for each in (thinned, fast, plain)]
    assert counts == [20, 200, 200]


@given(st.lists(st.integers(-400_000, 400_000), min_size=50, max_size=200), st.sampled_from([10, 20, 25, 50, 100]))
def test_decimation_keeps_the_rate_asked_under_jitter(jitter: list[int], period_ms: int) -> None:
    times = [k * 5_000_000 + j for k, j in enumerate(jitter, 1)]
    decimator = Decimator(period_ms * 1_000_000)
    kept = [
        t for cut in range(0, len(times), 7) for t in decimator(_column(times[cut : cut + 7]), 5_000_000).timestamp_ns
    ]
    expected = (times[-1] - times[0]) / (period_ms * 1e6) + 1
    assert abs(len(kept) - expected) <= 1.5
    assert set(kept) <= set(times)


def test_decimation_goes_on_after_a_gap_without_a_burst() -> None:
    decimator = Decimator(100_000_000)
    before = decimator(_column(list(range(0, 200_000_000, 5_000_000))), 5_000_000)
    after = decimator(_column(list(range(10_000_000_000, 10_200_000_000, 5_000_000))), 5_000_000)
    assert (len(before), len(after)) == (2, 2)


@pytest.mark.parametrize(("kind", "kept"), [(SensorType.ACCELEROMETER, 50), (SensorType.PROXIMITY, 30), (GYRO, 10)])
def test_the_ring_of_recent_events_has_androids_size(kind: SensorType, kept: int) -> None:
    ring = RecentEventLogger(kind)
    for first in range(0, 210, 7):
        ring.add(_column(list(range(first, first + 7))), first * 10)
    events = list(ring.events())
    assert [timestamp for timestamp, _, _ in events] == list(range(210 - kept, 210))
    assert events[-1][1] == 2030


def test_the_last_event_is_current_until_a_new_activation() -> None:
    ring = RecentEventLogger(SensorType.LIGHT)
    assert ring.last_if_current is None
    ring.add(_column([1, 2]), 0)
    last = ring.last_if_current
    assert last is not None
    assert last.timestamp_ns.tolist() == [2]
    ring.set_last_event_stale()
    assert ring.last_if_current is None


def test_500_registrations_are_remembered_the_newest_first() -> None:
    log = RegistrationLog()
    for number in range(510):
        log.add(RegistrationRecord(number, True, 4, Client()))
    records = log.newest_first()
    assert [records[0].boot_ns, records[-1].boot_ns, len(records)] == [509, 10, 500]
