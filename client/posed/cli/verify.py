"""`posed verify`: Android's conformance checks of the running daemon."""

import argparse
import contextlib
import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from posed.cli.connection import require_daemon
from posed.cli.events import find_sensor
from posed.cli.options import positive_seconds
from posed.errors import InvalidArgumentError

if TYPE_CHECKING:
    from posed.client import Sensor, SensorManager
    from posed.verify.finding import Finding
    from posed.verify.matrix import Conditions
    from posed.verify.suite import Step
    from posed.verify.truth import Attitude

_QUICK_RATES_HZ = (0.0, 50.0, 5.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what is verified and how it is shown."""
    parser.add_argument("--sensors", metavar="A,B", help="types, string types or handles (default: all)")
    parser.add_argument("--rates", type=_rates, metavar="A,B", help="Hz or FASTEST (default: those of Android's CTS)")
    parser.add_argument("--quick", action="store_true", help="FASTEST, 50 and 5 Hz only, 4 s each")
    parser.add_argument("--seconds", type=positive_seconds, metavar="S", help="each point takes this long (default: 5)")
    parser.add_argument("--still", action="store_true", help="the phone is at rest: judge its noise too")
    parser.add_argument("--hifi", action="store_true", help="judge jitter as of a device with Android's Hi-Fi sensors")
    parser.add_argument(
        "--profile", metavar="NAME|PATH", help="whose rates bind where Android's are denser (default: the daemon's)"
    )
    parser.add_argument("--all", action="store_true", help="print every finding, not a line a verification")
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write JUnit XML")
    parser.epilog = """\
Every sensor at FASTEST, 200, 100, 50, 25, 15, 10, 5 and 1 Hz, each event as it happens and in batches of 1 s, sensors
side by side; then against how the phone was held, where the source knows; then registering, flushing, triggering and
changing rates. Exit code 1 if anything fails. Of a replay, the verifications of clocks fail unless it runs on the boot
clock. Direct channels do not exist here, nor do their verifications."""


def run(arguments: argparse.Namespace) -> int:
    """Run the suite, print the table, return 1 if anything failed."""
    require_daemon()
    from posed.cli.verify_table import print_table
    from posed.client import ACTIVITY_RECOGNITION, HIGH_SAMPLING_RATE_SENSORS, Package, SensorManager
    from posed.verify.finding import Verdict
    from posed.verify.matrix import RATES_HZ
    from posed.verify.source import BootClock
    from posed.verify.suite import steps

    rates_hz = arguments.rates or (_QUICK_RATES_HZ if arguments.quick else RATES_HZ)
    begun = time.monotonic()
    findings: list[Finding] = []
    with SensorManager(
        package=Package("posed-verify", permissions=(HIGH_SAMPLING_RATE_SENSORS, ACTIVITY_RECOGNITION))
    ) as manager:
        sensors = _chosen(arguments.sensors, manager.get_sensor_list())
        conditions = _conditions(arguments, manager)
        todo = list(steps(manager, BootClock(), sensors, rates_hz, conditions, _listen_to_truth))
        with _progress(len(todo)) as progress, _refusals_unsaid():
            for step in todo:
                progress(step)
                findings += step.run()
    seconds = time.monotonic() - begun
    if arguments.junit is not None:
        from posed.verify.junit import junit_xml

        try:
            arguments.junit.write_text(junit_xml(findings, seconds))
        except OSError as error:
            raise InvalidArgumentError(f"cannot write {arguments.junit}: {error.strerror}") from error
    print_table(findings, seconds, arguments.all)
    return int(any(finding.verdict is Verdict.FAIL for finding in findings))


def _chosen(wanted: str | None, sensors: "list[Sensor]") -> "list[Sensor]":
    if wanted is None:
        return sensors
    return list(dict.fromkeys(find_sensor(word.strip(), sensors) for word in wanted.split(",")))


def _conditions(arguments: argparse.Namespace, manager: "SensorManager") -> "Conditions":
    from posed.verify.matrix import Conditions

    def fastest_asked_us(sensor: "Sensor") -> int | None:
        asked = [each for each in manager.get_statistics().sensors if each.handle == sensor.handle]
        return asked[0].requested_period_us if asked else None

    return Conditions(
        seconds=arguments.seconds or (4.0 if arguments.quick else 5.0),
        still=arguments.still,
        hifi=arguments.hifi,
        rates_hz_of=_rate_table(arguments.profile or _profile_of_daemon()),
        fastest_asked_us=fastest_asked_us,
    )


@contextlib.contextmanager
def _listen_to_truth(take: "Callable[[Attitude], None]") -> Iterator[None]:
    """Hand over what the daemon knows of how the phone is held, turned to magnetic north."""
    from posed.client import SENSOR_DELAY_FASTEST, PoseClient, Truth
    from posed.verify.truth import Attitude

    def take_truth(truth: Truth) -> None:
        if truth.instant_quaternion is not None:
            x, y, z, w = truth.instant_quaternion
            # Magnetic north lies east of the true one by the declination: about the vertical, the other way.
            sine, cosine = math.sin(truth.declination / 2), math.cos(truth.declination / 2)
            turned = (cosine * x - sine * y, cosine * y + sine * x, cosine * z + sine * w, cosine * w - sine * z)
            take(Attitude(truth.instant_ns, turned))

    with PoseClient(SENSOR_DELAY_FASTEST, pose_rate_hz=50, every=True, on_truth=take_truth):
        yield


def _profile_of_daemon() -> str | None:
    from posed.client import PoseClient

    with PoseClient() as client:
        client.wait_connected(5.0)
        return client.device.profile if client.device is not None else None


def _rate_table(name: str | None) -> "Callable[[Sensor], tuple[float, ...]]":
    """Return the rates of a sensor by the profile, ambient ones too; a fused sensor has those of the accelerometer."""
    from posed.errors import PosedError
    from posed.events import SensorType
    from posed.hal.profile import load_profile

    if name is None:
        return lambda sensor: ()
    try:
        profile = load_profile(name)
    except PosedError as error:
        print(f"posed: {error}; no profile's rates bind: give one with --profile", file=sys.stderr)
        return lambda sensor: ()
    rates_hz = {info.handle: profile.sensor(info.handle).rates_hz for info in profile.sensor_infos()}
    rates_hz.update({int(part.type): part.rates_hz for part in profile.ambient})
    return lambda sensor: rates_hz.get(sensor.handle, rates_hz[int(SensorType.ACCELEROMETER)])


@contextlib.contextmanager
def _refusals_unsaid() -> Iterator[None]:
    """Keep off stderr what the client says of calls that the suite makes to see them refused."""
    log = logging.getLogger("posed.client.sensor_manager")
    log.disabled = True
    try:
        yield
    finally:
        log.disabled = False


@contextlib.contextmanager
def _progress(steps: int) -> "Iterator[Callable[[Step], None]]":
    """Yield what to tell of each step; on stderr it shows as a bar, or off a terminal as a line a group of steps."""
    if not sys.stderr.isatty():
        told = ""

        def say(step: "Step") -> None:
            nonlocal told
            if step.group != told:
                told = step.group
                print(f"posed: verifying {told}", file=sys.stderr)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:40}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=steps)
        begun = 0

        def tell(step: "Step") -> None:
            nonlocal begun
            bar.update(task, completed=begun, description=step.name)
            begun += 1

        yield tell


def _rates(text: str) -> tuple[float, ...]:
    try:
        rates = tuple(0.0 if word.strip().upper() == "FASTEST" else float(word) for word in text.split(","))
    except ValueError:
        rates = (-1.0,)
    if any(not (rate == 0 or 0.1 <= rate <= 1000) for rate in rates):
        raise argparse.ArgumentTypeError(f"{text!r} are no rates; give FASTEST or 0.1 to 1000 Hz, separated by commas")
    return rates
