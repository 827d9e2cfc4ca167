"""The sensor service: registrations in, events and poses out, one drain of the source at a time."""

from collections import deque
from collections.abc import Hashable
from dataclasses import dataclass, field

from posed.clock import Clock
from posed.errors import InvalidArgumentError, InvalidStateError
from posed.events import EventColumn, Pose, Position, SensorInfo, SensorType
from posed.fusion.filter import OrientationFilter
from posed.hal.source import SensorSource
from posed.sensors.arbitration import BatchParams, arbitrate, clamp_period_ns
from posed.sensors.connection import MAX_FLUSH_COMPLETES, SensorEventConnection
from posed.sensors.pose_fusion import PoseFusion
from posed.sensors.virtual import FUSION_INPUTS, input_periods_ns, virtual_sensors

# SensorService.h: what a connection keeps where no sensor has a hardware FIFO.
_MIN_CONNECTION_CAPACITY = 984
# A service this far behind (sample time) was suspended or stopped: to make up for hours would block it for minutes.
_LONGEST_LAG_NS = 5_000_000_000


@dataclass(slots=True)
class ActiveSensor:
    """A sensor's registrations and what they come to."""

    info: SensorInfo
    is_virtual: bool
    requests: dict[Hashable, BatchParams] = field(default_factory=dict)
    params: BatchParams | None = None
    configured_period_ns: int = 0
    listeners: list[SensorEventConnection] = field(default_factory=list)
    events: int = 0
    pending: list[EventColumn] = field(default_factory=list)
    pending_events: int = 0
    release_ns: int = 0
    """Sample time at which pending events must go out."""

    @property
    def latency_ns(self) -> int | None:
        """Report latency in force: 0 streams, None if nobody listens."""
        if self.params is None or self.params.max_report_latency_ns is None:
            return None
        fifo_ns = self.info.fifo_max_event_count * self.params.sampling_period_ns
        latency = min(self.params.max_report_latency_ns, fifo_ns)
        return latency if latency > self.params.sampling_period_ns else 0


