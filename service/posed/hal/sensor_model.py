"""What one part of a simulated phone reports: the physics of its motion, then the part's own errors."""

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np

from posed.events import STANDARD_GRAVITY, Float64Array, Int64Array, SensorType
from posed.hal import rotation
from posed.hal.calibration import Calibration
from posed.hal.motion import MotionScript
from posed.hal.profile import ExactPeriod, SensorProfile, exact_period_ns
from posed.hal.seeded import SeededRandom

BLOCK_SAMPLES = 256
"""Samples are made this many at a time: numpy's cost a call, not a sample, is what counts at a phone's rates."""


@dataclass(frozen=True, slots=True)
class Site:
    """The Earth's magnetic field where the phone is. declination: rad, east positive. dip: rad, down positive."""

    declination: float
    dip: float
    strength_ut: float

    def field(self) -> Float64Array:
        """Return the field (uT, float64[3]), ENU with true north."""
        horizontal = self.strength_ut * cos(self.dip)
        east, north = horizontal * sin(self.declination), horizontal * cos(self.declination)
        return np.array([east, north, -self.strength_ut * sin(self.dip)])


THESSALONIKI = Site(declination=radians(5.5), dip=radians(57.0), strength_ut=46.9)
"""Where Patonis et al. worked."""


class SensorModel:
    """One part of a phone, its constant errors drawn from the seed.

    reading(t) = E truth(t - delay) + bias(t) + white noise, as raw readings (before the profile's calibration), rounded
    to the part's resolution and limited to its range. What it reports at an instant depends on the seed, the rate and
    the instant alone.
    """

    def __init__(
        self, part: SensorProfile, calibration: Calibration, script: MotionScript, site: Site, seed: int
    ) -> None:
        self._part = part
        self._calibration = calibration
        self._script = script
        self._field = site.field()
        self._key = [seed, _ERROR_STREAM, int(part.type)]
        rng = SeededRandom(*self._key)
        bounds = part.residual
        self._bias = rng.uniform(-1.0, 1.0, (3,)) * (bounds.bias + bounds.hard_iron)
        self._errors = np.eye(3) + np.diag(rng.uniform(-1.0, 1.0, (3,)) * bounds.scale)
        self._errors += rng.uniform(-1.0, 1.0, (3, 3)) * (1.0 - np.eye(3)) * bounds.misalignment
        soft_iron = rng.uniform(-1.0, 1.0, (3, 3)) * bounds.soft_iron
        self._errors += 0.5 * (soft_iron + soft_iron.T)
        # A part's streams, whatever their rates, stand within two blocks of its slowest rate.
        self._walk = _RandomWalk(part.bias_walk, self._key, 2 * BLOCK_SAMPLES / part.rates_hz[0])

    def block(
        self, rate_hz: float, index: int, joins: tuple[int, int] | None = None
    ) -> tuple[Int64Array, Float64Array]:
        """Return block `index` of the samples at `rate_hz`: timestamps (ns script time, int64[BLOCK_SAMPLES]) and raw
        readings (float64[BLOCK_SAMPLES, 3]).

        Sample k = index * BLOCK_SAMPLES + i stands at k + 1 periods, but for the timestamp's jitter. joins: the first
        row in use, and the script time (ns) since which it stands, for a gyroscope whose rate has just changed: the
        motion since the last sample at the rate before would be lost otherwise, or told twice.
        """
        period = exact_period_ns(rate_hz)
        grid_ns = _grid_ns(period, index)
        t = 1e-9 * grid_ns.astype(np.float64)
        truth = self._truth(t if joins is None else 1e-9 * _joined(grid_ns, *joins).astype(np.float64))
        rng = SeededRandom(*self._key, period.numerator, period.denominator, index)
        noise = rng.normal((BLOCK_SAMPLES, 4))
        reading = truth @ self._errors.T + self._bias + self._walk.at(t[1:])
        reading += noise[:, :3] * (self._part.noise_density * rate_hz**0.5)
        # Kept within a third of the period, so that timestamps ascend whatever is drawn.
        latest = min(3e9 * self._part.timestamp_jitter_s, (period.numerator / period.denominator) / 3.0)
        jitter = np.clip(noise[:, 3] * (1e9 * self._part.timestamp_jitter_s), -latest, latest)
        return grid_ns[1:] + np.rint(jitter).astype(np.int64), self._digitised(self._calibration.invert(reading))

    def _truth(self, t: Float64Array) -> Float64Array:
        """Return what an ideal part stamps t[1:] (s; a gyroscope: the mean since the instant before)."""
        # Before the motion began the phone was where it began.
        felt = np.maximum(t - self._part.delay_s, 0.0)
        if self._part.type is SensorType.GYROSCOPE:
            return rotation.increments(self._script.attitude(felt)) / np.diff(t)[:, np.newaxis]
        t = felt[1:]
        if self._part.type is SensorType.ACCELEROMETER:
            return rotation.to_device(self._script.attitude(t), self._script.acceleration(t) + _UP_G)
        disturbance = self._script.disturbance(t)
        field = self._field if disturbance is None else self._field + disturbance
        return rotation.to_device(self._script.attitude(t), field)

    def _digitised(self, reading: Float64Array) -> Float64Array:
        step = self._part.resolution
        counts = np.floor(self._part.max_range / step)
        return np.clip(np.rint(reading / step), -counts, counts) * step


