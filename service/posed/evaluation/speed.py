"""What a filter costs: CPU time an event, in the fastest form it has."""

from collections.abc import Callable

import numpy as np

from posed.clock import BootClock
from posed.evaluation.rates import event_arrays
from posed.evaluation.trial import INPUTS
from posed.events import EventBatch, EventColumn, Float64Array, SensorType
from posed.fusion.filter import OrientationFilter
from posed.fusion.paced import PacedFilter

_RUNS = 3
_ENOUGH_NS = 300_000_000


def cpu_ns_per_event(make: Callable[[], OrientationFilter], batch: EventBatch) -> float:
    """Return the CPU time (ns) of a fresh filter fed a whole trial, divided by the trial's events.

    The least of three runs, fewer if they are long. The divisor is the number of events for every filter. That compares
    filters of other packages (see `work`) with ours only where all sensors have one rate, as in BROAD's trials at
    native: elsewhere theirs step for more samples than there are events.
    """
    clock = BootClock()
    spent: list[int] = []
    while len(spent) < _RUNS and sum(spent) < _ENOUGH_NS:
        run = work(make, batch)
        started = clock.cpu_ns()
        run()
        spent.append(clock.cpu_ns() - started)
    return min(spent) / sum(len(batch.columns[kind]) for kind in INPUTS)


def work(make: Callable[[], OrientationFilter], batch: EventBatch) -> Callable[[], None]:
    """Return what feeds a fresh filter a whole trial once, everything that is not the filter's own work done before.

    A filter of another package is fastest over samples at one rate: it gets the newest accelerometer and magnetometer
    sample at each gyroscope sample.
    """
    each = make()
    if isinstance(each, PacedFilter):
        paced, samples = each, _at_gyroscope(batch)
        return lambda: paced.update_synchronous(*samples)
    events = event_arrays(batch)
    return lambda: each.update_batch(events)


def _at_gyroscope(batch: EventBatch) -> tuple[float, Float64Array, Float64Array, Float64Array]:
    """Return the gyroscope's period (s) and samples, and the newest of the others at each; all float64[n, 3]."""
    gyro = batch.columns[SensorType.GYROSCOPE]
    times = gyro.timestamp_ns
    period_s = float(np.median(np.diff(times))) * 1e-9 if len(times) > 1 else 1.0

    def newest(column: EventColumn) -> Float64Array:
        rows = np.maximum(np.searchsorted(column.timestamp_ns, times, side="right") - 1, 0)
        return np.ascontiguousarray(column.values[rows, :3])

    acceleration = newest(batch.columns[SensorType.ACCELEROMETER])
    field = newest(batch.columns[SensorType.MAGNETIC_FIELD])
    return period_s, np.ascontiguousarray(gyro.values[:, :3]), acceleration, field
