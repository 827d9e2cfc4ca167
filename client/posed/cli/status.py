"""`posed status`: whether the daemon runs, and what it does."""

import argparse
import json
from typing import Any

from rich.console import Console
from rich.table import Table

from posed.binder.runtime import runtime_directory
from posed.cli.connection import connect, sensor_service, service_manager
from posed.client.launcher import daemon_listens
from posed.proto import binder_pb2, sensors_pb2, service_manager_pb2

# As an init script's `status` has it (LSB): 3 is "program is not running".
_NOT_RUNNING = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --json."""
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.epilog = """\
Exit codes: 0 it runs; 3 it does not; 69 it does not answer. Asking does not count as a binding.

Keys of --json: running (the only one if false), pid, version, boot_id, uptime_s, started, bound_clients, connections,
source, source_ended, profile, filter, filters_compiled, runtime_directory, process_cpu_s, wakeups, events_fused,
poses_published, poses_skipped, lateness_p50_ms, lateness_p99_ms, parcels_refused, sensors (handle, type, name,
requested_hz, configured_hz, latency_ms, registrations, events), listeners (pid, package, listener, events_received,
events_sent, events_dropped, events_cached)."""


def run(arguments: argparse.Namespace) -> int:
    """Ask the daemon and print what it says."""
    if not daemon_listens():
        print(json.dumps({"running": False}) if arguments.json else "posed is not running")
        return _NOT_RUNNING
    with connect() as connection:
        status = service_manager(connection).getStatus(binder_pb2.Empty())
        sensors = sensor_service(connection)
        infos = {info.handle: info for info in sensors.getSensorList(binder_pb2.Empty()).sensors}
        statistics = sensors.getStatistics(binder_pb2.Empty())
    facts = _facts(status, statistics, infos)
    if arguments.json:
        print(json.dumps(facts))
    else:
        _print(facts)
    return 0


def _facts(
    status: service_manager_pb2.ServiceStatus,
    statistics: sensors_pb2.Statistics,
    infos: dict[int, sensors_pb2.SensorInfo],
) -> dict[str, Any]:
    return {
        "running": True,
        "pid": status.pid,
        "version": status.version,
        "boot_id": status.boot_id.hex(),
        "uptime_s": status.uptime_ns / 1e9,
        "started": status.started,
        "bound_clients": status.bound_clients,
        # This one is going.
        "connections": status.connections - 1,
        "source": status.source,
        "source_ended": statistics.source_ended,
        "profile": status.profile,
        "filter": status.filter,
        "filters_compiled": statistics.filters_compiled,
        "runtime_directory": str(runtime_directory()),
        "process_cpu_s": statistics.process_cpu_ns / 1e9,
        "wakeups": statistics.wakeups,
        "events_fused": statistics.events_fused,
        "poses_published": statistics.poses_published,
        "poses_skipped": statistics.poses_skipped,
        "lateness_p50_ms": statistics.lateness_p50_ms,
        "lateness_p99_ms": statistics.lateness_p99_ms,
        "parcels_refused": statistics.parcels_refused,
        "sensors": [
            {
                "handle": sensor.handle,
                "type": infos[sensor.handle].string_type.removeprefix("android.sensor."),
                "name": infos[sensor.handle].name,
                "requested_hz": _hz(sensor.requested_period_us * 1000),
                "configured_hz": _hz(sensor.configured_period_ns),
                "latency_ms": sensor.max_report_latency_us / 1000,
                "registrations": sensor.registrations,
                "events": sensor.events,
            }
            for sensor in statistics.sensors
        ],
        "listeners": [
            {
                "pid": listener.pid,
                "package": listener.package_name,
                "listener": listener.listener,
                "events_received": listener.events_received,
                "events_sent": listener.events_sent,
                "events_dropped": listener.events_dropped,
                "events_cached": listener.events_cached,
            }
            for listener in statistics.listeners
        ],
    }


def _print(facts: dict[str, Any]) -> None:
    console = Console(highlight=False, markup=False)
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    stays = "started; it stays when nobody binds it" if facts["started"] else "bound; it ends with its last client"
    rows = {
        "posed": f"running, process {facts['pid']}, version {facts['version']}, up {_span(facts['uptime_s'])}",
        "life": f"{stays}; {_count(facts['bound_clients'], 'bound client')}, "
        f"{_count(facts['connections'], 'connection')}",
        "source": f"{facts['source']}{' (at its end)' if facts['source_ended'] else ''}, profile {facts['profile']},"
        f" filter {facts['filter']} ({'compiled' if facts['filters_compiled'] else 'interpreted'})",
        "poses": f"{facts['poses_published']} published, {facts['poses_skipped']} skipped as late",
        "lateness": f"median {facts['lateness_p50_ms']:.2f} ms, 99 % within {facts['lateness_p99_ms']:.2f} ms"
        if facts["poses_published"]
        else "-",
        "CPU": f"{facts['process_cpu_s']:.2f} s, {facts['wakeups']} wake-ups, {facts['events_fused']} events fused",
    }
    for label, text in rows.items():
        table.add_row(label, text)
    console.print(table)
    if facts["sensors"]:
        console.print(_sensor_table(facts["sensors"]))
    else:
        console.print("no sensor is active", style="dim")


def _sensor_table(sensors: list[dict[str, Any]]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column("active sensor")
    for heading in ("asked Hz", "set Hz", "latency ms", "users", "events"):
        table.add_column(heading, justify="right")
    for sensor in sensors:
        table.add_row(
            sensor["type"],
            _number(sensor["requested_hz"]),
            _number(sensor["configured_hz"]),
            f"{sensor['latency_ms']:g}",
            str(sensor["registrations"]),
            str(sensor["events"]),
        )
    return table


def _hz(period_ns: int) -> float | None:
    """Return the rate of a period, None for a fused sensor's 0, which follows its accelerometer."""
    return 1e9 / period_ns if period_ns else None


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _span(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
