"""Recordings in comma-separated text: one layout of our own, and any other by a sidecar that maps its columns.

Own layout, one sample a row, any order of sensors, the bias columns only where a sensor has them:

    sensor,timestamp_ns,x,y,z,bx,by,bz
    accelerometer,12000000,0.02,0.11,9.80
    gyroscope_uncalibrated,12500000,0.010,0.002,-0.001,0.004,0.0,0.0

`sensor` is Android's string type without `android.sensor.`: accelerometer, magnetic_field, gyroscope, or one of them
with `_uncalibrated`. Values are m/s2, uT and rad/s; the header may stop at z.

Where the phone really pointed may be told too, by rows `truth,TIMESTAMP_NS,x,y,z,w` under a header that has `w` behind
z: a quaternion, device to world (east, magnetic north, up).

Any other FILE.csv needs FILE.toml beside it. Column names are those of the file's header; a row whose cells for a
sensor are all empty has no sample of it; six columns are three values and their bias:

    [time]
    column = "t"
    unit = "us"                      # s, ms, us or ns
    [sensors.accelerometer]
    columns = ["ax", "ay", "az"]
    unit = "g"                       # m/s2 or g; rad/s or deg/s; uT, nT, mT or Gauss
    [truth]                          # if the file has it
    columns = ["qx", "qy", "qz", "qw"]
    declination_deg = 1.75           # east positive, if north is the true one there (default: 0, the magnetic one)
"""

import csv
import io
import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from posed.errors import RecordingError
from posed.events import STANDARD_GRAVITY, EventColumn, SensorType
from posed.hal.recording import Recording, TruthTrack, in_time_order, read_text
from posed.hal.toml_table import parse_toml

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
_OWN_HEADER = ["sensor", "timestamp_ns", "x", "y", "z"]
_BIAS = ["bx", "by", "bz"]
_TRUTH = "truth"
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
    times = {name: array("q") for name in layout.sensors}
    values = {name: array("d") for name in layout.sensors}
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
            times[sensor.name].append(time_ns)
            values[sensor.name].extend(_values(at, [names[index] for index in sensor.indexes], cells, sensor))
    columns: dict[SensorType, EventColumn] = {}
    dropped: dict[SensorType, int] = {}
    truth: TruthTrack | None = None
    for name, stamps in times.items():
        if not stamps:
            continue
        rows = np.array(values[name], np.float64).reshape(len(stamps), -1)
        column, late = in_time_order(np.array(stamps, np.int64), rows)
        if name == _TRUTH:
            truth = _truth(path, column)
        else:
            columns[_SENSORS[name]], dropped[_SENSORS[name]] = column, late
    if not columns:
        raise RecordingError(f"{path} holds a header and no sample; expected rows behind {','.join(names)}")
    return Recording(
        path.stem, columns, dropped, layout.declination, load_truth=(lambda: truth) if truth is not None else None
    )


def has_truth(path: Path) -> bool:
    """Return whether FILE.csv says, by its header or sidecar, that it has truth; False for a layout that is neither.

    Raises RecordingError if that cannot be read.
    """
    sidecar = path.with_suffix(".toml")
    if sidecar.exists():
        return _TRUTH in _mapping(sidecar)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            _, header = next(_numbered(path, csv.reader(file, skipinitialspace=True)), (0, []))
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path} cannot be read as text ({error})") from error
    if not header:
        raise RecordingError(f"{path} is empty; expected a header")
    names = [name.strip() for name in header]
    return names[: len(_OWN_HEADER)] == _OWN_HEADER and "w" in names


@dataclass(frozen=True, slots=True)
class _Sensor:
    name: str
    indexes: tuple[int, ...]
    scale: float

    @property
    def width(self) -> int:
        if self.name == _TRUTH:
            return 4
        return 6 if self.name.endswith("_uncalibrated") else 3


