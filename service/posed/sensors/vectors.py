"""Android's game and geomagnetic rotation vectors, each with a filter of its own (AOSP RotationVectorSensor.cpp)."""

from collections.abc import Sequence

from posed.events import EventColumn, FlatEvent, SensorType
from posed.fusion import make_filter
from posed.fusion.filter import OrientationFilter, SensorErrors

_FILTERS = {SensorType.GAME_ROTATION_VECTOR: "game", SensorType.GEOMAGNETIC_ROTATION_VECTOR: "geomag"}


class RotationVector:
    """x, y, z, w at each accelerometer event, and of the geomagnetic one the heading's accuracy, rad."""

    def __init__(self, kind: SensorType, errors: SensorErrors) -> None:
        self._errors = errors
        self._name = _FILTERS[kind]
        self._has_heading = kind is SensorType.GEOMAGNETIC_ROTATION_VECTOR
        self._filter: OrientationFilter = make_filter(self._name, errors)

    def restart(self) -> None:
        """Begin with a fresh filter: how the phone was turned meanwhile nobody saw."""
        self._filter = make_filter(self._name, self._errors)

    def take(self, events: Sequence[FlatEvent]) -> EventColumn | None:
        """Feed the filter, stopping behind every accelerometer event."""
        timestamps: list[int] = []
        rows: list[tuple[float, ...]] = []
        done = 0
        for row, (kind, timestamp_ns, *_) in enumerate(events):
            if kind != SensorType.ACCELEROMETER:
                continue
            self._filter.update_batch(events[done : row + 1])
            done = row + 1
            orientation = self._filter.orientation()
            if orientation is not None:
                timestamps.append(timestamp_ns)
                accuracy = (orientation.heading_accuracy,) if self._has_heading else ()
                rows.append((*orientation.quaternion, *accuracy))
        self._filter.update_batch(events[done:])
        return EventColumn.of_rows(timestamps, rows) if rows else None
