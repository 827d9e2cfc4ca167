"""A recorded stream at a lower rate, as the chip itself would have given it.

Both forms stand on one grid, `anchor + k / rate`, and depend only on column, rate and anchor.
"""

import numpy as np
import numpy.typing as npt

from posed.events import EventColumn, Float64Array

LONGEST_HOLD_NS = 500_000_000
"""A sample stands for the time since the one before it, unless that is longer than this: then data were lost.

Filters integrate a rate over the same span and start afresh behind a longer one.
"""


def thin_by_mean(column: EventColumn, rate_hz: float, anchor_ns: int) -> EventColumn:
    """Return interval means at the grid instants that end an interval `(t_k - 1/rate, t_k]` with a sample in it.

    Each sample stands for the time since the one before it, and the mean is weighted by that time, so that the sum of
    `mean * (t_k - t_{k-1})` is the integral of the recorded rate: plain means of three or four samples in turn would
    not conserve it. An interval without samples yields no event; the next event stands for it too. Samples with NaN or
    infinity are left out. An unfinished interval at the end is dropped.

    column: values float64[n, w]; no sample before `anchor_ns`.
    """
    sound = np.isfinite(column.values).all(axis=1)
    column = EventColumn(column.timestamp_ns[sound], column.values[sound], column.accuracy[sound])
    if len(column) < 2:
        return column
    times = column.timestamp_ns - anchor_ns
    hold = np.diff(times, prepend=times[0]).astype(np.float64)
    alone = hold > LONGEST_HOLD_NS
    alone[0] = True
    hold[alone] = np.median(hold[1:])

    first, last = (int(times[end] * (rate_hz / 1e9)) for end in (0, -1))
    grid = _instants(np.arange(first - 1, last + 2), rate_hz)
    grid = grid[grid <= times[-1]]
    seen = np.searchsorted(times, grid, side="right")
    filled = np.diff(seen, prepend=0) > 0
    grid, seen = grid[filled], seen[filled]

    knots = np.concatenate([times, times[alone] - hold[alone]])
    order = np.argsort(knots, kind="stable")
    covered = np.cumsum(hold)
    spans = _since_last(grid, knots, covered, covered[alone] - hold[alone], order)
    means = np.empty((len(grid), column.values.shape[1]))
    for axis in range(column.values.shape[1]):
        share = column.values[:, axis] * hold
        integral = np.cumsum(share)
        means[:, axis] = _since_last(grid, knots, integral, integral[alone] - share[alone], order) / spans
    return EventColumn(grid + anchor_ns, means, column.accuracy[seen - 1])


def mean_between(column: EventColumn, since_ns: int, until_ns: int) -> Float64Array | None:
    """Return the mean over `(since_ns, until_ns]` as `thin_by_mean` weights it, float64[w], None across a loss of data.

    column: values float64[n, w].
    """
    first = max(1, int(np.searchsorted(column.timestamp_ns, since_ns, side="right")))
    last = int(np.searchsorted(column.timestamp_ns, until_ns, side="left")) + 1
    knots = column.timestamp_ns[first - 1 : last]
    values = column.values[first:last]
    if len(knots) < 2 or np.diff(knots).max() > LONGEST_HOLD_NS or not np.isfinite(values).all():
        return None
    share = np.diff(np.clip(knots, since_ns, until_ns)).astype(np.float64)
    mean: Float64Array = share @ values / share.sum()
    return mean


def thin_by_nearest(column: EventColumn, rate_hz: float, anchor_ns: int) -> EventColumn:
    """Return, for each grid instant, the sample nearest to it, at the sample's own time.

    A sample more than half a period from an instant is nearest to another one, so none is repeated and an instant in a
    loss yields nothing.
    """
    times = column.timestamp_ns - anchor_ns
    instant = np.rint(times * (rate_hz / 1e9)).astype(np.int64)
    distance = np.abs(times - _instants(instant, rate_hz))
    order = np.lexsort((distance, instant))
    is_nearest = np.diff(instant[order], prepend=instant[:1] - 1) > 0
    rows = order[is_nearest]
    return EventColumn(column.timestamp_ns[rows], column.values[rows], column.accuracy[rows])


def _instants(index: npt.NDArray[np.int64], rate_hz: float) -> npt.NDArray[np.int64]:
    instants: npt.NDArray[np.int64] = np.rint(index * (1e9 / rate_hz)).astype(np.int64)
    return instants


def _since_last(
    grid: npt.NDArray[np.int64],
    knots: npt.NDArray[np.int64] | Float64Array,
    at_samples: Float64Array,
    at_losses: Float64Array,
    order: npt.NDArray[np.intp],
) -> Float64Array:
    """Return the growth of a running integral, linear between its knots, from each grid instant to the next."""
    integral = np.interp(grid, knots[order], np.concatenate([at_samples, at_losses])[order])
    return np.diff(integral, prepend=0.0)