@dataclass(frozen=True, slots=True)
class _Layout:
    time: int
    nanoseconds: int
    sensors: Mapping[str, _Sensor]
    one_sensor_a_row: bool
    fewest: int
    declination: float = 0.0

    def chosen(self, at: str, row: Sequence[str]) -> Sequence[_Sensor]:
        """Return the sensors that the row may have samples of."""
        if not self.one_sensor_a_row:
            return tuple(self.sensors.values())
        name = row[0].strip()
        if name not in self.sensors:
            raise RecordingError(
                f"{at}, column sensor: {name[:40]!r} is unknown; expected one of {', '.join(self.sensors)}"
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
    with_truth = names[5:6] == ["w"]
    if names[:5] != _OWN_HEADER or names[5 + with_truth :] not in ([], _BIAS):
        raise RecordingError(
            f"{path}:1: header {','.join(names)[:120]!r}; expected {','.join(_OWN_HEADER)}[,w][,{','.join(_BIAS)}], "
            f"or {path.with_suffix('.toml').name} beside it that maps the columns"
        )
    bias = tuple(range(5 + with_truth, len(names)))
    sensors = {
        name: _Sensor(name, (2, 3, 4, *bias) if name.endswith("_uncalibrated") else (2, 3, 4), 1.0) for name in _SENSORS
    }
    if with_truth:
        sensors[_TRUTH] = _Sensor(_TRUTH, (2, 3, 4, 5), 1.0)
    return _Layout(time=1, nanoseconds=1, sensors=sensors, one_sensor_a_row=True, fewest=5)


def _mapped_layout(path: Path, names: list[str], sidecar: Path) -> _Layout:
    mapping = _mapping(sidecar)
    _only(sidecar, "the file", mapping, {"time", "sensors", _TRUTH})
    time = _table(sidecar, mapping, "time")
    _only(sidecar, "[time]", time, {"column", "unit"})
    unit = _choice(sidecar, "[time] unit", time.get("unit"), _NANOSECONDS)
    sensors = {}
    for name, entry in _table(sidecar, mapping, "sensors").items():
        where = f"[sensors.{name}]"
        _choice(sidecar, "sensor", name, _SENSORS)
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
        sensors[name] = _Sensor(name, indexes, scale)
    if not sensors:
        raise RecordingError(f"{sidecar}: no [sensors.NAME] table; expected one of {', '.join(_SENSORS)}")
    time_index = _index(path, sidecar, names, "[time] column", time.get("column"))
    declination = 0.0
    if _TRUTH in mapping:
        truth = _table(sidecar, mapping, _TRUTH)
        _only(sidecar, "[truth]", truth, {"columns", "declination_deg"})
        columns = truth.get("columns")
        if not isinstance(columns, list) or len(columns) != 4:
            raise RecordingError(f"{sidecar}: [truth] columns is {columns!r}; expected four names, of x, y, z and w")
        indexes = tuple(_index(path, sidecar, names, "[truth] columns", column) for column in columns)
        sensors[_TRUTH] = _Sensor(_TRUTH, indexes, 1.0)
        degrees = truth.get("declination_deg", 0.0)
        if not isinstance(degrees, int | float) or not abs(degrees) <= 180.0:
            raise RecordingError(f"{sidecar}: [truth] declination_deg is {degrees!r}; expected -180 to 180")
        declination = math.radians(degrees)
    return _Layout(time_index, unit, sensors, False, len(names), declination)


def _mapping(sidecar: Path) -> Mapping[str, Any]:
    try:
        return parse_toml(read_text(sidecar))
    except ValueError as error:
        raise RecordingError(f"{sidecar} is not TOML: {error}") from error


def _truth(path: Path, column: EventColumn) -> TruthTrack:
    """Return rows (x, y, z, w) as truth of unit length; NaN stays, as what is not known."""
    norm = np.linalg.norm(column.values, axis=1, keepdims=True)
    wrong = np.flatnonzero(np.abs(norm - 1.0) > 0.01)
    if len(wrong):
        row = wrong[0]
        raise RecordingError(
            f"{path}: the truth at {column.timestamp_ns[row]} ns is {column.values[row].tolist()}, which is no unit"
            " quaternion; expected x, y, z, w"
        )
    sign = np.where(column.values[:, 3:] < 0.0, -1.0, 1.0)
    return TruthTrack(column.timestamp_ns, sign * column.values / norm, np.full((len(column), 3), np.nan))


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
    if sensor.width == 6 and not any(cells[3:]):
        cells = cells[:3]
    values = []
    for name, cell in zip(names, cells, strict=False):
        try:
            values.append(float(cell) * sensor.scale)
        except ValueError:
            raise RecordingError(f"{at}, column {name}: {cell[:40]!r} is not a number") from None
    return values + [0.0] * (sensor.width - len(values))
