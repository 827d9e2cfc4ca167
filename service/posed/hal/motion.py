"""Motion scripts: how a simulated phone is held, turned, carried and disturbed, for ever."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from posed.errors import InvalidArgumentError
from posed.events import Float64Array
from posed.hal import rotation
from posed.hal.seeded import SeededRandom
from posed.hal.smooth import Jet, Schedule, Unrest, sine_wave
from posed.hal.toml_table import close_match

DEFAULT_SCRIPT = "look-around"


@dataclass(frozen=True, slots=True)
class Target:
    """A direction the camera comes to look at. heading: rad, clockwise from true north. elevation: rad, up positive."""

    name: str
    heading: float
    elevation: float = 0.0


class MotionScript(Protocol):
    """A motion without end. Times are script times, float64[n] seconds, 0 or later; the world is ENU, true north."""

    @property
    def targets(self) -> tuple[Target, ...]:
        """The directions the camera comes to look at, none for a phone that is not held up."""

    def attitude(self, t: Float64Array) -> Float64Array:
        """Return the attitudes, device to world, float64[n, 4] xyzw; twice continuously differentiable."""

    def position(self, t: Float64Array) -> Float64Array:
        """Return the positions, metres from the start, float64[n, 3]."""

    def acceleration(self, t: Float64Array) -> Float64Array:
        """Return the second derivative of the position, m/s2 without gravity, float64[n, 3]."""

    def disturbance(self, t: Float64Array) -> Float64Array | None:
        """Return what a magnet adds to the field, uT in the world frame, float64[n, 3]; None where there is none."""


def script_names() -> tuple[str, ...]:
    """Return the names of the scripts."""
    return tuple(_SCRIPTS)


def make_script(name: str, seed: int) -> MotionScript:
    """Make a script by name; the same seed (0 or more) gives the same motion.

    Raises InvalidArgumentError for an unknown name.
    """
    make = _SCRIPTS.get(name)
    if make is None:
        hint = close_match(name, _SCRIPTS)
        raise InvalidArgumentError(f"motion script {name!r} is unknown; allowed: {', '.join(_SCRIPTS)}{hint}")
    return make(SeededRandom(seed, _MOTION_STREAM))


_MOTION_STREAM = 1
"""Sets the generator of motions apart from those of sensor errors made from the same seed."""


def _degrees(name: str, heading: float, elevation: float = 0.0) -> Target:
    return Target(name, math.radians(heading), math.radians(elevation))


_TARGETS: tuple[Target, ...] = (
    _degrees("north", 0),
    _degrees("tower", 48, 14),
    _degrees("east", 90),
    _degrees("roof", 133, 20),
    _degrees("south", 180),
    _degrees("door", 222, -8),
    _degrees("west", 270),
    _degrees("hill", 312, 6),
)


class _Table:
    """A phone that lies on a table, screen up and top edge to the north; the base of the scripts on a table."""

    targets: tuple[Target, ...] = ()

    def attitude(self, t: Float64Array) -> Float64Array:
        return np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))

    def position(self, t: Float64Array) -> Float64Array:
        return np.zeros((len(t), 3))

    def acceleration(self, t: Float64Array) -> Float64Array:
        return np.zeros((len(t), 3))

    def disturbance(self, t: Float64Array) -> Float64Array | None:
        return None


class _Turn(_Table):
    """Table 3 of Patonis 2018: a full turn about one device axis, 45 degrees at a time, at rest after each.

    Start and senses are the paper's: flat, top edge at heading 165 degrees, then right about x, left about y and z. The
    turns about x and y pass through every attitude at which Euler angles are singular.
    """

    _HOLD_S, _MOVE_S = 4.0, 1.0

    def __init__(self, axis: int, sense: float) -> None:
        self._axis = axis
        starts = [self._HOLD_S + section * (self._HOLD_S + self._MOVE_S) for section in range(8)]
        angles = [sense * section * math.pi / 4 for section in range(9)]
        self._angle = Schedule(starts, [self._MOVE_S] * 8, angles, starts[-1] + self._MOVE_S)

    def attitude(self, t: Float64Array) -> Float64Array:
        turn = np.zeros((len(t), 3))
        turn[:, self._axis] = self._angle.value(t)
        return rotation.multiply(_FLAT_AT_165, rotation.from_rotation_vector(turn))


_FLAT_AT_165 = rotation.from_rotation_vector(np.array([[0.0, 0.0, -math.radians(165)]]))


class _Magnet(_Table):
    """A phone on a table, at rest and then turned there and back, past which a magnet is carried twice a round."""

    _ROUND_S = 40.0
    _MOMENT = 0.4  # A m2, a small neodymium magnet: about 50 uT where it comes nearest.
    _FAR_M, _NEAR_M = 1.5, 0.1

    def __init__(self, rng: SeededRandom) -> None:
        far, near = self._FAR_M, self._NEAR_M
        self._heading = Schedule([20.0, 28.0], [2.0, 4.0], [0.0, math.pi / 2, 0.0], self._ROUND_S)
        self._distance = Schedule([8, 15, 26, 33], [3.0] * 4, [far, near, far, near, far], self._ROUND_S)
        side = rng.number(0.0, 2.0 * math.pi)
        self._way = np.array([math.cos(side), math.sin(side), 0.0])
        axis = rng.normal((3,))
        self._dipole = self._MOMENT * axis / np.linalg.norm(axis)

    def attitude(self, t: Float64Array) -> Float64Array:
        turn = np.zeros((len(t), 3))
        turn[:, 2] = -self._heading.value(t)
        return rotation.from_rotation_vector(turn)

    def disturbance(self, t: Float64Array) -> Float64Array | None:
        # Magnet to phone; it moves 5 cm above the table. Field of a dipole, mu0 / 4 pi = 0.1 uT m3 / (A m2).
        r = self._distance.value(t)[:, np.newaxis] * self._way - np.array([0.0, 0.0, 0.05])
        squared = np.einsum("ij,ij->i", r, r)[:, np.newaxis]
        along = (r @ self._dipole)[:, np.newaxis] * r / squared
        field: Float64Array = 0.1 * (3.0 * along - self._dipole) / squared**1.5
        return field


class _Hand(_Table):
    """A phone held upright in portrait, the camera (device -z) along a heading and an elevation, by a hand that never
    holds quite still; the base of the scripts in a hand."""

    targets = _TARGETS

    def __init__(self, rng: SeededRandom) -> None:
        # Sway, its correction, tremor: 2 deg/s and 0.1 m/s2 together.
        self._turning = Unrest((0.23, 0.61, 1.7, 9.3), (8e-3, 4e-3, 2e-3, 4e-4), rng)
        self._shifting = Unrest((0.19, 0.47, 1.4, 8.7), (4e-3, 2e-3, 4e-4, 1.5e-5), rng)

    def position(self, t: Float64Array) -> Float64Array:
        return self._shifting.value(t)

    def acceleration(self, t: Float64Array) -> Float64Array:
        return self._shifting.second(t)

    def _held(self, t: Float64Array, heading: Float64Array, elevation: Float64Array) -> Float64Array:
        """Return the attitudes with the camera along heading and elevation (rad), but for the hand's unrest."""
        # qz(-heading) qx(90 deg + elevation), written out.
        a, b = -0.5 * heading, 0.25 * math.pi + 0.5 * elevation
        sin_a, cos_a, sin_b, cos_b = np.sin(a), np.cos(a), np.sin(b), np.cos(b)
        upright = np.stack([cos_a * sin_b, sin_a * sin_b, sin_a * cos_b, cos_a * cos_b], axis=1)
        return rotation.multiply(upright, rotation.from_rotation_vector(self._turning.value(t)))


