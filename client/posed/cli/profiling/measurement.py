"""The plan of a measurement, and what each of its runs found."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from posed.cli.profiling.accounting import Reading, Usage, read, usage
from posed.cli.profiling.ar_client import ArApplication
from posed.cli.profiling.clients import Client, Command, Received, Workload
from posed.cli.profiling.daemons import Daemon
from posed.client import SENSOR_DELAY_FASTEST, SENSOR_DELAY_GAME, SENSOR_DELAY_NORMAL, SENSOR_DELAY_UI
from posed.proto import sensors_pb2

MODES: Mapping[str, int] = {
    "NORMAL": SENSOR_DELAY_NORMAL,
    "UI": SENSOR_DELAY_UI,
    "GAME": SENSOR_DELAY_GAME,
    "FASTEST": SENSOR_DELAY_FASTEST,
}
BATCH_LATENCY_US = 100_000

# The connection over which the counters were read is gone, and what it woke is asleep again, after this long.
_SETTLE_S = 0.25


@dataclass(frozen=True, slots=True)
class Observation:
    """A daemon, and its client if there was one, over one stretch of time; CPU in percent of one core."""

    daemon: Usage
    client: Usage | None
    source_cpu_percent: float
    filter_cpu_percent: float
    events_fused_per_s: float
    statistics: sensors_pb2.Statistics
    """The daemon's counters at the end."""
    page: Usage | None = None
    """The browser, where the client is the AR application's server."""


@dataclass(slots=True)
class ModeRuns:
    """The runs of one mode, one of each kind a repeat; idle is its daemon before anybody came."""

    sensor_names: Mapping[int, str]
    idle: list[Observation] = field(default_factory=list)
    pose: list[Observation] = field(default_factory=list)
    poses: list[Received] = field(default_factory=list)
    streaming: list[Observation] = field(default_factory=list)
    batched: list[Observation] = field(default_factory=list)
    raw: list[Received] = field(default_factory=list)
    ar: list[Observation] = field(default_factory=list)
    ar_world: list[Observation] = field(default_factory=list)


def measure(
    daemons: Mapping[str, Daemon],
    seconds: float,
    repeats: int,
    command: Sequence[str] = (),
    progress: Callable[[str], None] = lambda doing: None,
    *,
    with_ar: bool = False,
) -> dict[str, ModeRuns]:
    """Measure each mode with the daemon given for it; what stands beside each other alternates, repeat by repeat.

    The client is a pose client of ours, the AR application if asked for, and then listeners to the raw sensors; or only
    `command`, in which {mode} is replaced by the mode's name, and the AR application. progress is told of each of the
    `steps` before it begins. Raises PosedError if a daemon or a client does not do what it has to.
    """
    results = {mode: ModeRuns(daemon.sensor_names) for mode, daemon in daemons.items()}
    # Two modes may share a daemon, the user's own.
    distinct = list(dict.fromkeys(daemons.values()))
    for repeat in range(1, repeats + 1):
        progress(f"{repeat}/{repeats} idle")
        idle = dict(zip(distinct, observe(distinct, seconds), strict=True))
        for mode, daemon in daemons.items():
            results[mode].idle.append(idle[daemon])
        for mode, daemon in daemons.items():
            progress(f"{repeat}/{repeats} {mode} pose")
            client: Client
            if command:
                client = Command(daemon, [word.replace("{mode}", mode) for word in command])
            else:
                client = Workload.poses(daemon, MODES[mode])
            _run(daemon, client, seconds, results[mode].pose, results[mode].poses)
        for drawn_world in (False, True) if with_ar else ():
            for mode, daemon in daemons.items():
                progress(f"{repeat}/{repeats} {mode} AR")
                runs = results[mode]
                observations = runs.ar_world if drawn_world else runs.ar
                with ArApplication(daemon, mode, drawn_world=drawn_world) as application:
                    observations += observe([daemon], seconds, application.read_server, application.read_page)
        if command:
            continue
        for kind, latency_us in (("streaming", 0), ("batched", BATCH_LATENCY_US)):
            for mode, daemon in daemons.items():
                progress(f"{repeat}/{repeats} {mode} {kind}")
                runs = results[mode]
                observations = runs.batched if latency_us else runs.streaming
                _run(daemon, Workload.events(daemon, MODES[mode], latency_us), seconds, observations, runs.raw)
    return results


def steps(modes: int, repeats: int, command: Sequence[str] = (), *, with_ar: bool = False) -> int:
    """Return how many steps `measure` has."""
    return repeats * (1 + modes * ((1 if command else 3) + 2 * with_ar))


def observe(daemons: Sequence[Daemon], seconds: float, *clients: Callable[[], Reading]) -> list[Observation]:
    """Watch daemons at the same time; the accounts of the clients, none to two, are those of the first's."""
    first = [daemon.statistics() for daemon in daemons]
    time.sleep(_SETTLE_S)
    clients_before = [read_client() for read_client in clients]
    before = [read(daemon.pid) for daemon in daemons]
    time.sleep(seconds)
    after = [read(daemon.pid) for daemon in daemons]
    used = [usage(reading, read_client()) for reading, read_client in zip(clients_before, clients, strict=True)]
    last = [daemon.statistics() for daemon in daemons]
    return [
        _observation(usage(*readings), used, *statistics)
        for readings, statistics in zip(zip(before, after, strict=True), zip(first, last, strict=True), strict=True)
    ]


def _run(
    daemon: Daemon, client: Client, seconds: float, observations: list[Observation], received: list[Received]
) -> None:
    with client:
        observations += observe([daemon], seconds, client.read)
        received.append(client.finish())


def _observation(
    daemon: Usage, clients: Sequence[Usage], first: sensors_pb2.Statistics, last: sensors_pb2.Statistics
) -> Observation:
    elapsed_ns = last.timestamp_ns - first.timestamp_ns
    return Observation(
        daemon=daemon,
        client=clients[0] if clients else None,
        page=clients[1] if len(clients) > 1 else None,
        source_cpu_percent=100.0 * (last.source_cpu_ns - first.source_cpu_ns) / elapsed_ns,
        filter_cpu_percent=100.0 * (last.filter_cpu_ns - first.filter_cpu_ns) / elapsed_ns,
        events_fused_per_s=1e9 * (last.events_fused - first.events_fused) / elapsed_ns,
        statistics=last,
    )
