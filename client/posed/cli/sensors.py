"""`posed sensors`: the sensor list."""

import argparse
import json
import sys
from dataclasses import asdict

from rich.console import Console
from rich.table import Table

from posed.cli.connection import PACKAGE, require_daemon
from posed.client import Sensor, SensorManager

_WIDE = 1000
_UNITS = {
    Sensor.TYPE_ACCELEROMETER: "m/s²",
    Sensor.TYPE_ACCELEROMETER_UNCALIBRATED: "m/s²",
    Sensor.TYPE_GRAVITY: "m/s²",
    Sensor.TYPE_LINEAR_ACCELERATION: "m/s²",
    Sensor.TYPE_GYROSCOPE: "rad/s",
    Sensor.TYPE_GYROSCOPE_UNCALIBRATED: "rad/s",
    Sensor.TYPE_MAGNETIC_FIELD: "µT",
    Sensor.TYPE_MAGNETIC_FIELD_UNCALIBRATED: "µT",
    Sensor.TYPE_ORIENTATION: "°",
    Sensor.TYPE_HEADING: "°",
    Sensor.TYPE_LIGHT: "lx",
    Sensor.TYPE_PRESSURE: "hPa",
    Sensor.TYPE_PROXIMITY: "cm",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --json."""
    parser.add_argument("--json", action="store_true", help="one JSON array")
    parser.epilog = """\
Keys of --json, as android.hardware.Sensor has them: handle, type, string_type, name, vendor, version, maximum_range,
resolution, power (mA), min_delay and max_delay (us), fifo_reserved_event_count, fifo_max_event_count, reporting_mode
(0 continuous, 1 on-change, 2 one-shot, 3 special trigger), is_wake_up_sensor, is_dynamic_sensor,
is_additional_info_supported, is_data_injection_supported, id, required_permission."""


def run(arguments: argparse.Namespace) -> int:
    """Print the sensors of the running daemon."""
    require_daemon()
    with SensorManager(package=PACKAGE) as manager:
        sensors = manager.get_sensor_list()
    if arguments.json:
        print(json.dumps([asdict(sensor) for sensor in sensors], indent=2))
    else:
        # Off a terminal no width is too much, and a sensor stays one line for who reads lines.
        width = None if sys.stdout.isatty() else _WIDE
        Console(highlight=False, markup=False, width=width).print(_table(sensors))
    return 0


def short_name(sensor: Sensor) -> str:
    """Return a sensor's string type without android.sensor, such as gyroscope."""
    return sensor.string_type.removeprefix("android.sensor.")


def unit(sensor: Sensor) -> str:
    """Return the unit of a sensor's values, empty for one that has none, such as the rotation vector."""
    return _UNITS.get(sensor.type, "")


def _table(sensors: list[Sensor]) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), header_style="dim")
    table.add_column("#", justify="right")
    table.add_column("type", no_wrap=True)
    table.add_column("name, vendor")
    table.add_column("range")
    table.add_column("Hz", justify="right", no_wrap=True)
    table.add_column("mA", justify="right")
    table.add_column("FIFO", justify="right")
    for sensor in sensors:
        table.add_row(
            str(sensor.handle),
            short_name(sensor),
            f"{sensor.name}, {sensor.vendor}",
            f"{sensor.maximum_range:.4g} {unit(sensor)}",
            _rates(sensor),
            f"{sensor.power:g}",
            str(sensor.fifo_max_event_count),
        )
    return table


def _rates(sensor: Sensor) -> str:
    """Return the slowest and fastest rate, or a dash for a sensor that tells of changes and has none."""
    fastest = f"{1e6 / sensor.min_delay:.4g}" if sensor.min_delay > 0 else "-"
    return f"{1e6 / sensor.max_delay:.3g}-{fastest}" if sensor.max_delay > 0 else fastest