class _LookAround(_Hand):
    """A user of an AR application who stands and pans among targets, now and then back to the one before."""

    _ARM_M = 0.35  # The phone goes round its holder.

    def __init__(self, rng: SeededRandom) -> None:
        super().__init__(rng)
        starts, durations, headings, elevations = [], [], [0.0], [0.0]
        now = 0.0
        for index in self._visits(rng):
            now += rng.number(1.5, 4.0)
            turn = math.remainder(_TARGETS[index].heading - headings[-1], 2.0 * math.pi)
            starts.append(now)
            durations.append(max(0.8, abs(turn) / rng.number(0.5, 1.1)))
            headings.append(headings[-1] + turn)
            elevations.append(_TARGETS[index].elevation)
            now += durations[-1]
        self._heading = Schedule(starts, durations, headings, now)
        self._elevation = Schedule(starts, durations, elevations, now)

    def attitude(self, t: Float64Array) -> Float64Array:
        return self._held(t, self._heading.value(t), self._elevation.value(t))

    def position(self, t: Float64Array) -> Float64Array:
        heading = self._heading.value(t)
        arm = np.stack([np.sin(heading), np.cos(heading) - 1.0, np.zeros_like(t)], axis=1)
        return super().position(t) + self._ARM_M * arm

    def acceleration(self, t: Float64Array) -> Float64Array:
        sine, cosine = self._heading.jet(t).sine_cosine()
        arm = np.stack([sine.second, cosine.second, np.zeros_like(t)], axis=1)
        return super().acceleration(t) + self._ARM_M * arm

    def _visits(self, rng: SeededRandom) -> list[int]:
        """Return which targets are looked at, north first and last, none twice in a row: about five minutes."""
        visits = [0]
        for _ in range(6):
            for index in rng.permutation(len(_TARGETS)):
                if index == visits[-1]:
                    continue
                visits.append(index)
                if rng.number(0.0, 1.0) < 0.3:
                    visits.append(visits[-2])
        return [*visits[1:], 0] if visits[-1] else visits[1:]


