"""Orientation filters: one protocol, and a table from which one is chosen by name."""

from posed.fusion import kernel

kernel.prepare()

from posed.fusion.filter import OrientationFilter, SensorErrors  # noqa: E402
from posed.fusion.table import DEFAULT_FILTER, FILTERS, PACKAGED, make_filter  # noqa: E402

__all__ = ["DEFAULT_FILTER", "FILTERS", "PACKAGED", "OrientationFilter", "SensorErrors", "make_filter"]
