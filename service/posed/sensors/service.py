"""The sensor service: registrations in, events and poses out, one drain of the source at a time."""

from collections.abc import Callable, Hashable, Sequence

from posed.clock import Clock
from posed.errors import InvalidArgumentError, InvalidStateError, PosedError
from posed.events import Pose, Position, RateMode, ReportingMode, SensorInfo, SensorType
from posed.fusion.filter import OrientationFilter, SensorErrors
from posed.hal.source import SensorSource
from posed.sensors.active_sensor import ActiveSensor
from posed.sensors.arbitration import clamp_period_ns
from posed.sensors.client import CAPPED_SAMPLING_PERIOD_US, Client
from posed.sensors.connection import MAX_FLUSH_COMPLETES, SensorEventConnection, SensorRegistration
from posed.sensors.decimation import Decimator
from posed.sensors.device import SensorDevice
from posed.sensors.pose_fusion import PoseFusion
from posed.sensors.registration_log import RegistrationLog, RegistrationRecord
from posed.sensors.sensor_table import SensorTable
from posed.sensors.virtual import FUSED, FUSION_INPUTS

# A service this far behind (sample time) was suspended or stopped: to make up for hours would block it for minutes.
_LONGEST_LAG_NS = 5_000_000_000


class SensorService:
    """Android's SensorService over one source and its filters; the caller moves it on with `advance`.

    Not thread-safe: one loop owns it.
    """

    def __init__(
        self,
        source: SensorSource,
        orientation_filter: OrientationFilter,
        clock: Clock,
        position: Position | None = None,
        *,
        beside: Sequence[OrientationFilter] = (),
        aligned: bool = False,
        declination: Callable[[], float] | None = None,
        errors: SensorErrors | None = None,
    ) -> None:
        """Fuse with this filter, which the fused sensors follow.

        beside: filters with other names that give poses from the same events, to those who ask for theirs.
        aligned: turn each pose on to its grid instant by the newest angular rate. declination: returns that of
        the place, rad, east positive; without it there is no heading sensor. errors: of the device's parts, for
        the filters of virtual sensors.
        """
        self._clock = clock
        self._device = SensorDevice(source, clock)
        self.orientation_filter = orientation_filter
        self._fusions = [
            PoseFusion(each, clock, position, aligned, declination or (lambda: 0.0))
            for each in (orientation_filter, *beside)
        ]
        """The service's own first: of these only it makes the events of the fused sensors."""
        self._fusion = self._fusions[0]
        self._table = SensorTable(
            self._device, clock, errors or SensorErrors(), knows_true_north=declination is not None
        )
        self._connections: dict[SensorEventConnection, None] = {}
        self.registrations = RegistrationLog()
        self._now_ns = 0
        self._due_ns: int | None = None

    # Registrations

    def connect(self, client: Client | None = None) -> SensorEventConnection:
        """Return a new listener's connection; it gets nothing until sensors are enabled for it."""
        return SensorEventConnection(client)

    def enable(
        self,
        connection: SensorEventConnection,
        handle: int,
        sampling_period_us: int,
        max_report_latency_us: int,
        decimate: bool = False,
    ) -> None:
        """Register a connection for a sensor, from the present instant on (SensorService::enable).

        sampling_period_us: us, 0 = fastest; what the connection's client may ask is the least. max_report_latency_us:
        us, 0 = each event as it happens. decimate: have no more than that period of a continuous sensor delivered,
        whatever others ask; Android has no such thing.
        Raises InvalidArgumentError for an unknown handle, a negative period or latency, a sensor it already has or may
        not use, and what the source raises, without a trace left.
        """
        sensor = self._table[handle]
        if sampling_period_us < 0 or max_report_latency_us < 0:
            raise InvalidArgumentError(
                f"sampling period {sampling_period_us} us and latency {max_report_latency_us} us must not be negative"
            )
        if not connection.client.may_use(sensor.info):
            raise InvalidArgumentError(
                f"{connection.client.package_name} lacks {sensor.info.required_permission}, which {sensor.info.name}"
                " needs; name it among the permissions of its Package"
            )
        if connection in sensor.listeners:
            raise InvalidArgumentError(
                f"this listener already has sensor {handle} ({sensor.info.name}); unregister it to change its rate"
            )
        if connection.client.is_rate_capped(sensor.info):
            sampling_period_us = max(sampling_period_us, CAPPED_SAMPLING_PERIOD_US)
        self.advance()
        period_ns = clamp_period_ns(sampling_period_us, sensor.info)
        registration = SensorRegistration(sensor.info)
        if decimate and sensor.info.reporting_mode is ReportingMode.CONTINUOUS:
            registration.decimator = Decimator(period_ns)
        self._join(sensor, connection, registration)
        try:
            self._table.request(sensor, (connection, handle), period_ns, max_report_latency_us * 1000)
        except PosedError:
            self._leave(sensor, connection)
            raise
        if registration.first_flush_pending:
            self._device.flush(handle)
            sensor.flushing.append(connection)
            self.advance()
        self._connections[connection] = None
        self.registrations.add(
            RegistrationRecord(
                self._clock.now_ns(), True, handle, connection.client, period_ns // 1000, max_report_latency_us
            )
        )

    def disable(self, connection: SensorEventConnection, handle: int) -> None:
        """Undo `enable`; a sensor the connection does not have is left alone."""
        if handle in connection.registrations:
            self.advance()
            self._leave(self._table[handle], connection)
            self._note_end(connection, handle)

    def disconnect(self, connection: SensorEventConnection) -> None:
        """Undo every `enable` of a connection."""
        for handle in list(connection.registrations):
            self.disable(connection, handle)

    @property
    def connections(self) -> tuple[SensorEventConnection, ...]:
        """Those that have a sensor, in the order in which they first had one."""
        return tuple(self._connections)

    def flush(self, connection: SensorEventConnection) -> None:
        """Send the connection one flush-complete for each of its sensors, behind every event up to now.

        Raises InvalidStateError if it has no sensor, if too many flush-completes already wait to be read, or if one of
        the sensors cannot be flushed, as a one-shot sensor: the others are flushed all the same.
        """
        handles = list(connection.registrations)
        if not handles:
            raise InvalidStateError("this listener has no sensor registered, so there is nothing to flush")
        if connection.flush_completes + len(handles) > MAX_FLUSH_COMPLETES:
            raise InvalidStateError(
                f"{connection.flush_completes} flush-completes already wait for this listener (at most"
                f" {MAX_FLUSH_COMPLETES}); read them before asking for more"
            )
        refused: list[str] = []
        virtual: list[ActiveSensor] = []
        for handle in handles:
            sensor = self._table[handle]
            if sensor.is_one_shot:
                refused.append(f"{sensor.info.name} is a one-shot sensor, which has nothing to flush")
            elif sensor.is_virtual:
                virtual.append(sensor)
            else:
                try:
                    self._device.flush(handle)
                except PosedError as error:
                    refused.append(str(error))
                    continue
                sensor.flushing.append(connection)
                connection.registrations[handle].pending_flushes += 1
        self.advance()
        for sensor in virtual:
            self._release(sensor)
            connection.append_flush_complete(sensor.info.handle)
        if refused:
            raise InvalidStateError("; ".join(refused))

    def register_pose(
        self, key: Hashable, pose_period_us: int, sampling_period_us: int, filter_name: str | None = None
    ) -> None:
        """Ask for poses every `pose_period_us` from sensors at `sampling_period_us` (0 = fastest), or change that.

        filter_name: one of `filter_names`; None is the first. Raises InvalidArgumentError if the source cannot carry a
        pose, a period is out of range or no such filter runs, and what the source raises, of which no request remains.
        """
        names = self.filter_names
        if filter_name is not None and filter_name not in names:
            raise InvalidArgumentError(
                f"filter {filter_name!r} does not run here, only {', '.join(names)}; name it too in the --filter that"
                " the daemon starts with"
            )
        if len(self._table.inputs) < len(FUSION_INPUTS):
            missing = ", ".join(kind.string_type for kind in FUSION_INPUTS if kind not in self._table.inputs.values())
            raise InvalidArgumentError(f"no pose from this source: it has no {missing}")
        self.advance()
        chosen = self._fusions[names.index(filter_name) if filter_name else 0]
        chosen.request(key, pose_period_us, sampling_period_us, self._sample_now_ns())
        for fusion in self._fusions:
            if fusion is not chosen:
                fusion.withdraw(key, self._sample_now_ns())
        try:
            self._follow_pose_requests()
        except PosedError:
            self.unregister_pose(key)
            raise

    def unregister_pose(self, key: Hashable) -> None:
        """Undo `register_pose`; an unknown key is left alone."""
        self.advance()
        for fusion in self._fusions:
            fusion.withdraw(key, self._sample_now_ns())
        self._follow_pose_requests()

    def set_environment(self, kind: SensorType, value: float) -> None:
        """Set what an ambient sensor of the source reads from now on, in its unit.

        Raises InvalidArgumentError where that is not for anyone to set, or for a value that the sensor cannot read.
        """
        self.advance()
        self._device.set_environment(kind, value)

    @property
    def pose_sampling_period_us(self) -> int | None:
        """The fastest sampling period that any pose registration asks for, us; None without any."""
        periods = (fusion.sampling_period_us for fusion in self._fusions)
        return min((period for period in periods if period is not None), default=None)

    @property
    def filter_names(self) -> tuple[str, ...]:
        """The filters, the one that the fused sensors follow first."""
        return tuple(fusion.filter_name for fusion in self._fusions)

    @property
    def fusion_clients(self) -> int:
        """How many want what the first filter says: its pose, and every listener of a fused sensor."""
        listeners = sum(len(sensor.listeners) for sensor in self._table.all if sensor.info.type in FUSED)
        return listeners + (self._fusion.sampling_period_us is not None)

    @property
    def fusion_wanted(self) -> bool:
        """True if somebody wants what a filter says."""
        return bool(self._table.fused) or self.pose_sampling_period_us is not None

    @property
    def events_fused(self) -> int:
        """Events that have reached a filter, the one that has got most."""
        return max(fusion.events_fused for fusion in self._fusions)

    @property
    def filter_cpu_ns(self) -> int:
        """CPU time spent in the filters."""
        return sum(fusion.cpu_ns for fusion in self._fusions)

    @property
    def source_cpu_ns(self) -> int:
        """CPU time spent in the source."""
        return self._device.cpu_ns

    @property
    def ended(self) -> bool:
        """True if the source has given its last sample."""
        return self._device.end_ns is not None and self._now_ns >= self._device.end_ns

    @property
    def sensors(self) -> tuple[SensorInfo, ...]:
        """The static list: the source's, then the virtual ones."""
        return self._table.listed

    @property
    def dynamic_changes(self) -> int:
        """Counts dynamic sensors that came or went."""
        return self._table.dynamic_changes

    @property
    def dynamic_sensors(self) -> tuple[SensorInfo, ...]:
        """The sensors that came while the source ran and are still there."""
        return tuple(sensor.info for sensor in self._table.all if sensor.info.is_dynamic)

    @property
    def all_sensors(self) -> tuple[ActiveSensor, ...]:
        """Every sensor, in the order of the list."""
        return tuple(self._table.all)

    @property
    def active_sensors(self) -> tuple[ActiveSensor, ...]:
        """The sensors that somebody has registered."""
        return tuple(self._table.active)

    # Moving on

    def next_deadline_ns(self) -> int | None:
        """Return the CLOCK_BOOTTIME instant (ns) by which `advance` must run next, None if nothing is due."""
        device = self._device
        end_ns = device.end_ns
        due: list[int] = []
        for fusion in self._fusions:
            instants = fusion.next_instants_ns()
            due += instants if end_ns is None else [t for t in instants if t <= end_ns]
            if fusion.awaits_first_sample:
                due += [t for t in map(device.next_sample_ns, self._table.inputs) if t is not None]
        for sensor in self._table.active if self._connections else ():
            latency_ns = sensor.latency_ns
            if latency_ns is None:
                continue
            if latency_ns:
                due += [sensor.release_ns] if sensor.pending or not self.ended else []
            elif not sensor.is_virtual:
                next_ns = device.next_sample_ns(sensor.info.handle)
                if next_ns is not None:
                    due.append(next_ns)
        self._due_ns = min(due, default=None)
        deadline_ns = None if self._due_ns is None else device.time_map.to_boot(self._due_ns)
        if device.retry_ns is not None and self._table.active:
            return device.retry_ns if deadline_ns is None else min(deadline_ns, device.retry_ns)
        return deadline_ns

    def advance(self) -> None:
        """Bring everything up to the clock: drain the source, fuse, fill the connections and the poses."""
        if not self._table.active:
            return
        now_ns = self._sample_now_ns()
        if self._due_ns is not None and now_ns - self._due_ns > _LONGEST_LAG_NS:
            self._advance_to(self._due_ns)
            self._device.resume()
            now_ns = self._sample_now_ns()
            for fusion in self._fusions:
                fusion.skip(now_ns)
        self._due_ns = None
        self._advance_to(now_ns)

    def take_poses(self) -> list[Pose]:
        """Remove and return the poses of the grid instants passed since the last call, a filter's oldest first."""
        poses = self._fusion.take_poses()
        for fusion in self._fusions[1:]:
            poses += fusion.take_poses()
        return poses

    # Private

    def _advance_to(self, now_ns: int) -> None:
        self._now_ns = now_ns
        batch = self._device.drain(now_ns)
        if batch.connected:
            self._table.connect(batch)
        if self._device.reconfigured:
            self._table.take_over_periods()
        # A recording that has ended moves no pose on: its last sample is the last thing known.
        end_ns = self._device.end_ns
        until_ns = now_ns if end_ns is None else min(now_ns, end_ns)
        events = batch.flat(self._table.inputs)
        # Who asks for another filter's poses later finds it as old as the first.
        keep_up = len(self._fusions) > 1 and self.fusion_wanted
        virtual = self._fusion.fuse(events, until_ns, self._table.fused, keep_up=keep_up)
        for fusion in self._fusions[1:]:
            fusion.fuse(events, until_ns, keep_up=keep_up)
        for handle, computation in self._table.computed:
            column = computation.take(events)
            if column is not None:
                virtual[handle] = column
        self._table.take_in((*batch.columns.items(), *virtual.items()))
        if self._connections:
            self._release_due()
        for handle in batch.flush_completes:
            self._release(self._table[handle])
        for handle in batch.flush_completes:
            self._table[handle].flushing.popleft().complete_flush(handle)
        for handle in batch.disconnected:
            for connection in self._table.disconnect(handle).listeners:
                self._forget(connection, handle)
                self._note_end(connection, handle)

    def _sample_now_ns(self) -> int:
        return self._device.time_map.to_sample(self._clock.now_ns())

    def _follow_pose_requests(self) -> None:
        """Have the sensors run as fast as the fastest pose request, whichever filter it is for."""
        period_us = self.pose_sampling_period_us
        self._table.request_inputs(_POSE, period_us)
        if period_us is not None:
            for fusion in self._fusions:
                fusion.rate_mode = RateMode.of_period(period_us)

    def _join(self, sensor: ActiveSensor, connection: SensorEventConnection, registration: SensorRegistration) -> None:
        """Add a listener, who is not to see what was sampled for others before now."""
        mode = sensor.info.reporting_mode
        connection.add(registration)
        if not sensor.listeners:
            sensor.recent.set_last_event_stale()
        elif mode is ReportingMode.CONTINUOUS and not sensor.is_virtual:
            registration.first_flush_pending = True
        else:
            self._release(sensor)
            last = sensor.recent.last_if_current
            if mode is ReportingMode.ON_CHANGE and last is not None:
                connection.append(sensor.info.handle, last)
        sensor.listeners.append(connection)

    def _leave(self, sensor: ActiveSensor, connection: SensorEventConnection) -> None:
        """Take a listener's sensor from it."""
        handle = sensor.info.handle
        sensor.listeners.remove(connection)
        self._table.withdraw((connection, handle))
        self._forget(connection, handle)

    def _forget(self, connection: SensorEventConnection, handle: int) -> None:
        connection.remove(handle)
        if not connection.registrations:
            self._connections.pop(connection, None)

    def _note_end(self, connection: SensorEventConnection, handle: int) -> None:
        self.registrations.add(RegistrationRecord(self._clock.now_ns(), False, handle, connection.client))

    def _release_due(self) -> None:
        """Let go what streams; once one batched sensor is due or full, let all batched ones go, as one FIFO does."""
        batched = []
        for sensor in self._table.active:
            if sensor.latency_ns == 0:
                self._release(sensor)
            elif sensor.latency_ns:
                batched.append(sensor)
        if not batched:
            return
        if self.ended or any(
            s.release_ns <= self._now_ns or s.pending_events >= s.info.fifo_max_event_count for s in batched
        ):
            for sensor in batched:
                self._release(sensor)
                sensor.release_ns = self._now_ns + (sensor.latency_ns or 0)

    def _release(self, sensor: ActiveSensor) -> None:
        if sensor.release() and sensor.is_one_shot:
            for connection in list(sensor.listeners):
                self._leave(sensor, connection)
                self._note_end(connection, sensor.info.handle)


_POSE = "pose"
