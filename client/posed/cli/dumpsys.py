"""`posed dumpsys`: the state of a service as text."""

import argparse

from posed.cli.connection import connect, sensor_service
from posed.proto import sensors_pb2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the service."""
    parser.add_argument("service", choices=("sensorservice",), metavar="SERVICE", help="sensorservice")
    parser.epilog = """\
The text of Android's 'dumpsys sensorservice', field for field: what the clients asked of each sensor and what came of
it, the sensor list, the fusion, the last events, the connections with what each received, and the last registrations.
A connection's line of events is that of a debug build: events recvd = sent + cached + dropped, where "cache" is what
waits now."""


def run(arguments: argparse.Namespace) -> int:
    """Print the text that the running daemon gives."""
    text = ""
    with connect() as connection:
        service = sensor_service(connection)
        more = True
        while more:
            part = service.dump(sensors_pb2.DumpRequest(offset=len(text)))
            text += part.text
            more = part.more
    print(text, end="")
    return 0
