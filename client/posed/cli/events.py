"""`posed events`: one sensor's raw events as they come."""

import argparse
import contextlib
import json
import queue
import select
import sys
from collections.abc import Callable

from posed.cli.connection import PACKAGE, require_daemon
from posed.cli.options import RATE_MODES, positive_count
from posed.cli.sensors import short_name, unit
from posed.cli.watch import Silence, exit_on_signals, tell_end
from posed.client import SENSOR_STATUS_ACCURACY_HIGH, Sensor, SensorEvent, SensorManager, TriggerEvent
from posed.client.sensor import period_of_delay_us
from posed.errors import InvalidArgumentError, PosedError

# How often it is looked whether the reader is still there, while no event comes.
_TICK_S = 0.25
_SHORTEST_US = 1000
# A minute at the highest rate.
_BACKLOG = 60_000
_ACCURACIES = {-1: "no contact", 0: "unreliable", 1: "low", 2: "medium", 3: "high"}
_DELAYS = dict(zip(reversed(RATE_MODES), range(4), strict=True))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the sensor and how to listen to it."""
    parser.add_argument(
        "sensor",
        metavar="SENSOR",
        help="accelerometer, gyroscope, magnetic_field, rotation_vector, ...: a type, string type or handle of"
        " 'posed sensors'",
    )
    parser.add_argument(
        "--rate",
        type=_period_us,
        default="NORMAL",
        metavar="RATE",
        help="NORMAL, UI, GAME, FASTEST, a number of Hz, or a period such as 5000us (default: NORMAL)",
    )
    parser.add_argument(
        "--latency", type=_latency_us, default=0, metavar="MS", help="how long events may wait to come in batches"
    )
    parser.add_argument("--count", type=positive_count, metavar="N", help="end after N events")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")
    parser.epilog = """\
Another client's faster registration of the same sensor sets the rate for all, as in Android. A one-shot sensor is
waited for, and its event ends the command; so does the end of the recording that a daemon replays: exit code 1 if no
event of it came, else 0.

Keys of --json: sensor (its type), handle, timestamp_ns (sample time), values (in the sensor's unit), accuracy
(Android's SENSOR_STATUS, -1 to 3)."""


def run(arguments: argparse.Namespace) -> int:
    """Print events until Ctrl-C, --count, or the end of the reader or of the recording."""
    require_daemon()
    exit_on_signals()
    try:
        with SensorManager(package=PACKAGE, on_service_disconnected=_tell_lost, on_binding_died=_tell_ended) as manager:
            sensor = find_sensor(arguments.sensor, manager.get_sensor_list())
            listener = _Listener()
            if sensor.reporting_mode == Sensor.REPORTING_MODE_ONE_SHOT:
                manager.request_trigger_sensor(listener, sensor)
                arguments.count = 1
            elif not manager.register_listener(listener, sensor, arguments.rate, arguments.latency):
                raise PosedError(f"the daemon refused a listener for {short_name(sensor)}; see 'posed status'")
            _print_events(listener, arguments.count, arguments.json, lambda: manager.flush(listener))
        if listener.dropped:
            print(f"posed: {listener.dropped} events were dropped: they were not read in time", file=sys.stderr)
    except KeyboardInterrupt:
        pass
    return 0


def find_sensor(wanted: str, sensors: list[Sensor]) -> Sensor:
    """Return the first sensor of that type, string type or handle; raises InvalidArgumentError with the list."""
    for sensor in sensors:
        if wanted.lower() in (short_name(sensor), sensor.string_type, str(sensor.handle)):
            return sensor
    known = ", ".join(short_name(sensor) for sensor in sensors)
    hint = ""
    if wanted.lower().removeprefix("android.sensor.") == "heading":
        hint = "; heading needs --position of 'posed serve' or 'posed start'"
    raise InvalidArgumentError(f"there is no sensor {wanted!r}; there are {known}{hint}")


def event_json(event: SensorEvent) -> str:
    """Return an event as one line of JSON; NaN and infinity, which a replay can hold, are null."""
    return json.dumps(
        {
            "sensor": short_name(event.sensor),
            "handle": event.sensor.handle,
            "timestamp_ns": event.timestamp,
            "values": [value if abs(value) < float("inf") else None for value in event.values],
            "accuracy": event.accuracy,
        }
    )


def event_line(event: SensorEvent) -> str:
    """Return an event as one line for people: seconds of sample time, values, unit, accuracy."""
    values = " ".join(f"{value:+12.6f}" for value in event.values)
    accuracy = _ACCURACIES.get(event.accuracy, str(event.accuracy))
    return f"{event.timestamp / 1e9:14.6f} s {values} {unit(event.sensor):5} {accuracy}"


class _Listener:
    """Keeps what the reader of stdout is too slow for, a minute of it; then the oldest go."""

    def __init__(self) -> None:
        self.events: queue.Queue[SensorEvent] = queue.Queue(_BACKLOG)
        self.dropped = 0

    def on_sensor_changed(self, event: SensorEvent) -> None:
        if self.events.full():
            with contextlib.suppress(queue.Empty):  # read meanwhile
                self.events.get_nowait()
                self.dropped += 1
        self.events.put_nowait(event)

    def on_trigger(self, event: TriggerEvent) -> None:
        self.on_sensor_changed(SensorEvent(event.sensor, event.timestamp, event.values, SENSOR_STATUS_ACCURACY_HIGH))


def _print_events(listener: _Listener, count: int | None, as_json: bool, flush: Callable[[], object]) -> None:
    """Print until `count` events, or the reader or the recording ends: then what a batch still holds is flushed."""
    reader = select.poll()
    reader.register(sys.stdout, 0)
    silence = Silence()
    printed = 0
    flushed = False
    while printed != count:
        try:
            event = listener.events.get(timeout=_TICK_S)
        except queue.Empty:
            if reader.poll(0):
                return
            if silence.is_the_end(False):
                if flushed:
                    tell_end(printed)
                    return
                flush()
                flushed = True
            continue
        silence.is_the_end(True)
        print(event_json(event) if as_json else event_line(event), flush=True)
        printed += 1


def _tell_lost() -> None:
    print("posed: the daemon went away; waiting for its return", file=sys.stderr)


def _tell_ended(reason: str) -> None:
    print(f"posed: {reason}; waiting for another", file=sys.stderr)


def _period_us(text: str) -> int:
    """Read a rate mode, a rate or a period and return the period, us; 0 is fastest."""
    if text.upper() in _DELAYS:
        return period_of_delay_us(_DELAYS[text.upper()])
    try:
        if text.endswith("us"):
            period_us = int(text.removesuffix("us"))
        else:
            period_us = round(1e6 / float(text.lower().removesuffix("hz")))
    except (ValueError, ZeroDivisionError, OverflowError):
        period_us = 0
    if period_us < _SHORTEST_US:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no rate; give {', '.join(RATE_MODES)}, up to 1000 Hz, or a period from 1000us"
        )
    return period_us


def _latency_us(text: str) -> int:
    try:
        latency_us = round(float(text) * 1000)
    except (ValueError, OverflowError):
        latency_us = -1
    if latency_us < 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no latency; give milliseconds, 0 or more")
    return latency_us
