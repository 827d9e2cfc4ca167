"""Read a TOML table strictly: every complaint names the file, the key, the value and what is allowed."""

import itertools
import sys
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any, TypeGuard

import numpy as np

from posed.errors import ProfileError
from posed.events import Float64Array

_LARGEST_INTEGER = 2**31 - 1
"""What Android's and the wire's integers hold."""


def parse_toml(text: str) -> dict[str, Any]:
    """Return the values of a TOML file; raises ValueError, which says what is wrong, if it is none."""
    try:
        values = tomllib.loads(text)
        # A complaint shows the value: one that cannot be shown is refused here.
        repr(values)
    except tomllib.TOMLDecodeError:
        raise
    except (ValueError, RecursionError):
        raise ValueError("an integer of thousands of digits, or arrays or tables nested too deep") from None
    return values


class TomlTable:
    """One table of a TOML file, read key by key; `finish` refuses the keys nobody read.

    Every reading method raises ProfileError when the key is missing (and has no default) or its value is not allowed.
    """

    def __init__(self, file: str, path: str, values: Mapping[str, object]) -> None:
        self._file = file
        self._path = path
        self._values = values
        self._known: list[str] = []

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string that is not blank."""
        value = self._take(key, default, "a string")
        if not isinstance(value, str) or not value.strip():
            raise self.refusal(key, value, "a string that is not blank")
        return value

    def integer(self, key: str, *, low: int, default: int | None = None) -> int:
        """Return an integer from `low` to 2**31 - 1."""
        allowed = f"an integer, {low} or more, at most {_LARGEST_INTEGER}"
        value = self._take(key, default, allowed)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= _LARGEST_INTEGER:
            raise self.refusal(key, value, allowed)
        return value

    def number(self, key: str, *, positive: bool = False, default: float | None = None) -> float:
        """Return a finite number, 0 or more (more than 0 if `positive`)."""
        allowed = "a number above 0" if positive else "a number, 0 or more"
        value = self._take(key, default, allowed)
        if not _is_finite_number(value) or value < 0 or (positive and value == 0):
            raise self.refusal(key, value, allowed)
        return float(value)

    def ascending(self, key: str) -> tuple[float, ...]:
        """Return a list of one or more numbers above 0, each greater than the one before it."""
        allowed = "a list of one or more numbers above 0, ascending, none twice"
        value = self._take(key, None, allowed)
        if not isinstance(value, list) or not value or not all(_is_finite_number(item) and item > 0 for item in value):
            raise self.refusal(key, value, allowed)
        if any(later <= earlier for earlier, later in itertools.pairwise(value)):
            raise self.refusal(key, value, allowed)
        return tuple(float(item) for item in value)

    def vector(self, key: str, default: Float64Array) -> Float64Array:
        """Return three finite numbers as float64[3]."""
        value = self._values.get(key)
        self._known.append(key)
        if value is None:
            return default
        if not _is_row(value):
            raise self.refusal(key, value, "a list of 3 numbers")
        return np.array(value, np.float64)

    def matrix(self, key: str) -> Float64Array:
        """Return three rows of three finite numbers as float64[3, 3], regular; the unit matrix when absent."""
        value = self._values.get(key)
        self._known.append(key)
        if value is None:
            return np.eye(3)
        if not isinstance(value, list) or len(value) != 3 or not all(_is_row(row) for row in value):
            raise self.refusal(key, value, "a list of 3 rows of 3 numbers")
        matrix = np.array(value, np.float64)
        if np.linalg.matrix_rank(matrix) < 3:
            raise self.refusal(key, value, "a matrix that can be inverted")
        return matrix

    def table(self, key: str, *, required: bool = False) -> "TomlTable":
        """Return a table within this one, empty when absent and not required."""
        value = self._take(key, None if required else {}, "a table")
        if not isinstance(value, dict):
            raise self.refusal(key, value, "a table")
        return TomlTable(self._file, self._name(key), value)

    @property
    def is_empty(self) -> bool:
        """True if it has no key, as one that is absent."""
        return not self._values

    def finish(self) -> None:
        """Refuse every key that was not read."""
        for key in self._values:
            if key in self._known:
                continue
            where = f" in [{self._path}]" if self._path else ""
            allowed = f"allowed{where}: {', '.join(sorted(self._known))}{close_match(key, self._known)}"
            raise ProfileError(f"{self._file}: unknown key {self._name(key)}; {allowed}")

    def refusal(self, key: str, value: object, allowed: str) -> ProfileError:
        """Return the error for a value that is not allowed."""
        return ProfileError(f"{self._file}: {self._name(key)} = {value!r}; allowed: {allowed}")

    def _take(self, key: str, default: object, allowed: str) -> object:
        self._known.append(key)
        if key in self._values:
            return self._values[key]
        if default is None:
            raise ProfileError(f"{self._file}: {self._name(key)} is missing; allowed: {allowed}")
        return default

    def _name(self, key: str) -> str:
        return f"{self._path}.{key}" if self._path else key


def close_match(word: str, words: Iterable[str]) -> str:
    """Return '; did you mean X?' for the word of `words` nearest to `word`, '' when none is near."""
    import difflib  # only a mistake needs it, and the daemon's memory is counted

    close = difflib.get_close_matches(word, list(words), 1)
    return f"; did you mean {close[0]}?" if close else ""


def _is_finite_number(value: object) -> TypeGuard[int | float]:
    # Compared, not converted: an integer may be larger than any float.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _is_row(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(_is_finite_number(item) for item in value)
