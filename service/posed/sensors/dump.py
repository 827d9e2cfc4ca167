"""The state as text, as Android's `dumpsys sensorservice` prints it (SensorService::dump and what it calls)."""

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from posed.events import FilterStatus, Orientation, ReportingMode, SensorInfo, SensorType
from posed.sensors.active_sensor import ActiveSensor
from posed.sensors.arbitration import BatchParams
from posed.sensors.connection import SensorEventConnection
from posed.sensors.registration_log import RegistrationRecord
from posed.sensors.service import SensorService
from posed.sensors.virtual import FUSION_INPUTS

# sensors_event_t has 104 bytes; Android gives each client 100 KB of them where a sensor has a FIFO, else 4 KB.
_BATCHED_BUFFER_EVENTS = 100 * 1024 // 104
_UNBATCHED_BUFFER_EVENTS = 4 * 1024 // 104

_MODES = {
    ReportingMode.CONTINUOUS: "continuous",
    ReportingMode.ON_CHANGE: "on-change",
    ReportingMode.ONE_SHOT: "one-shot",
    ReportingMode.SPECIAL_TRIGGER: "special-trigger",
}


@dataclass(frozen=True, slots=True)
class Traffic:
    """What became of a connection's events behind its FIFO."""

    events_sent: int
    events_cached: int


def dump(service: SensorService, boot_ns: int, wall_ns: int, traffic: Mapping[SensorEventConnection, Traffic]) -> str:
    """Return the text at an instant, given on CLOCK_BOOTTIME and on the wall clock (ns since the epoch)."""
    return "\n".join(_lines(service, wall_ns - boot_ns, wall_ns, traffic)) + "\n"


def _lines(
    service: SensorService, wall_offset_ns: int, wall_ns: int, traffic: Mapping[SensorEventConnection, Traffic]
) -> Iterator[str]:
    sensors = service.all_sensors
    yield f"Captured at: {_clock_time(wall_ns, milliseconds=True)}"
    yield "Sensor Device:"
    yield from _device([sensor for sensor in sensors if not sensor.is_virtual])
    yield "Sensor List:"
    for sensor in sensors:
        yield from _listed(sensor.info)
    yield "Fusion States:"
    yield from _fusion(service)
    yield "Recent Sensor events:"
    for sensor in sensors:
        yield from _recent(sensor, wall_offset_ns)
    yield "Active sensors:"
    for sensor in sensors:
        if sensor.listeners:
            yield f"{sensor.info.name} (handle={sensor.info.handle:#010x}, connections={len(sensor.listeners)})"
    has_fifo = any(sensor.info.fifo_max_event_count for sensor in sensors)
    yield f"Socket Buffer size = {_BATCHED_BUFFER_EVENTS if has_fifo else _UNBATCHED_BUFFER_EVENTS} events"
    yield "WakeLock Status: not held "
    yield "Mode : NORMAL"
    yield "Sensor Privacy: disabled"
    yield f"{len(service.connections)} active connections"
    for number, connection in enumerate(service.connections):
        yield f"Connection Number: {number} "
        yield from _connection(connection, traffic.get(connection))
    yield "0 direct connections"
    yield "Previous Registrations:"
    for record in service.registrations.newest_first():
        yield _registration(record, wall_offset_ns)


def _device(sensors: list[ActiveSensor]) -> Iterator[str]:
    running = [sensor for sensor in sensors if sensor.requests]
    yield f"Total {len(sensors)} h/w sensors, {len(running)} running 0 disabled clients:"
    for sensor in running:
        selected = sensor.params
        assert selected is not None
        requests = sensor.requests.values()
        periods = ", ".join(f"{request.sampling_period_ns / 1e6:.1f}" for request in requests)
        latencies = ", ".join(f"{_latency_ms(request):.1f}" for request in requests)
        yield (
            f"{sensor.info.handle:#010x}) active-count = {len(requests)}; sampling_period(ms) = {{{periods}}}, "
            f"selected = {selected.sampling_period_ns / 1e6:.2f} ms; batching_period(ms) = {{{latencies}}}, "
            f"selected = {_latency_ms(selected):.2f} ms"
        )


def _latency_ms(params: BatchParams) -> float:
    # Who asks for a rate alone, as the pose does, leaves the latency to the others: to the minimum, as infinity.
    return math.inf if params.max_report_latency_ns is None else params.max_report_latency_ns / 1e6


def _listed(info: SensorInfo) -> Iterator[str]:
    yield (
        f"{info.handle:#010x}) {info.name:<25} | {info.vendor:<15} | ver: {info.version} | "
        f"type: {info.type.string_type:>20}({int(info.type)}) | perm: {info.required_permission or 'n/a'} | "
        f"flags: 0x{info.flags:08x}"
    )
    slowest = f"minRate={1e6 / info.max_delay_us:.2f}Hz" if info.max_delay_us > 0 else f"maxDelay={info.max_delay_us}us"
    fastest = f"maxRate={1e6 / info.min_delay_us:.2f}Hz" if info.min_delay_us > 0 else f"minDelay={info.min_delay_us}us"
    fifo = (
        f"FIFO (max,reserved) = ({info.fifo_max_event_count}, {info.fifo_reserved_event_count}) events"
        if info.fifo_max_event_count
        else "no batching"
    )
    wake_up = "wakeUp" if info.wake_up else "non-wakeUp"
    extras = "".join(
        text
        for has, text in (
            (info.supports_data_injection, "data-injection, "),
            (info.is_dynamic, "dynamic, "),
            (info.has_additional_info, "has-additional-info, "),
        )
        if has
    )
    yield f"\t{_MODES[info.reporting_mode]} | {slowest} | {fastest} | {fifo} | {wake_up} | {extras}"


