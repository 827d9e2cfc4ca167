"""Recordings in comma-separated text: one layout of our own, and any other by a sidecar that maps its columns.

Own layout, one sample a row, any order of sensors, the bias columns only where a sensor has them:

    sensor,timestamp_ns,x,y,z,bx,by,bz
    accelerometer,12000000,0.02,0.11,9.80
    gyroscope_uncalibrated,12500000,0.010,0.002,-0.001,0.004,0.0,0.0

`sensor` is Android's string type without `android.sensor.`: accelerometer, magnetic_field, gyroscope, or one of them
with `_uncalibrated`. Values are m/s2, uT and rad/s; the header may stop at z.

Any other FILE.csv needs FILE.toml beside it. Column names are those of the file's header; a row whose cells for a
sensor are all empty has no sample of it; six columns are three values and their bias:

    [time]
    column = "t"
    unit = "us"                      # s, ms, us or ns
    [sensors.accelerometer]
    columns = ["ax", "ay", "az"]
    unit = "g"                       # m/s2 or g; rad/s or deg/s; uT, nT, mT or Gauss
"""

import csv
import io
import math
import tomllib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from posed.errors import RecordingError
from posed.events import STANDARD_GRAVITY, EventColumn, SensorType
from posed.hal.recording import Recording, in_time_order, read_text

_T = TypeVar("_T")

_SENSORS = {
    sensor_type.name.lower(): sensor_type
    for sensor_type in (
        SensorType.ACCELEROMETER,
        SensorType.MAGNETIC_FIELD,
        SensorType.GYROSCOPE,
        SensorType.MAGNETIC_FIELD_UNCALIBRATED,
        SensorType.GYROSCOPE_UNCALIBRATED,
        SensorType.ACCELEROMETER_UNCALIBRATED,
    )
}
_UNITS: Mapping[str, Mapping[str, float]] = {
    "accelerometer": {"m/s2": 1.0, "g": STANDARD_GRAVITY},
    "magnetic_field": {"uT": 1.0, "nT": 1e-3, "mT": 1e3, "Gauss": 100.0},
    "gyroscope": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
}
_NANOSECONDS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
_OWN_HEADER = ["sensor", "timestamp_ns", "x", "y", "z", "bx", "by", "bz"]
_LATEST_NS = 2**63 - 1


def load_csv(path: Path) -> Recording:
    """Read FILE.csv, in our own layout or as FILE.toml beside it says.

    Raises RecordingError, naming file, line and column, for anything that is not as expected.
    """
    reader = csv.reader(io.StringIO(read_text(path), newline=""), skipinitialspace=True)
    lines = _numbered(path, reader)
    _, header = next(lines, (0, []))
    names = [name.strip() for name in header]
    sidecar = path.with_suffix(".toml")
    layout = _mapped_layout(path, names, sidecar) if sidecar.exists() else _own_layout(path, names)
    # Arrays, not lists: what a list of numbers leaves behind in Python's heap stays with the daemon.
    times = {sensor.type: array("q") for sensor in layout.sensors.values()}
    values = {sensor.type: array("d") for sensor in layout.sensors.values()}
    for number, row in lines:
        if not layout.fewest <= len(row) <= len(names):
            raise RecordingError(f"{path}:{number}: {len(row)} columns; expected {len(names)}: {', '.join(names)}")
        at = f"{path}:{number}"
        time_ns: int | None = None
        for sensor in layout.chosen(at, row):
            cells = [row[index].strip() if index < len(row) else "" for index in sensor.indexes]
            if not layout.one_sensor_a_row and not any(cells):
                continue
            if time_ns is None:
                time_ns = _time(at, names[layout.time], row[layout.time], layout.nanoseconds)
            times[sensor.type].append(time_ns)
            values[sensor.type].extend(_values(at, [names[index] for index in sensor.indexes], cells, sensor))
    columns: dict[SensorType, EventColumn] = {}
    dropped: dict[SensorType, int] = {}
    for sensor_type, stamps in times.items():
        if stamps:
            rows = np.array(values[sensor_type], np.float64).reshape(len(stamps), -1)
            columns[sensor_type], dropped[sensor_type] = in_time_order(np.array(stamps, np.int64), rows)
    if not columns:
        raise RecordingError(f"{path} holds a header and no sample; expected rows behind {','.join(names)}")
    return Recording(path.stem, columns, dropped)


@dataclass(frozen=True, slots=True)
class _Sensor:
    type: SensorType
    indexes: tuple[int, ...]
    scale: float

    @property
    def width(self) -> int:
        return 6 if self.type.name.endswith("_UNCALIBRATED") else 3


@dataclass(frozen=True, slots=True)
class _Layout:
    time: int
    nanoseconds: int
    sensors: Mapping[str, _Sensor]
    one_sensor_a_row: bool
    fewest: int

    def chosen(self, at: str, row: Sequence[str]) -> Sequence[_Sensor]:
        """Return the sensors that the row may have samples of."""
        if not self.one_sensor_a_row:
            return tuple(self.sensors.values())
        name = row[0].strip()
        if name not in self.sensors:
            raise RecordingError(
                f"{at}, column sensor: {name[:40]!r} is unknown; expected one of {', '.join(_SENSORS)}"
            )
        return (self.sensors[name],)