class _Returns(_LookAround):
    """The same user, who compares three objects with their overlay: one after the other, twenty times."""

    targets = tuple(target for target in _TARGETS if target.name in ("tower", "roof", "hill"))

    def _visits(self, rng: SeededRandom) -> list[int]:
        return [_TARGETS.index(target) for target in self.targets] * 20 + [0]


class _Pan(_Hand):
    """A phone turned right without end about the one who holds it, at one rate once it is under way."""

    targets = tuple(target for target in _TARGETS if target.elevation == 0.0)
    _UNDER_WAY_S = 1.0

    def __init__(self, rng: SeededRandom, degrees_per_s: float) -> None:
        super().__init__(rng)
        self._rate = math.radians(degrees_per_s)

    def attitude(self, t: Float64Array) -> Float64Array:
        # The rate grows as 1 - exp(-t / T), so that a filter begins with a phone that rests.
        run_up = self._UNDER_WAY_S * -np.expm1(-t / self._UNDER_WAY_S)
        return self._held(t, self._rate * (t - run_up), np.zeros_like(t))


class _Walk(_Hand):
    """A walk round a block, the camera forward and 15 degrees down, with 1.8 steps a second and a stop each round."""

    targets = tuple(target for target in _TARGETS if target.name in ("north", "east", "south", "west"))
    _STEP_HZ = 1.8
    _SPEED = 1.3
    _STAND_S, _START_S, _TURN_S, _LEG_S = 3.0, 1.5, 2.0, 8.0

    def __init__(self, rng: SeededRandom) -> None:
        super().__init__(rng)
        # The stop halves the leg to the north, and starting and stopping cover as much as _START_S at full speed: so
        # that the legs to the north and to the south are equally long and the round closes.
        start = self._STAND_S + self._START_S + 0.5 * (self._LEG_S - self._START_S)
        corners = [start + side * (self._LEG_S + self._TURN_S) for side in range(4)]
        stop = corners[-1] + self._TURN_S + 0.5 * (self._LEG_S - self._START_S)
        period = stop + self._START_S
        self._heading = Schedule(corners, [self._TURN_S] * 4, [side * math.pi / 2 for side in range(5)], period)
        self._pace = Schedule([self._STAND_S, stop], [self._START_S] * 2, [0.0, 1.0, 0.0], period)
        knots = _KNOT_S * np.arange(int(period / _KNOT_S) + 1, dtype=np.float64)
        self._way = np.concatenate([np.zeros((1, 2)), np.cumsum(self._covered(knots, np.full_like(knots, _KNOT_S)), 0)])

    def attitude(self, t: Float64Array) -> Float64Array:
        pace = self._pace.value(t)
        heading = self._heading.value(t) + math.radians(2.0) * pace * sine_wave(t, 0.5 * self._STEP_HZ, 0.4).value
        nod = math.radians(1.2) * pace * sine_wave(t, self._STEP_HZ, 1.1).value
        return self._held(t, heading, math.radians(-15.0) + nod)

    def position(self, t: Float64Array) -> Float64Array:
        within = np.mod(t, self._pace.period)
        knot = (within / _KNOT_S).astype(np.int64)
        start = _KNOT_S * knot.astype(np.float64)
        body = self._way[knot] + self._covered(start, within - start)
        east, north, up = self._gait(t)
        gait = np.stack([body[:, 0] + east.value, body[:, 1] + north.value, up.value], axis=1)
        return super().position(t) + gait

    def acceleration(self, t: Float64Array) -> Float64Array:
        pace = self._pace.jet(t).scaled(self._SPEED)
        sine, cosine = self._heading.jet(t).sine_cosine()
        east, north, up = self._gait(t)
        gait = [(pace * sine).first + east.second, (pace * cosine).first + north.second, up.second]
        return super().acceleration(t) + np.stack(gait, axis=1)

    def _gait(self, t: Float64Array) -> tuple[Jet, Jet, Jet]:
        """Return the body's sway to the side (2 cm, one a stride) and bounce (1.8 cm and heel strike, one a step)."""
        pace = self._pace.jet(t)
        sine, cosine = self._heading.jet(t).sine_cosine()
        sway = pace * sine_wave(t, 0.5 * self._STEP_HZ).scaled(0.02)
        bounce = sine_wave(t, self._STEP_HZ).scaled(0.018) + sine_wave(t, 2.0 * self._STEP_HZ, 0.7).scaled(0.002)
        return sway * cosine, (sway * sine).scaled(-1.0), pace * bounce

    def _covered(self, start: Float64Array, duration: Float64Array) -> Float64Array:
        """Return the way (m, east and north, float64[n, 2]) of the body from each `start` (s) for `duration` (s)."""
        half = 0.5 * duration[:, np.newaxis]
        t = start[:, np.newaxis] + half * (1.0 + _GAUSS_NODES)
        speed = self._SPEED * self._pace.value(t) * _GAUSS_WEIGHTS * half
        heading = self._heading.value(t)
        covered: Float64Array = np.stack([(speed * np.sin(heading)).sum(1), (speed * np.cos(heading)).sum(1)], axis=1)
        return covered


