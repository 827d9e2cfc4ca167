"""A simulated phone put through a motion script, faster than real time: its raw samples, its poses, its truth."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from posed.clock import VirtualClock
from posed.events import EventColumn, Float64Array, Int64Array, Pose, RateMode, SensorType
from posed.fusion.filter import OrientationFilter
from posed.hal.motion import MotionScript, make_script
from posed.hal.profile import load_profile
from posed.hal.simulated import SimulatedPhone
from posed.sensors import SensorService


@dataclass(frozen=True)
class Simulation:
    """What came out of one script from `begin_ns` on."""

    poses: list[Pose]
    accelerometer: EventColumn
    magnetometer: EventColumn
    source: SimulatedPhone

    @property
    def quaternions(self) -> Float64Array:
        """Fused orientations, float64[n, 4], device to world, magnetic north."""
        return np.array([pose.orientation.quaternion for pose in self.poses])

    @property
    def instants_ns(self) -> Int64Array:
        """The grid instants of the poses."""
        return np.array([pose.instant_ns for pose in self.poses])

    def truth(self, times_ns: Int64Array) -> Float64Array:
        """Return the true orientations, float64[n, 4], device to world, true north."""
        truths = [self.source.truth(int(t)) for t in times_ns]
        return np.array([truth.quaternion for truth in truths if truth is not None])

    @property
    def declination(self) -> float:
        """Rad, east positive."""
        truth = self.source.truth(int(self.instants_ns[0]))
        return truth.declination if truth is not None else 0.0


def simulate(
    script: str | MotionScript,
    seconds: float,
    make_filter: Callable[[], OrientationFilter],
    mode: RateMode = RateMode.FASTEST,
    *,
    warm_up_s: float,
    seed: int = 0,
) -> Simulation:
    """Put the simulated tablet of the paper through a script and fuse it; the warm-up is left out of what is kept."""
    clock = VirtualClock(1_000_000_000)
    motion = make_script(script, seed) if isinstance(script, str) else script
    source = SimulatedPhone(load_profile("patonis2018"), clock, motion, seed)
    service = SensorService(source, make_filter(), clock)
    listener = service.connect()
    service.register_pose("benchmark", 100_000, mode.sampling_period_us)
    for kind in (SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD):
        service.enable(listener, int(kind), mode.sampling_period_us, 0)
    columns: dict[int, list[EventColumn]] = {}
    poses = []
    start_ns = clock.now_ns()
    for second in range(1, int(warm_up_s + seconds) + 1):
        clock.advance_to(start_ns + second * 1_000_000_000)
        service.advance()
        while listener:
            for handle, column in listener.take(10_000).columns.items():
                columns.setdefault(handle, []).append(column)
        poses += service.take_poses()
    begin_ns = start_ns + int(warm_up_s * 1e9)

    def late(kind: SensorType) -> EventColumn:
        column = EventColumn.concatenate(columns[int(kind)])
        return column[slice(int(np.searchsorted(column.timestamp_ns, begin_ns)), None)]

    return Simulation(
        [pose for pose in poses if pose.instant_ns >= begin_ns],
        late(SensorType.ACCELEROMETER),
        late(SensorType.MAGNETIC_FIELD),
        source,
    )


def raw_axes(accelerometer: EventColumn, magnetometer: EventColumn) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return east, north and up in device axes, each float64[n, 3], at each magnetometer event.

    From accelerometer and magnetometer alone, as SensorManager.getRotationMatrix has them.
    """
    newest = np.searchsorted(accelerometer.timestamp_ns, magnetometer.timestamp_ns).clip(0, len(accelerometer) - 1)
    up = accelerometer.values[newest]
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    east = np.cross(magnetometer.values, up)
    east = east / np.linalg.norm(east, axis=1, keepdims=True)
    return east, np.cross(up, east), up


def axes(q: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return east, north and up in device axes, each float64[n, 3], of (x, y, z, w) rows."""
    x, y, z, w = q.T
    east = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    north = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    up = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    return east, north, up
