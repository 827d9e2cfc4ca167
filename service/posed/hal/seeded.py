"""Random numbers that a seed decides for good.

numpy's Generator may change its streams from one release to the next, and numpy.random is 6 MB of a daemon (it loads
OpenSSL). This is SplitMix64 (Steele, Lea, Flood 2014) used by its counter, a dozen lines of arithmetic.
"""

import math

import numpy as np
import numpy.typing as npt

from posed.events import Float64Array

_GOLDEN = 0x9E3779B97F4A7C15
_MASK = 0xFFFFFFFFFFFFFFFF


class SeededRandom:
    """A stream of random numbers of its own for every key; equal keys give equal streams."""

    def __init__(self, *key: int) -> None:
        state = 0
        for part in key:
            state = _mixed((state + _GOLDEN ^ part) & _MASK)
        self._state = np.uint64(state)
        self._drawn = 0

    def uniform(self, low: float, high: float, shape: tuple[int, ...]) -> Float64Array:
        """Return numbers evenly spread over [low, high), float64[shape]."""
        return low + (high - low) * self._fractions(shape)

    def normal(self, shape: tuple[int, ...]) -> Float64Array:
        """Return numbers of the standard normal distribution, float64[shape], by Box and Muller's transform."""
        radius = np.sqrt(-2.0 * np.log1p(-self._fractions(shape)))
        return np.asarray(radius * np.cos(2.0 * math.pi * self._fractions(shape)))

    def number(self, low: float, high: float) -> float:
        """Return one number of [low, high)."""
        return float(self.uniform(low, high, (1,))[0])

    def permutation(self, count: int) -> list[int]:
        """Return 0 to count - 1 in random order."""
        order: list[int] = np.argsort(self._fractions((count,)), kind="stable").tolist()
        return order

    def _fractions(self, shape: tuple[int, ...]) -> Float64Array:
        count = math.prod(shape)
        counters = np.arange(self._drawn + 1, self._drawn + count + 1, dtype=np.uint64)
        self._drawn += count
        bits = _mixed_array(self._state + counters * np.uint64(_GOLDEN))
        return np.asarray((bits >> np.uint64(11)).astype(np.float64) * 2.0**-53).reshape(shape)


def _mixed(z: int) -> int:
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & _MASK
    return z ^ z >> 31


def _mixed_array(z: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    z = (z ^ z >> np.uint64(30)) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ z >> np.uint64(27)) * np.uint64(0x94D049BB133111EB)
    return z ^ z >> np.uint64(31)
