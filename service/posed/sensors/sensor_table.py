"""Every sensor of the service, and what the source is set to for those who asked."""

from collections.abc import Hashable, Iterable

from posed.clock import Clock
from posed.errors import InvalidArgumentError, PosedError
from posed.events import EventBatch, EventColumn, SensorInfo, SensorType
from posed.fusion.filter import SensorErrors
from posed.sensors.active_sensor import ActiveSensor
from posed.sensors.arbitration import BatchParams, arbitrate, clamp_period_ns
from posed.sensors.device import SensorDevice
from posed.sensors.virtual import (
    FUSED,
    FUSION_INPUTS,
    LEAD,
    Computation,
    VirtualSensor,
    make_computation,
    virtual_sensors,
)


class SensorTable:
    """The source's sensors, the virtual ones computed from them, and the dynamic ones, by handle."""

    def __init__(
        self, device: SensorDevice, clock: Clock, errors: SensorErrors, *, knows_true_north: bool = False
    ) -> None:
        """errors: of the device's parts, for the filters of virtual sensors. knows_true_north: as `virtual_sensors`."""
        self._errors = errors
        self._device = device
        self._clock = clock
        physical = device.sensors
        virtual = virtual_sensors(physical, knows_true_north=knows_true_north)
        self._virtual: dict[int, VirtualSensor] = {each.info.handle: each for each in virtual}
        self._computations: dict[int, Computation] = {}
        """Made when first wanted, and kept: a counter goes on counting."""
        self.listed: tuple[SensorInfo, ...] = (*physical, *(each.info for each in virtual))
        """The static list: the source's, then the virtual ones."""
        self.inputs = {info.handle: info.type for info in physical if info.type in FUSION_INPUTS}
        """Types of the sensors that the filter is fed, by handle."""
        self._by_handle = {info.handle: ActiveSensor(info) for info in physical}
        self._by_handle.update({each.info.handle: ActiveSensor(each.info, self._input(LEAD)) for each in virtual})
        self.fused: frozenset[SensorType] = frozenset()
        """Types of the fused sensors that somebody wants."""
        self.computed: list[tuple[int, Computation]] = []
        """Handles of the other virtual sensors that somebody wants, and what makes their events."""
        self.active: list[ActiveSensor] = []
        """Those that somebody wants, in the order of the list."""
        self.dynamic_changes = 0
        """Counts dynamic sensors that came or went."""

    def __getitem__(self, handle: int) -> ActiveSensor:
        """Return a sensor; raises InvalidArgumentError if there is none of that handle."""
        try:
            return self._by_handle[handle]
        except KeyError:
            known = ", ".join(str(handle) for handle in self._by_handle)
            raise InvalidArgumentError(f"no sensor has handle {handle}; the sensor list has {known}") from None

    @property
    def all(self) -> Iterable[ActiveSensor]:
        """Every sensor, in the order of the list."""
        return self._by_handle.values()

    # Who wants what

    def request(self, sensor: ActiveSensor, key: Hashable, period_ns: int, latency_ns: int | None) -> None:
        """Note what a sensor is asked for under a key, and of its inputs if it is virtual."""
        self._request(sensor, key, BatchParams(period_ns, latency_ns))
        if sensor.is_virtual:
            for kind, input_ns in self._virtual[sensor.info.handle].input_periods_ns(period_ns).items():
                source = self._input(kind)
                clamped_ns = clamp_period_ns(input_ns // 1000, source.info)
                self._request(source, key, BatchParams(clamped_ns, latency_ns if source is sensor.lead else None))

    def withdraw(self, key: Hashable) -> None:
        """Undo every request under a key."""
        for sensor in self._by_handle.values():
            self._withdraw(sensor, key)

    def request_inputs(self, key: Hashable, sampling_period_us: int | None) -> None:
        """Ask the filter's sensors for a rate, whatever the latency; None undoes it."""
        for handle in self.inputs:
            sensor = self._by_handle[handle]
            if sampling_period_us is None:
                self._withdraw(sensor, key)
            else:
                period_ns = clamp_period_ns(sampling_period_us, sensor.info)
                self._request(sensor, key, BatchParams(period_ns, None))

    # What comes

    def connect(self, batch: EventBatch) -> None:
        """Take in the dynamic sensors that came with a batch, before its events."""
        self._by_handle.update({info.handle: ActiveSensor(info) for info in batch.connected})
        self.dynamic_changes += len(batch.connected)

    def take_over_periods(self) -> None:
        """Note what a source that has returned made of the periods it was asked for."""
        for handle, period_ns in self._device.reconfigured.items():
            sensor = self._by_handle[handle]
            sensor.follow(sensor.params, period_ns)
        self._device.reconfigured.clear()

    def disconnect(self, handle: int) -> ActiveSensor:
        """Remove a dynamic sensor that went, and return what it was."""
        gone = self._by_handle.pop(handle)
        self._follow_requests()
        self.dynamic_changes += 1
        return gone

    def take_in(self, columns: Iterable[tuple[int, EventColumn]]) -> None:
        """Hold events, by handle, for those who listen; those of a sensor that has gone are nobody's."""
        boot_ns = self._clock.now_ns()
        for handle, column in columns:
            sensor = self._by_handle.get(handle)
            if sensor is not None:
                sensor.take_in(column, boot_ns)

    # Private

    def _input(self, kind: SensorType) -> ActiveSensor:
        return next(self._by_handle[handle] for handle, type_ in self.inputs.items() if type_ is kind)

    def _request(self, sensor: ActiveSensor, key: Hashable, params: BatchParams) -> None:
        if sensor.requests.get(key) != params:
            before = sensor.requests.get(key)
            sensor.requests[key] = params
            try:
                self._configure(sensor)
            except PosedError:
                if before is None:
                    del sensor.requests[key]
                else:
                    sensor.requests[key] = before
                raise

    def _withdraw(self, sensor: ActiveSensor, key: Hashable) -> None:
        if sensor.requests.pop(key, None) is not None:
            self._configure(sensor)

    def _configure(self, sensor: ActiveSensor) -> None:
        """Hand the source what the requests come to, only if it changed."""
        params = arbitrate(sensor.requests.values())
        if params == sensor.params:
            return
        configured_ns = 0 if sensor.is_virtual else self._device.configure(sensor.info.handle, params)
        sensor.follow(params, configured_ns)
        self._follow_requests()
        if params is None:
            sensor.discard()
            sensor.flushing.clear()
        else:
            now_ns = self._device.time_map.to_sample(self._clock.now_ns())
            release_ns = now_ns + (sensor.latency_ns or 0)
            sensor.release_ns = min(sensor.release_ns, release_ns) if sensor.pending else release_ns

    def _follow_requests(self) -> None:
        self.active = [each for each in self._by_handle.values() if each.requests]
        virtual = [each.info for each in self.active if each.is_virtual]
        self.fused = frozenset(info.type for info in virtual if info.type in FUSED)
        running = {handle for handle, _ in self.computed}
        self.computed = [(info.handle, self._computation(info)) for info in virtual if info.type not in FUSED]
        for handle, computation in self.computed:
            if handle not in running:
                computation.restart()

    def _computation(self, info: SensorInfo) -> Computation:
        if info.handle not in self._computations:
            self._computations[info.handle] = make_computation(info.type, self._errors)
        return self._computations[info.handle]
