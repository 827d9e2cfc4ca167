"""Thinning by interval mean and by nearest sample."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posed.events import EventColumn
from posed.hal.thinning import thin_by_mean, thin_by_nearest

MS = 1_000_000


def column_of(times_ns: list[int] | np.ndarray, seed: int = 1) -> EventColumn:
    times = np.array(times_ns, np.int64)
    values = np.random.default_rng(seed).normal(size=(len(times), 3))
    return EventColumn(times, values, np.full(len(times), 3, np.int8))


steps_ns = st.lists(st.integers(1 * MS, 400 * MS), min_size=2, max_size=60)


def running_integral(column: EventColumn) -> np.ndarray:
    """What a filter forms up to each event: every value over the time since the event before."""
    shares = column.values[1:] * np.diff(column.timestamp_ns)[:, None] / 1e9
    return np.vstack([np.zeros(3), np.cumsum(shares, axis=0)])


@given(steps=steps_ns, rate_hz=st.sampled_from([2.5, 5.0, 15.0, 50.0]), offset=st.integers(0, 300 * MS))
def test_mean_conserves_the_integral_whatever_the_spacing(steps: list[int], rate_hz: float, offset: int) -> None:
    anchor = -(10**15)
    column = column_of(anchor + offset + np.cumsum(steps))
    thinned = thin_by_mean(column, rate_hz, anchor)
    if len(thinned) < 2:
        return
    assert thinned.timestamp_ns[0] >= column.timestamp_ns[0]
    recorded, times = running_integral(column), column.timestamp_ns - anchor
    for axis in range(3):
        at = np.interp(thinned.timestamp_ns - anchor, times, recorded[:, axis])
        np.testing.assert_allclose(running_integral(thinned)[:, axis], at - at[0], rtol=0, atol=1e-9)


def test_mean_of_evenly_spaced_samples_is_the_plain_mean() -> None:
    column = column_of(np.arange(0, 1001) * 5 * MS)
    thinned = thin_by_mean(column, 50.0, 0)
    assert thinned.timestamp_ns.tolist() == (np.arange(251) * 20 * MS).tolist()
    np.testing.assert_allclose(thinned.values[1:], column.values[1:].reshape(250, 4, 3).mean(axis=1), atol=1e-12)
    np.testing.assert_allclose(thinned.values[0], column.values[0], atol=1e-12)


def test_mean_has_no_event_without_samples_and_none_for_an_unfinished_interval() -> None:
    column = column_of([0, 10 * MS, 55 * MS, 67 * MS])
    assert thin_by_mean(column, 50.0, 0).timestamp_ns.tolist() == [0, 20 * MS, 60 * MS]


def test_mean_does_not_look_across_a_loss() -> None:
    times = np.concatenate([np.arange(0, 105, 10), np.arange(20_003, 20_200, 10)]) * MS
    values = np.where(np.arange(len(times)) < 11, 1.0, 9.0)[:, None] * np.ones(3)
    thinned = thin_by_mean(EventColumn(times, values, np.full(len(times), 3, np.int8)), 5.0, 0)
    assert thinned.timestamp_ns.tolist() == [0, 200 * MS, 20_200 * MS][: len(thinned)]
    np.testing.assert_allclose(thinned.values[:2], 1.0, atol=1e-12)


def test_mean_leaves_out_samples_that_are_not_finite() -> None:
    times = np.arange(0, 41) * 5 * MS
    values = np.ones((41, 3))
    values[6, 1] = np.nan
    values[9, 0] = np.inf
    thinned = thin_by_mean(EventColumn(times, values, np.full(41, 3, np.int8)), 50.0, 0)
    assert len(thinned) == 11
    np.testing.assert_allclose(thinned.values, 1.0, atol=1e-12)


@pytest.mark.parametrize("thin", [thin_by_mean, thin_by_nearest])
def test_one_sample_stays(thin: type) -> None:
    column = column_of([7 * MS])
    assert thin(column, 5.0, 0).timestamp_ns.tolist() == [7 * MS]


@settings(max_examples=50)
@given(steps=steps_ns, rate_hz=st.sampled_from([5.0, 15.0, 50.0]))
def test_nearest_is_the_nearest_real_sample_of_each_instant(steps: list[int], rate_hz: float) -> None:
    anchor = 123_456_789
    column = column_of(anchor + np.cumsum(steps))
    thinned = thin_by_nearest(column, rate_hz, anchor)
    times = column.timestamp_ns - anchor
    expected = []
    for k in range(int(times[-1] * rate_hz / 1e9) + 2):
        instant = round(k * 1e9 / rate_hz)
        row = int(np.argmin(np.abs(times - instant)))
        if round(float(times[row]) * (rate_hz / 1e9)) == k:
            expected.append(row)
    assert thinned.timestamp_ns.tolist() == column.timestamp_ns[expected].tolist()
    np.testing.assert_array_equal(thinned.values, column.values[expected])


def test_a_grid_of_15_hz_does_not_drift_in_an_hour() -> None:
    column = column_of(np.arange(0, 3600 * 50 + 1) * 20 * MS)
    thinned = thin_by_mean(column, 15.0, 0)
    assert thinned.timestamp_ns[-1] == 3600 * 10**9
    assert len(thinned) == 3600 * 15 + 1
