"""From drained samples to poses: who wants poses, the filter, and the instants they stand on."""

from bisect import bisect_right
from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, replace
from operator import itemgetter

from posed.clock import Clock
from posed.errors import InvalidArgumentError
from posed.events import EventColumn, FilterStatus, FlatEvent, Pose, Position, RateMode, SensorType
from posed.fusion.filter import OrientationFilter
from posed.sensors.alignment import aligned
from posed.sensors.fused_events import FusedEvents, PoseMotion
from posed.sensors.pose_grid import PoseGrid

MIN_POSE_PERIOD_US = 5_000
MAX_POSE_PERIOD_US = 1_000_000

_OCCURRENCES = int(FilterStatus.GAP | FilterStatus.BAD_SAMPLE)


@dataclass(frozen=True, slots=True)
class _PoseRequest:
    pose_period_us: int
    sampling_period_us: int


class PoseFusion:
    """The filter and its poses. All times are sample time, ns."""

    def __init__(
        self,
        orientation_filter: OrientationFilter,
        clock: Clock,
        position: Position | None,
        align: bool,
        declination: Callable[[], float],
    ) -> None:
        self._declination = declination
        self._motion = PoseMotion()
        self._filter = orientation_filter
        self._align = align
        self._clock = clock
        self._position = position
        self._requests: dict[Hashable, _PoseRequest] = {}
        self._grids: dict[int, PoseGrid | None] = {}
        """By pose period; None until the first sample, which anchors those of every filter, has come."""
        self._anchor_ns: int | None = None
        self.rate_mode = RateMode.CUSTOM
        """What the poses say of how fast the sensors run."""
        self._poses: list[Pose] = []
        self.events_fused = 0
        self.cpu_ns = 0

    @property
    def filter_name(self) -> str:
        """Whose poses these are."""
        return self._filter.name

    @property
    def sampling_period_us(self) -> int | None:
        """The fastest sampling period that any request asks for, us; None without any."""
        return min((request.sampling_period_us for request in self._requests.values()), default=None)

    @property
    def awaits_first_sample(self) -> bool:
        """True if poses are wanted and no sample has come yet."""
        return None in self._grids.values()

    def request(self, key: Hashable, pose_period_us: int, sampling_period_us: int, now_ns: int) -> None:
        """Add or replace a request; raises InvalidArgumentError if a period is out of range."""
        if not MIN_POSE_PERIOD_US <= pose_period_us <= MAX_POSE_PERIOD_US:
            raise InvalidArgumentError(
                f"pose period {pose_period_us} us is outside {MIN_POSE_PERIOD_US} to {MAX_POSE_PERIOD_US} us"
                " (200 to 1 Hz)"
            )
        if sampling_period_us < 0:
            raise InvalidArgumentError(f"sampling period {sampling_period_us} us must not be negative")
        self._requests[key] = _PoseRequest(pose_period_us, sampling_period_us)
        self._follow_requests(now_ns)

    def withdraw(self, key: Hashable, now_ns: int) -> None:
        """Undo `request`; an unknown key is left alone."""
        if self._requests.pop(key, None) is not None:
            self._follow_requests(now_ns)

    def next_instants_ns(self) -> list[int]:
        """Return the next instant of each pose period whose grid is known."""
        return [grid.next_ns for grid in self._grids.values() if grid is not None]

    def skip(self, now_ns: int) -> None:
        """Pass over the instants up to `now_ns` without a pose: the samples for them are lost."""
        for grid in self._grids.values():
            if grid is not None:
                grid.skip(now_ns)

    def fuse(
        self, events: list[FlatEvent], until_ns: int, wanted: Collection[SensorType] = (), *, keep_up: bool = False
    ) -> dict[int, EventColumn]:
        """Feed the filter, stopping at every grid instant up to `until_ns` for a pose.

        keep_up: feed it though nobody asks for its poses. Returns the events of the wanted fused sensors by handle, one
        for each accelerometer event.
        """
        if events and self._anchor_ns is None:
            self._anchor_ns = events[0][1]
            self._grids = {period: PoseGrid(period, self._anchor_ns, 0, 0) for period in self._grids}
        if not self._grids and not wanted and not keep_up:
            return {}
        started = self._clock.cpu_ns()
        done = 0
        fused = self._fused_events(wanted) if wanted else None
        for instant_ns, row, grid in self._stops(events, until_ns, fused is not None):
            stop = bisect_right(events, instant_ns, done, key=_time_of)
            self._feed(events[done:stop])
            done = stop
            if grid is not None:
                self._pass_instant(grid)
            elif fused is not None and (orientation := self._filter.orientation()) is not None:
                fused.add(instant_ns, events[row][2:], orientation)
        self._feed(events[done:])
        self.cpu_ns += self._clock.cpu_ns() - started
        return fused.columns() if fused is not None else {}

    def take_poses(self) -> list[Pose]:
        """Remove and return the poses of the grid instants passed since the last call, oldest first."""
        poses, self._poses = self._poses, []
        return poses

    def _follow_requests(self, now_ns: int) -> None:
        periods = {request.pose_period_us for request in self._requests.values()}
        self._grids = {period: self._grids.get(period) or self._grid(period, now_ns) for period in sorted(periods)}

    def _grid(self, period_us: int, now_ns: int) -> PoseGrid | None:
        if self._anchor_ns is None:
            return None
        grid = PoseGrid(period_us, self._anchor_ns, 0, self.events_fused)
        grid.skip(now_ns)
        return grid

    def _stops(
        self, events: list[FlatEvent], until_ns: int, at_accelerometer: bool
    ) -> list[tuple[int, int, PoseGrid | None]]:
        """Return (instant, row, grid) in time order: poses due (with a grid) and accelerometer events (without)."""
        stops: list[tuple[int, int, PoseGrid | None]] = []
        for grid in self._grids.values():
            if grid is not None:
                step_ns = grid.period_us * 1000
                stops += [(instant_ns, -1, grid) for instant_ns in range(grid.next_ns, until_ns + 1, step_ns)]
        if at_accelerometer:
            stops += [(event[1], row, None) for row, event in enumerate(events) if event[0] == SensorType.ACCELEROMETER]
        stops.sort(key=_instant_of)
        return stops

    def _fused_events(self, wanted: Collection[SensorType]) -> FusedEvents:
        # Where true north points is worked out only for those who ask.
        declination = self._declination() if SensorType.HEADING in wanted else 0.0
        return FusedEvents(wanted, declination, self._motion)

    def _feed(self, events: list[FlatEvent]) -> None:
        if events:
            self._filter.update_batch(events)
            self.events_fused += len(events)

    def _pass_instant(self, grid: PoseGrid) -> None:
        orientation = self._filter.orientation()
        if orientation is not None:
            if int(orientation.status) & _OCCURRENCES:
                self._filter.clear_events()
                for each in self._grids.values():
                    if each is not None:
                        each.occurred |= orientation.status & _OCCURRENCES
            if grid.occurred:
                orientation = replace(orientation, status=orientation.status | grid.occurred)
            predicted_ns = 0
            if self._align:
                orientation, predicted_ns = aligned(orientation, grid.next_ns)
            self._poses.append(
                Pose(
                    sequence=grid.next_index,
                    instant_ns=grid.next_ns,
                    period_us=grid.period_us,
                    orientation=orientation,
                    filter_name=self._filter.name,
                    rate_mode=self.rate_mode,
                    events_fused=self.events_fused - grid.events_before,
                    position=self._position,
                    predicted_ns=predicted_ns,
                )
            )
        grid.occurred = FilterStatus.OK
        grid.events_before = self.events_fused
        grid.move_to(grid.next_index + 1)


_instant_of = itemgetter(0)
_time_of = itemgetter(1)