_UP_G = np.array([0.0, 0.0, STANDARD_GRAVITY])

_ERROR_STREAM = 2
"""Sets the generators of errors apart from that of the motion made from the same seed."""


def _grid_ns(period: ExactPeriod, index: int) -> Int64Array:
    """Return the instants (ns) of a block on the exact grid, the one before it in front: int64[BLOCK_SAMPLES + 1]."""
    # The block's start in Python's integers: the product leaves 64 bits behind after days of an uneven rate.
    whole, rest = divmod(index * BLOCK_SAMPLES * period.numerator, period.denominator)
    return whole + (rest + period.numerator * np.arange(BLOCK_SAMPLES + 1, dtype=np.int64)) // period.denominator


def _joined(grid_ns: Int64Array, row: int, since_ns: int) -> Int64Array:
    """Return the instants with sample `row` standing since `since_ns`; those before it, not in use, moved along."""
    joined = grid_ns.copy()
    joined[: row + 1] += since_ns - grid_ns[row]
    return joined


class _RandomWalk:
    """A bias on three axes that wanders from zero, known at nodes 10 s apart and straight between them.

    kept_s: how far behind the newest times asked for nodes are kept; older ones are made again when they are needed.
    """

    _NODE_S = 10.0
    _CHUNK = 256

    def __init__(self, density: float, key: list[int], kept_s: float) -> None:
        self._step = density * self._NODE_S**0.5
        self._key = key
        self._kept = int(kept_s / self._NODE_S) + 1
        self._first = 0
        """The node that `_nodes` begins with."""
        self._nodes = np.zeros((1, 3))

    def at(self, t: Float64Array) -> Float64Array:
        """Return the bias at the ascending times `t` (s), float64[n, 3]."""
        if self._step == 0.0:
            return np.zeros((len(t), 3))
        at_node = t / self._NODE_S
        node = at_node.astype(np.int64)
        if node[0] < self._first:
            self._first, self._nodes = 0, np.zeros((1, 3))
        while self._first + len(self._nodes) < node[-1] + 2:
            chunk = (self._first + len(self._nodes)) // self._CHUNK
            steps = SeededRandom(*self._key, chunk).normal((self._CHUNK, 3)) * self._step
            self._nodes = np.concatenate([self._nodes, self._nodes[-1] + np.cumsum(steps, axis=0)])
            if self._first + self._CHUNK <= node[0] - self._kept:
                self._first += self._CHUNK
                self._nodes = self._nodes[self._CHUNK :]
        row = node - self._first
        before = self._nodes[row]
        return before + (at_node - node)[:, np.newaxis] * (self._nodes[row + 1] - before)
