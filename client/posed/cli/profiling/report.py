"""What the runs come to: medians, spreads, rates, and the machine they were made on."""

import os
import platform
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from posed.cli.profiling.clients import Received
from posed.cli.profiling.measurement import MODES, ModeRuns, Observation
from posed.client.sensor import period_of_delay_us

INPUTS = ("accelerometer", "gyroscope", "magnetic_field")
# Of the client's poses; it takes them at 10 Hz.
_POSE_PERIOD_S = 0.1


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A row of Patonis et al. 2018, Table 2: a whole AR application on a tablet with four cores."""

    events_per_s: int
    cpu_percent: int


PAPER: Mapping[str, PaperRow] = {
    "NORMAL": PaperRow(25, 9),
    "UI": PaperRow(45, 10),
    "GAME": PaperRow(150, 13),
    "FASTEST": PaperRow(350, 15),
}


@dataclass(frozen=True, slots=True)
class Repeated:
    """A figure that was measured once or several times."""

    median: float
    spread: float | None
    """Largest minus smallest; None of a single value."""

    @classmethod
    def of(cls, values: Iterable[float]) -> "Repeated":
        """Return median and spread of the values, one or more."""
        values = list(values)
        return cls(statistics.median(values), max(values) - min(values) if len(values) > 1 else None)

    def differs_from(self, other: "Repeated") -> bool:
        """Return whether the medians are further apart than either figure is spread; single values never are."""
        if self.spread is None or other.spread is None:
            return False
        return abs(self.median - other.median) > max(self.spread, other.spread)


@dataclass(frozen=True, slots=True)
class SensorHz:
    """A sensor's rates: what the mode asks for, what the daemon set it to, what came to a client that listened."""

    asked: float
    configured: float
    measured: float | None


@dataclass(frozen=True, slots=True)
class ModeReport:
    """What one mode costs; CPU in percent of one core, without what the daemon uses idle."""

    sensor_hz: Mapping[str, SensorHz]
    events_per_s: Repeated
    daemon_cpu_percent: Repeated
    source_cpu_percent: Repeated
    kernel_cpu_percent: Repeated
    client_cpu_percent: Repeated
    streaming_cpu_percent: Repeated | None
    batched_cpu_percent: Repeated | None
    wakeups_per_s: Repeated
    """All of the daemon's."""
    rss_mb: Repeated
    lateness_p50_ms: float
    lateness_p99_ms: float
    ar_daemon_cpu_percent: Repeated | None
    ar_server_cpu_percent: Repeated | None
    ar_page_cpu_percent: Repeated | None
    ar_cpu_percent: Repeated | None
    """Daemon, server and page together."""
    ar_world_cpu_percent: Repeated | None
    """The same with the drawn world in place of a picture."""
    modes_in_force: tuple[str, ...]
    """What the poses of our client said; more or other than the mode if somebody else asked for a faster one."""