_KNOT_S = 0.1
"""The walk is integrated from knot to knot; six points over 0.1 s are exact to the last digits of a double."""
# Gauss-Legendre of order six, written out: numpy.polynomial, which knows it, takes 2 MB of the daemon's memory.
_GAUSS_NODES = np.array(
    [
        -0.9324695142031519,
        -0.6612093864662645,
        -0.2386191860831969,
        0.2386191860831969,
        0.6612093864662645,
        0.9324695142031519,
    ]
)
_GAUSS_WEIGHTS = np.array(
    [
        0.17132449237917027,
        0.3607615730481387,
        0.46791393457269104,
        0.46791393457269104,
        0.3607615730481387,
        0.17132449237917027,
    ]
)


class _Shake(_Hand):
    """A phone held towards the north and shaken hard for a second and a half every eight seconds."""

    targets = _TARGETS[:1]
    _EVERY_S, _FROM_S, _LASTS_S = 8.0, 5.0, 1.5
    _KINDS = 16

    def __init__(self, rng: SeededRandom) -> None:
        super().__init__(rng)
        self._axes = self._directions(rng) * math.radians(14.0)
        self._ways = self._directions(rng) * 0.045

    def attitude(self, t: Float64Array) -> Float64Array:
        kind, strength = self._strength(t)
        twist = (strength * sine_wave(t, 1.9)).value[:, np.newaxis] * self._axes[kind]
        held = self._held(t, np.zeros_like(t), np.zeros_like(t))
        return rotation.multiply(held, rotation.from_rotation_vector(twist))

    def position(self, t: Float64Array) -> Float64Array:
        kind, strength = self._strength(t)
        shaken: Float64Array = (strength * sine_wave(t, 2.9)).value[:, np.newaxis] * self._ways[kind]
        return super().position(t) + shaken

    def acceleration(self, t: Float64Array) -> Float64Array:
        kind, strength = self._strength(t)
        shaken: Float64Array = (strength * sine_wave(t, 2.9)).second[:, np.newaxis] * self._ways[kind]
        return super().acceleration(t) + shaken

    def _strength(self, t: Float64Array) -> tuple[npt.NDArray[np.int64], Jet]:
        """Return which of the shakes each instant is in, and how far it has swelled: 0 outside, 1 in its middle."""
        number = np.floor_divide(t, self._EVERY_S)
        x = np.clip((t - number * self._EVERY_S - self._FROM_S) / self._LASTS_S, 0.0, 1.0)
        speed = np.full_like(x, 1.0 / self._LASTS_S)
        bump = Jet(x, speed, np.zeros_like(x)) * Jet(1.0 - x, -speed, np.zeros_like(x))
        return number.astype(np.int64) % self._KINDS, (bump * bump * bump).scaled(64.0)

    def _directions(self, rng: SeededRandom) -> Float64Array:
        vectors = rng.normal((self._KINDS, 3))
        directions: Float64Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        return directions


_SCRIPTS: dict[str, Callable[[SeededRandom], MotionScript]] = {
    DEFAULT_SCRIPT: _LookAround,
    "still": lambda rng: _Table(),
    "turn-x": lambda rng: _Turn(0, 1.0),
    "turn-y": lambda rng: _Turn(1, -1.0),
    "turn-z": lambda rng: _Turn(2, -1.0),
    "returns": _Returns,
    "compass": lambda rng: _Pan(rng, 15.0),
    "pan": lambda rng: _Pan(rng, 100.0),
    "walk": _Walk,
    "shake": _Shake,
    "magnet": _Magnet,
}