class SensorService:
    """Android's SensorService over one source and one filter; the caller moves it on with `advance`.

    Not thread-safe: one loop owns it.
    """

    def __init__(
        self,
        source: SensorSource,
        orientation_filter: OrientationFilter,
        clock: Clock,
        position: Position | None = None,
        *,
        aligned: bool = False,
    ) -> None:
        """Fuse with this filter; `aligned` turns each pose on to its grid instant by the newest angular rate."""
        self._source = source
        self._clock = clock
        self._fusion = PoseFusion(orientation_filter, clock, position, aligned)
        physical = source.sensors
        virtual = virtual_sensors(physical)
        self.sensors: tuple[SensorInfo, ...] = (*physical, *virtual)
        self._table = {s.handle: ActiveSensor(s, s in virtual) for s in self.sensors}
        self._active: list[ActiveSensor] = []
        self._inputs = {s.handle: s.type for s in physical if s.type in FUSION_INPUTS}
        self._waiting_flush: dict[int, deque[SensorEventConnection]] = {}
        self._now_ns = 0
        self._due_ns: int | None = None
        self.source_cpu_ns = 0

    # Registrations

    def connect(self) -> SensorEventConnection:
        """Return a new listener's connection; it gets nothing until sensors are enabled for it."""
        return SensorEventConnection(
            max(_MIN_CONNECTION_CAPACITY, sum(sensor.fifo_max_event_count for sensor in self.sensors))
        )

    def enable(
        self, connection: SensorEventConnection, handle: int, sampling_period_us: int, max_report_latency_us: int
    ) -> None:
        """Register a connection for a sensor, from the present instant on.

        sampling_period_us: us, 0 = fastest. max_report_latency_us: us, 0 = each event as it happens.
        Raises InvalidArgumentError for an unknown handle, a negative period or latency, or a sensor it already has.
        """
        sensor = self._sensor(handle)
        if sampling_period_us < 0 or max_report_latency_us < 0:
            raise InvalidArgumentError(
                f"sampling period {sampling_period_us} us and latency {max_report_latency_us} us must not be negative"
            )
        if connection in sensor.listeners:
            raise InvalidArgumentError(
                f"this listener already has sensor {handle} ({sensor.info.name}); unregister it to change its rate"
            )
        self.advance()
        # What was sampled for others before now must not reach the newcomer.
        self._release(sensor)
        sensor.listeners.append(connection)
        key = (connection, handle)
        period_ns = clamp_period_ns(sampling_period_us, sensor.info)
        latency_ns = max_report_latency_us * 1000
        self._request(sensor, key, BatchParams(period_ns, latency_ns))
        if sensor.is_virtual:
            for kind, input_ns in input_periods_ns(period_ns).items():
                leads = kind is SensorType.ACCELEROMETER
                source = self._input(kind)
                clamped_ns = clamp_period_ns(input_ns // 1000, source.info)
                self._request(source, key, BatchParams(clamped_ns, latency_ns if leads else None))

    def disable(self, connection: SensorEventConnection, handle: int) -> None:
        """Undo `enable`; a sensor the connection does not have is left alone."""
        sensor = self._sensor(handle)
        if connection not in sensor.listeners:
            return
        self.advance()
        sensor.listeners.remove(connection)
        for affected in self._table.values():
            self._withdraw(affected, (connection, handle))

    def disconnect(self, connection: SensorEventConnection) -> None:
        """Undo every `enable` of a connection."""
        for handle in self._handles_of(connection):
            self.disable(connection, handle)

    def is_registered(self, connection: SensorEventConnection) -> bool:
        """Return whether the connection has any sensor."""
        return bool(self._handles_of(connection))

    def flush(self, connection: SensorEventConnection) -> None:
        """Send the connection one flush-complete for each of its sensors, behind every event up to now.

        Raises InvalidStateError if it has no sensor, or too many flush-completes already wait to be read.
        """
        handles = self._handles_of(connection)
        if not handles:
            raise InvalidStateError("this listener has no sensor registered, so there is nothing to flush")
        if connection.flush_completes + len(handles) > MAX_FLUSH_COMPLETES:
            raise InvalidStateError(
                f"{connection.flush_completes} flush-completes already wait for this listener (at most"
                f" {MAX_FLUSH_COMPLETES}); read them before asking for more"
            )
        virtual = [handle for handle in handles if self._table[handle].is_virtual]
        for handle in handles:
            if handle not in virtual:
                self._source.flush(handle)
                self._waiting_flush.setdefault(handle, deque()).append(connection)
        self.advance()
        for handle in virtual:
            self._release(self._table[handle])
            connection.append_flush_complete(handle)

    def register_pose(self, key: Hashable, pose_period_us: int, sampling_period_us: int) -> None:
        """Ask for poses every `pose_period_us` from sensors at `sampling_period_us` (0 = fastest), or change that.

        Raises InvalidArgumentError if the source cannot carry a pose or a period is out of range.
        """
        if len(self._inputs) < len(FUSION_INPUTS):
            missing = ", ".join(kind.string_type for kind in FUSION_INPUTS if kind not in self._inputs.values())
            raise InvalidArgumentError(f"no pose from this source: it has no {missing}")
        self.advance()
        self._fusion.request(key, pose_period_us, sampling_period_us, self._sample_now_ns())
        self._follow_pose_requests()

    def unregister_pose(self, key: Hashable) -> None:
        """Undo `register_pose`; an unknown key is left alone."""
        self.advance()
        self._fusion.withdraw(key, self._sample_now_ns())
        self._follow_pose_requests()

    @property
    def pose_sampling_period_us(self) -> int | None:
        """The fastest sampling period that any pose registration asks for, us; None without any."""
        return self._fusion.sampling_period_us

    @property
    def events_fused(self) -> int:
        """Events that have reached the filter."""
        return self._fusion.events_fused

    @property
    def filter_cpu_ns(self) -> int:
        """CPU time spent in the filter."""
        return self._fusion.cpu_ns

    @property
    def ended(self) -> bool:
        """True if the source has given its last sample."""
        return self._source.end_ns is not None and self._now_ns >= self._source.end_ns

    @property
    def active_sensors(self) -> tuple[ActiveSensor, ...]:
        """The sensors that somebody has registered."""
        return tuple(self._active)

    # Moving on

    def next_deadline_ns(self) -> int | None:
        """Return the CLOCK_BOOTTIME instant (ns) by which `advance` must run next, None if nothing is due."""
        end_ns = self._source.end_ns
        due = [t for t in self._fusion.next_instants_ns() if end_ns is None or t <= end_ns]
        if self._fusion.awaits_first_sample:
            due += [t for t in map(self._source.next_sample_ns, self._inputs) if t is not None]
        for sensor in self._active:
            latency_ns = sensor.latency_ns
            if latency_ns is None:
                continue
            if latency_ns:
                due += [sensor.release_ns] if sensor.pending or not self.ended else []
            elif not sensor.is_virtual:
                next_ns = self._source.next_sample_ns(sensor.info.handle)
                if next_ns is not None:
                    due.append(next_ns)
        self._due_ns = min(due, default=None)
        return None if self._due_ns is None else self._source.time_map.to_boot(self._due_ns)

    def advance(self) -> None:
        """Bring everything up to the clock: drain the source, fuse, fill the connections and the poses."""
        if not self._active:
            return
        now_ns = self._sample_now_ns()
        if self._due_ns is not None and now_ns - self._due_ns > _LONGEST_LAG_NS:
            self._advance_to(self._due_ns)
            self._source.resume()
            now_ns = self._sample_now_ns()
            self._fusion.skip(now_ns)
        self._due_ns = None
        self._advance_to(now_ns)

    def take_poses(self) -> list[Pose]:
        """Remove and return the poses of the grid instants passed since the last call, oldest first."""
        return self._fusion.take_poses()

    # Private

    def _advance_to(self, now_ns: int) -> None:
        self._now_ns = now_ns
        started = self._clock.cpu_ns()
        batch = self._source.drain(now_ns)
        self.source_cpu_ns += self._clock.cpu_ns() - started
        # A recording that has ended moves no pose on: its last sample is the last thing known.
        until_ns = now_ns if self._source.end_ns is None else min(now_ns, self._source.end_ns)
        wants_virtual = any(sensor.is_virtual for sensor in self._active)
        virtual = self._fusion.fuse(batch.flat(self._inputs), until_ns, wants_virtual)
        for handle, column in (*batch.columns.items(), *virtual.items()):
            sensor = self._table[handle]
            sensor.events += len(column)
            if sensor.listeners and len(column):
                sensor.pending.append(column)
                sensor.pending_events += len(column)
        self._release_due()
        for handle in batch.flush_completes:
            self._release(self._table[handle])
        for handle in batch.flush_completes:
            self._waiting_flush[handle].popleft().append_flush_complete(handle)

    def _sample_now_ns(self) -> int:
        return self._source.time_map.to_sample(self._clock.now_ns())

    def _sensor(self, handle: int) -> ActiveSensor:
        try:
            return self._table[handle]
        except KeyError:
            known = ", ".join(str(handle) for handle in self._table)
            raise InvalidArgumentError(f"no sensor has handle {handle}; the sensor list has {known}") from None

    def _input(self, kind: SensorType) -> ActiveSensor:
        return next(self._table[handle] for handle, type_ in self._inputs.items() if type_ is kind)

    def _handles_of(self, connection: SensorEventConnection) -> list[int]:
        return [handle for handle, sensor in self._table.items() if connection in sensor.listeners]

    def _request(self, sensor: ActiveSensor, key: Hashable, params: BatchParams) -> None:
        if sensor.requests.get(key) != params:
            sensor.requests[key] = params
            self._configure(sensor)

    def _withdraw(self, sensor: ActiveSensor, key: Hashable) -> None:
        if sensor.requests.pop(key, None) is not None:
            self._configure(sensor)

    def _configure(self, sensor: ActiveSensor) -> None:
        """Hand the source what the registrations come to, only if it changed."""
        before, sensor.params = sensor.params, arbitrate(sensor.requests.values())
        if sensor.params == before:
            return
        self._active = [each for each in self._table.values() if each.requests]
        handle = sensor.info.handle
        if not sensor.is_virtual:
            if sensor.params is None:
                self._source.activate(handle, False)
            else:
                period_ns, latency_ns = sensor.params.sampling_period_ns, sensor.params.max_report_latency_ns or 0
                sensor.configured_period_ns = self._source.batch(handle, period_ns, latency_ns)
                if before is None:
                    self._source.activate(handle, True)
        if sensor.params is None:
            sensor.pending.clear()
            sensor.pending_events = 0
        else:
            release_ns = self._sample_now_ns() + (sensor.latency_ns or 0)
            sensor.release_ns = min(sensor.release_ns, release_ns) if sensor.pending else release_ns

    def _follow_pose_requests(self) -> None:
        sampling_us = self._fusion.sampling_period_us
        for handle in self._inputs:
            sensor = self._table[handle]
            if sampling_us is None:
                self._withdraw(sensor, _POSE)
            else:
                self._request(sensor, _POSE, BatchParams(clamp_period_ns(sampling_us, sensor.info), None))

    def _release_due(self) -> None:
        """Let go what streams; once one batched sensor is due or full, let all batched ones go, as one FIFO does."""
        batched = []
        for sensor in self._active:
            if sensor.latency_ns == 0:
                self._release(sensor)
            elif sensor.latency_ns:
                batched.append(sensor)
        if self.ended or any(
            s.release_ns <= self._now_ns or s.pending_events >= s.info.fifo_max_event_count for s in batched
        ):
            for sensor in batched:
                self._release(sensor)
                sensor.release_ns = self._now_ns + (sensor.latency_ns or 0)

    def _release(self, sensor: ActiveSensor) -> None:
        if sensor.pending:
            column = EventColumn.concatenate(sensor.pending)
            for connection in sensor.listeners:
                connection.append(sensor.info.handle, column)
            sensor.pending.clear()
            sensor.pending_events = 0


_POSE = "pose"