def _numbered(path: Path, reader: Any) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows that are not blank with the line each ends on."""
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise RecordingError(f"{path}:{reader.line_num}: not comma-separated text ({error})") from error


def _own_layout(path: Path, names: list[str]) -> _Layout:
    if names not in (_OWN_HEADER, _OWN_HEADER[:5]):
        raise RecordingError(
            f"{path}:1: header {','.join(names)[:120]!r}; expected {','.join(_OWN_HEADER[:5])}[,bx,by,bz], "
            f"or {path.with_suffix('.toml').name} beside it that maps the columns"
        )
    sensors = {}
    for name, sensor_type in _SENSORS.items():
        width = len(names) - 2 if name.endswith("_uncalibrated") else 3
        sensors[name] = _Sensor(sensor_type, tuple(range(2, 2 + width)), 1.0)
    return _Layout(time=1, nanoseconds=1, sensors=sensors, one_sensor_a_row=True, fewest=5)


def _mapped_layout(path: Path, names: list[str], sidecar: Path) -> _Layout:
    try:
        mapping = tomllib.loads(read_text(sidecar))
    except tomllib.TOMLDecodeError as error:
        raise RecordingError(f"{sidecar} is not TOML: {error}") from error
    _only(sidecar, "the file", mapping, {"time", "sensors"})
    time = _table(sidecar, mapping, "time")
    _only(sidecar, "[time]", time, {"column", "unit"})
    unit = _choice(sidecar, "[time] unit", time.get("unit"), _NANOSECONDS)
    sensors = {}
    for name, entry in _table(sidecar, mapping, "sensors").items():
        where = f"[sensors.{name}]"
        sensor_type = _choice(sidecar, "sensor", name, _SENSORS)
        if not isinstance(entry, dict):
            raise RecordingError(f"{sidecar}: {where} is {entry!r}; expected a table with columns and unit")
        _only(sidecar, where, entry, {"columns", "unit"})
        scale = _choice(sidecar, f"{where} unit", entry.get("unit"), _UNITS[name.removesuffix("_uncalibrated")])
        columns = entry.get("columns")
        widths = (3, 6) if name.endswith("_uncalibrated") else (3,)
        if not isinstance(columns, list) or len(columns) not in widths:
            expected = " or ".join(str(width) for width in widths)
            raise RecordingError(
                f"{sidecar}: {where} columns is {columns!r}; expected a list of {expected} column names"
            )
        indexes = tuple(_index(path, sidecar, names, f"{where} columns", column) for column in columns)
        sensors[name] = _Sensor(sensor_type, indexes, scale)
    if not sensors:
        raise RecordingError(f"{sidecar}: no [sensors.NAME] table; expected one of {', '.join(_SENSORS)}")
    time_index = _index(path, sidecar, names, "[time] column", time.get("column"))
    return _Layout(time_index, unit, sensors, one_sensor_a_row=False, fewest=len(names))


def _only(sidecar: Path, where: str, table: Mapping[str, Any], allowed: set[str]) -> None:
    unknown = sorted(set(table) - allowed)
    if unknown:
        raise RecordingError(f"{sidecar}: {where} has {', '.join(unknown)}; expected only {', '.join(sorted(allowed))}")


def _table(sidecar: Path, mapping: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = mapping.get(name)
    if not isinstance(table, dict):
        raise RecordingError(f"{sidecar}: [{name}] is missing or not a table; see the documented mapping")
    return table


def _choice(sidecar: Path, what: str, found: object, allowed: Mapping[str, _T]) -> _T:
    if not isinstance(found, str) or found not in allowed:
        raise RecordingError(f"{sidecar}: {what} is {found!r}; expected one of {', '.join(allowed)}")
    return allowed[found]


def _index(path: Path, sidecar: Path, names: list[str], what: str, column: object) -> int:
    if not isinstance(column, str) or names.count(column) != 1:
        raise RecordingError(
            f"{sidecar}: {what} names {column!r}; expected a column that {path.name} has once: {', '.join(names)}"
        )
    return names.index(column)


def _time(at: str, name: str, cell: str, nanoseconds: int) -> int:
    try:
        # Whole numbers stay exact: a float holds an epoch in nanoseconds only to a quarter of a microsecond.
        time_ns = int(cell) * nanoseconds
    except ValueError:
        try:
            time_ns = round(float(cell) * nanoseconds)
        except (ValueError, OverflowError):
            raise RecordingError(f"{at}, column {name}: {cell[:40]!r} is not a time; expected a number") from None
    if abs(time_ns) > _LATEST_NS:
        raise RecordingError(f"{at}, column {name}: {cell[:40]!r} does not fit 64-bit nanoseconds; check the time unit")
    return time_ns


def _values(at: str, names: list[str], cells: list[str], sensor: _Sensor) -> list[float]:
    if not any(cells[3:]):
        cells = cells[:3]
    values = []
    for name, cell in zip(names, cells, strict=False):
        try:
            values.append(float(cell) * sensor.scale)
        except ValueError:
            raise RecordingError(f"{at}, column {name}: {cell[:40]!r} is not a number") from None
    return values + [0.0] * (sensor.width - len(values))
