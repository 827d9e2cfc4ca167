"""States as values that JSON can hold, and back, with every value looked at."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, cast

from posed.errors import InvalidArgumentError
from posed.events import SensorType
from posed.fusion.event_arrays import MAX_HELD, HeldEvents

_T = TypeVar("_T")

_MAX_INTEGER = 2**62
"""Compiled states hold 64 bits, and subtract times in them."""
_HELD_TYPES = (int(SensorType.ACCELEROMETER), int(SensorType.MAGNETIC_FIELD))


def plain(value: Any) -> Any:
    """Return a state (a dataclass of scalars, held events and further such dataclasses) as dicts, lists and numbers."""
    if isinstance(value, HeldEvents):
        return [list(event) for event in value.events()]
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    return value


def filled(kind: type[_T], saved: Any, path: str) -> _T:
    """Return the state of this kind that `plain` gave; raises InvalidArgumentError, naming the path, for any else."""
    blank: Any = kind()
    wanted = {each.name for each in fields(blank)}
    if not isinstance(saved, Mapping):
        raise _misfit(path, saved)
    for name in sorted(wanted ^ saved.keys()):
        raise _misfit(f"{path}.{name}", "missing" if name in wanted else "unknown")
    for name in sorted(wanted):
        default = getattr(blank, name)
        value = saved[name]
        if is_dataclass(default):
            value = filled(cast(type, type(default)), value, f"{path}.{name}")
        elif isinstance(default, HeldEvents):
            value = _held(value, f"{path}.{name}")
        elif not _fits(value, default):
            raise _misfit(f"{path}.{name}", value)
        setattr(blank, name, value)
    return cast(_T, blank)


def _held(saved: Any, path: str) -> HeldEvents:
    blank = (0, 0, 0.0, 0.0, 0.0)
    if not isinstance(saved, list) or len(saved) >= MAX_HELD:
        # A filter never ends an update with as many: the next event would find no room.
        raise _misfit(path, saved)
    held = HeldEvents()
    for event in saved:
        if not isinstance(event, list) or len(event) != len(blank) or not all(map(_fits, event, blank)):
            raise _misfit(path, event)
        sensor_type, timestamp_ns, x, y, z = event
        if sensor_type not in _HELD_TYPES:
            raise _misfit(path, event)
        held.add(sensor_type, timestamp_ns, x, y, z)
    return held


def _fits(value: Any, default: Any) -> bool:
    if type(value) is not type(default):
        return False
    if isinstance(value, float):
        return math.isfinite(value)
    return not isinstance(value, int) or abs(value) < _MAX_INTEGER


def _misfit(path: str, value: Any) -> InvalidArgumentError:
    return InvalidArgumentError(
        f"the saved {path} is {value!r:.100}, which is no state of this filter; start it afresh"
    )
