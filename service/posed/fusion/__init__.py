"""Orientation filters: one protocol, and a table from which one is chosen by name."""

from posed.fusion.filter import OrientationFilter, SensorNoise
from posed.fusion.table import FILTERS, PACKAGED, make_filter

__all__ = ["FILTERS", "PACKAGED", "OrientationFilter", "SensorNoise", "make_filter"]