def _fusion(service: SensorService) -> Iterator[str]:
    orientation = service.orientation_filter.orientation()
    initialised = orientation is not None and not orientation.status & FilterStatus.INITIALISING
    quaternion = orientation.quaternion if orientation is not None and initialised else (0.0, 0.0, 0.0, 0.0)
    by_type = {sensor.info.type: sensor for sensor in service.all_sensors}
    gyroscope = by_type.get(SensorType.GYROSCOPE)
    period_ns = gyroscope.configured_period_ns if gyroscope is not None else 0
    bias = (0.0, 0.0, 0.0)
    if gyroscope is not None and orientation is not None and initialised:
        bias = _bias(gyroscope, orientation)
    clients = service.fusion_clients if all(kind in by_type for kind in FUSION_INPUTS) else 0
    nothing = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for name, used, q, b in (
        ("9-axis fusion", clients, quaternion, bias),
        ("game fusion(no mag)", _listeners(by_type, SensorType.GAME_ROTATION_VECTOR), *nothing),
        ("geomag fusion (no gyro)", _listeners(by_type, SensorType.GEOMAGNETIC_ROTATION_VECTOR), *nothing),
    ):
        rate_hz = 1e9 / period_ns if used and period_ns else 0.0
        x, y, z, w = q
        yield (
            f"{name} {'enabled' if used else 'disabled'} ({used} clients), gyro-rate={rate_hz:7.2f}Hz, "
            f"q=< {x:g}, {y:g}, {z:g}, {w:g} > ({math.hypot(*q):g}), b=< {b[0]:g}, {b[1]:g}, {b[2]:g} >"
        )


def _listeners(by_type: Mapping[SensorType, ActiveSensor], kind: SensorType) -> int:
    return len(by_type[kind].listeners) if kind in by_type else 0


def _bias(gyroscope: ActiveSensor, orientation: Orientation) -> tuple[float, float, float]:
    """Return what the filter took off the rate it says it stands at (rad/s), zero if that is no longer known."""
    for timestamp_ns, _, values in gyroscope.recent.events():
        if timestamp_ns == orientation.timestamp_ns:
            x, y, z = (value - rate for value, rate in zip(values, orientation.angular_rate, strict=True))
            return x, y, z
    return 0.0, 0.0, 0.0


def _recent(sensor: ActiveSensor, wall_offset_ns: int) -> Iterator[str]:
    events = list(sensor.recent.events())
    if not events:
        return
    yield f"{sensor.info.name}: last {len(events)} events"
    counts = sensor.info.type is SensorType.STEP_COUNTER
    for number, (timestamp_ns, boot_ns, values) in enumerate(events, 1):
        text = "".join(f"{value:.0f}, " if counts else f"{value:.2f}, " for value in values)
        if sensor.info.required_permission:
            text = "[value masked]"
        wall = _clock_time(boot_ns + wall_offset_ns, milliseconds=True)
        yield f"\t{number:2d} (ts={timestamp_ns / 1e9:.9f}, wall={wall}) {text}"


def _connection(connection: SensorEventConnection, traffic: Traffic | None) -> Iterator[str]:
    client = connection.client
    sent, cached = (traffic.events_sent, traffic.events_cached) if traffic else (0, connection.events_cached)
    yield "\tOperating Mode: NORMAL"
    yield (
        f"\t {client.package_name} | WakeLockRefCount 0 | uid {client.uid} | cache size {cached} | "
        f"max cache size {connection.capacity}"
    )
    for handle, registration in connection.registrations.items():
        status = "First flush pending" if registration.first_flush_pending else "active"
        yield (
            f"\t {registration.info.name} 0x{handle:08x} | status: {status} | "
            f"pending flush events {registration.pending_flushes} "
        )
    # As a build of AOSP with DEBUG_CONNECTIONS.
    yield (
        f"\t events recvd: {connection.events_received} | sent {sent} | cache {cached} | "
        f"dropped {connection.events_dropped} | total_acks_needed 0 | total_acks_recvd 0"
    )


def _registration(record: RegistrationRecord, wall_offset_ns: int) -> str:
    client = record.client
    text = (
        f"{_clock_time(record.boot_ns + wall_offset_ns)} {'+' if record.activated else '-'} 0x{record.handle:08x} "
        f"pid={client.pid:5d} uid={client.uid:5d} package={client.package_name}"
    )
    if record.activated:
        text += f" samplingPeriod={record.sampling_period_us}us batchingPeriod={record.max_report_latency_us}us"
    return text


def _clock_time(wall_ns: int, milliseconds: bool = False) -> str:
    seconds, rest_ns = divmod(wall_ns, 1_000_000_000)
    text = time.strftime("%H:%M:%S", time.localtime(seconds))
    return f"{text}.{rest_ns // 1_000_000:03d}" if milliseconds else text
