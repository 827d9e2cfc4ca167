"""Smooth functions of time that know their first two derivatives: what motion scripts are made of."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from posed.events import Float64Array
from posed.hal.seeded import SeededRandom


@dataclass(frozen=True, slots=True)
class Jet:
    """A function of time at n instants with its first and second time derivative (float64[n] each)."""

    value: Float64Array
    first: Float64Array
    second: Float64Array

    def __add__(self, other: "Jet") -> "Jet":
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __mul__(self, other: "Jet") -> "Jet":
        return Jet(
            self.value * other.value,
            self.first * other.value + self.value * other.first,
            self.second * other.value + 2.0 * self.first * other.first + self.value * other.second,
        )

    def scaled(self, factor: float) -> "Jet":
        """Return the jet of the function times `factor`."""
        return Jet(factor * self.value, factor * self.first, factor * self.second)

    def sine_cosine(self) -> tuple["Jet", "Jet"]:
        """Return the jets of the function's sine and cosine."""
        sine, cosine, squared = np.sin(self.value), np.cos(self.value), self.first * self.first
        return (
            Jet(sine, cosine * self.first, cosine * self.second - sine * squared),
            Jet(cosine, -sine * self.first, -sine * self.second - cosine * squared),
        )


def sine_wave(t: Float64Array, hertz: float, phase: float = 0.0) -> Jet:
    """Return the jet of sin(2 pi hertz t + phase)."""
    rate = 2.0 * math.pi * hertz
    wave = np.sin(rate * t + phase)
    return Jet(wave, rate * np.cos(rate * t + phase), -rate * rate * wave)


class Schedule:
    """A quantity that rests at values and moves from each to the next, for ever: twice continuously differentiable.

    Move i starts at starts[i] (s), takes durations[i] (s) and leads from values[i] to values[i + 1]; moves do not
    overlap, and all begins again after `period` seconds. values[-1] has to mean the same as values[0] (for an angle:
    equal but for whole turns).
    """

    def __init__(
        self, starts: Sequence[float], durations: Sequence[float], values: Sequence[float], period: float
    ) -> None:
        # A row in front for the rest before the first move.
        self._starts = np.array([-1.0, *starts])
        self._durations = np.array([1.0, *durations])
        self._from = np.array([values[0], *values[:-1]])
        self._change = np.array([0.0, *np.diff(values)])
        self.period = period

    def value(self, t: Float64Array) -> Float64Array:
        """Return the quantity at the times `t` (s, 0 or later)."""
        move, x = self._locate(t)
        value: Float64Array = self._from[move] + self._change[move] * _smoothstep(x)
        return value

    def jet(self, t: Float64Array) -> Jet:
        """Return the quantity and its derivatives at the times `t` (s, 0 or later)."""
        move, x = self._locate(t)
        change, duration = self._change[move], self._durations[move]
        rest = 1.0 - x
        return Jet(
            self._from[move] + change * _smoothstep(x),
            change / duration * (30.0 * x * x * rest * rest),
            change / (duration * duration) * (60.0 * x * rest * (rest - x)),
        )

    def _locate(self, t: Float64Array) -> tuple[npt.NDArray[np.intp], Float64Array]:
        within = np.mod(t, self.period)
        move = np.searchsorted(self._starts, within, side="right") - 1
        return move, np.clip((within - self._starts[move]) / self._durations[move], 0.0, 1.0)


class Unrest:
    """A sum of slow and fast sines on three axes that starts from zero: a hand never holds quite still."""

    def __init__(self, hertz: Sequence[float], amplitudes: Sequence[float], rng: SeededRandom) -> None:
        """Give each sine (frequency in Hz, amplitude) its own size and phase on each axis."""
        self._rates = 2.0 * math.pi * np.array(hertz)
        sizes = np.array(amplitudes)[:, np.newaxis] * rng.uniform(0.6, 1.4, (len(hertz), 3))
        phases = rng.uniform(0.0, 2.0 * math.pi, (len(hertz), 3))
        self._weights = np.concatenate([sizes * np.cos(phases), sizes * np.sin(phases)])
        self._second_weights = -np.square(np.tile(self._rates, 2))[:, np.newaxis] * self._weights
        self._start = self._waves(np.zeros(1)) @ self._weights

    def value(self, t: Float64Array) -> Float64Array:
        """Return the sum at the times `t` (s), float64[n, 3]."""
        value: Float64Array = self._waves(t) @ self._weights - self._start
        return value

    def second(self, t: Float64Array) -> Float64Array:
        """Return its second time derivative at the times `t` (s), float64[n, 3]."""
        second: Float64Array = self._waves(t) @ self._second_weights
        return second

    def _waves(self, t: Float64Array) -> Float64Array:
        angles = np.multiply.outer(t, self._rates)
        return np.concatenate([np.sin(angles), np.cos(angles)], axis=1)


def _smoothstep(x: Float64Array) -> Float64Array:
    """Return the way from 0 to 1 whose first two derivatives vanish at both ends, at x from 0 to 1."""
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))