@dataclass(frozen=True, slots=True)
class IdleReport:
    """The daemon without our client."""

    daemon_cpu_percent: Repeated
    source_cpu_percent: Repeated
    kernel_cpu_percent: Repeated
    wakeups_per_s: Repeated
    rss_mb: Repeated


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that is shown."""

    modes: Mapping[str, ModeReport]
    idle: IdleReport
    machine: Mapping[str, Any]


def report(runs: Mapping[str, ModeRuns]) -> Report:
    """Return what the runs of each mode come to."""
    # Modes that share a daemon share its idle runs too.
    idle = list({id(each): each for mode_runs in runs.values() for each in mode_runs.idle}.values())
    return Report({mode: _mode_report(mode, each) for mode, each in runs.items()}, _idle_report(idle), machine())


def as_json(report: Report) -> dict[str, Any]:
    """Return the report as JSON holds it: medians by name, the spreads under "spread"."""
    modes = {}
    for mode, each in report.modes.items():
        sensor_hz = {
            name: {key: _rounded(value, 3) for key, value in asdict(hz).items()} for name, hz in each.sensor_hz.items()
        }
        modes[mode] = {"sensor_hz": sensor_hz, **_figures(each)}
    return {"modes": modes, "idle": _figures(report.idle), "machine": dict(report.machine)}


def machine() -> dict[str, Any]:
    """Return what the figures depend on: processor, kernel and libraries."""
    import google.protobuf
    import zmq

    return {
        "cpu_model": _cpu_model(),
        "cores": os.cpu_count(),
        "kernel": platform.release().partition("-")[0],
        "python": platform.python_version(),
        "libzmq": zmq.zmq_version(),
        "protobuf": google.protobuf.__version__,
    }


def _mode_report(mode: str, runs: ModeRuns) -> ModeReport:
    def above_idle(observations: Sequence[Observation], figure: Callable[[Observation], float]) -> Repeated:
        return Repeated.of(figure(one) - figure(idle) for one, idle in zip(observations, runs.idle, strict=True))

    def daemon_cpu(observation: Observation) -> float:
        return observation.daemon.cpu_percent

    def page_cpu(observation: Observation) -> float:
        return observation.page.cpu_percent if observation.page else 0.0

    def client_cpu(observation: Observation) -> float:
        return observation.client.cpu_percent if observation.client else 0.0

    def ar_cpu(observation: Observation) -> float:
        return daemon_cpu(observation) + client_cpu(observation) + page_cpu(observation)

    last = runs.pose[-1].statistics
    return ModeReport(
        sensor_hz=_sensor_hz(mode, runs),
        events_per_s=_events_per_s(runs),
        daemon_cpu_percent=above_idle(runs.pose, daemon_cpu),
        source_cpu_percent=above_idle(runs.pose, lambda one: one.source_cpu_percent),
        kernel_cpu_percent=above_idle(runs.pose, lambda one: one.filter_cpu_percent),
        client_cpu_percent=Repeated.of(map(client_cpu, runs.pose)),
        streaming_cpu_percent=above_idle(runs.streaming, daemon_cpu) if runs.streaming else None,
        batched_cpu_percent=above_idle(runs.batched, daemon_cpu) if runs.batched else None,
        wakeups_per_s=Repeated.of(one.daemon.wakeups_per_s for one in runs.pose),
        rss_mb=Repeated.of(one.daemon.rss_mb for one in runs.pose),
        lateness_p50_ms=last.lateness_p50_ms,
        lateness_p99_ms=last.lateness_p99_ms,
        ar_daemon_cpu_percent=above_idle(runs.ar, daemon_cpu) if runs.ar else None,
        ar_server_cpu_percent=Repeated.of(map(client_cpu, runs.ar)) if runs.ar else None,
        ar_page_cpu_percent=Repeated.of(map(page_cpu, runs.ar)) if runs.ar else None,
        ar_cpu_percent=above_idle(runs.ar, ar_cpu) if runs.ar else None,
        ar_world_cpu_percent=above_idle(runs.ar_world, ar_cpu) if runs.ar_world else None,
        modes_in_force=tuple(sorted({name for got in runs.poses for name in got.modes})),
    )


def _idle_report(observations: Sequence[Observation]) -> IdleReport:
    return IdleReport(
        Repeated.of(one.daemon.cpu_percent for one in observations),
        Repeated.of(one.source_cpu_percent for one in observations),
        Repeated.of(one.filter_cpu_percent for one in observations),
        Repeated.of(one.daemon.wakeups_per_s for one in observations),
        Repeated.of(one.daemon.rss_mb for one in observations),
    )


def _events_per_s(runs: ModeRuns) -> Repeated:
    """Return the rate by all poses of all repeats: one repeat begins and ends between two events of a slow sensor."""
    counted = [got for got in runs.poses if got.poses]
    if not counted:  # a client that is not ours does not tell what it got
        return Repeated.of(one.events_fused_per_s for one in runs.pose)
    rates = [got.events / (got.poses * _POSE_PERIOD_S) for got in counted]
    pooled = sum(got.events for got in counted) / (sum(got.poses for got in counted) * _POSE_PERIOD_S)
    return Repeated(pooled, Repeated.of(rates).spread)


def _sensor_hz(mode: str, runs: ModeRuns) -> dict[str, SensorHz]:
    # A command asks for what it likes, and FASTEST for no period at all: there the request as the daemon has it,
    # clamped to what the sensor can, stands for it.
    period_us = period_of_delay_us(MODES[mode]) if runs.raw else 0
    found = {}
    for sensor in runs.pose[-1].statistics.sensors:
        name = runs.sensor_names.get(sensor.handle, "")
        if name in INPUTS and sensor.configured_period_ns:
            asked = 1e6 / (period_us or sensor.requested_period_us)
            found[name] = SensorHz(asked, 1e9 / sensor.configured_period_ns, _measured_hz(name, runs.raw))
    return {name: found[name] for name in INPUTS if name in found}


def _measured_hz(name: str, received: Sequence[Received]) -> float | None:
    counts = [got.sensors[name] for got in received if name in got.sensors]
    span_ns = sum(last - first for _, first, last in counts)
    return 1e9 * sum(count - 1 for count, _, _ in counts) / span_ns if span_ns > 0 else None


def _figures(report: ModeReport | IdleReport) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    spreads = {}
    for name in report.__slots__:
        value = getattr(report, name)
        if isinstance(value, Repeated):
            figures[name] = _rounded(value.median)
            spreads[name] = _rounded(value.spread)
        elif value is None or isinstance(value, float):
            figures[name] = _rounded(value)
    return {**figures, "spread": spreads}


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None else round(value, digits)


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())
