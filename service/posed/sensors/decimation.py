"""Posed's own extension: a client that gets no more of a sensor than it asked for. Android has no such thing."""

from posed.events import EventColumn


class Decimator:
    """Thins one sensor's events for one client to the period it asked for, without changing those that remain."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._due_ns: int | None = None

    def __call__(self, column: EventColumn, sample_period_ns: int) -> EventColumn:
        """Return the events nearest to a grid of the client's period, given the period at which they come."""
        early_ns = sample_period_ns // 2
        due_ns = self._due_ns
        rows = []
        for row, timestamp_ns in enumerate(column.timestamp_ns.tolist()):
            if due_ns is None or timestamp_ns >= due_ns - early_ns:
                rows.append(row)
                behind = due_ns is None or timestamp_ns - due_ns >= self._period_ns
                due_ns = (timestamp_ns if behind or due_ns is None else due_ns) + self._period_ns
        self._due_ns = due_ns
        return EventColumn(column.timestamp_ns[rows], column.values[rows], column.accuracy[rows])
