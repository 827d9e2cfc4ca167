"""`posed set`: what surrounds a simulated phone."""

import argparse
import math

from posed.cli.connection import connect, sensor_service
from posed.client import Sensor
from posed.proto import sensors_pb2

_TYPES = {"light": Sensor.TYPE_LIGHT, "pressure": Sensor.TYPE_PRESSURE, "proximity": Sensor.TYPE_PROXIMITY}
_UNITS = {"light": "lx", "pressure": "hPa", "proximity": "cm"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the sensor and its value."""
    parser.add_argument("sensor", choices=tuple(_TYPES), metavar="SENSOR", help=", ".join(_TYPES))
    parser.add_argument("value", type=_value, metavar="VALUE", help="lux, hPa or cm")
    parser.epilog = """\
Of a daemon with a simulated phone; a recording's surroundings are as they were. At first: 300 lux, 1013.25 hPa, nothing
near. Listen with 'posed events light'."""


def run(arguments: argparse.Namespace) -> int:
    """Set the value in the running daemon."""
    with connect() as connection:
        sensor_service(connection).setEnvironment(
            sensors_pb2.SetEnvironmentRequest(type=_TYPES[arguments.sensor], value=arguments.value)
        )
    print(f"{arguments.sensor} is {arguments.value:g} {_UNITS[arguments.sensor]}")
    return 0


def _value(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is no value; give a number")
    return value
