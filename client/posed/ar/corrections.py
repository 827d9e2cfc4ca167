"""Pose corrections by name, kept for the next time."""

import contextlib
import fcntl
import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from posed.errors import InvalidArgumentError, PosedError

_MAX_COUNT = 200
_MAX_NAME = 60


class CorrectionStore:
    """A JSON file of the user's: {"corrections": {NAME: {"heading_offset_deg", "position", "saved"}}}."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> dict[str, dict[str, Any]]:
        """Return the corrections by name; raises PosedError if the file cannot be read or is not one of ours."""
        try:
            found = json.loads(self._path.read_text())["corrections"]
            if not isinstance(found, dict):
                raise TypeError("corrections is no object")
            return {_checked_name(name): correction(value) for name, value in found.items()}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, KeyError, TypeError, RecursionError, InvalidArgumentError) as error:
            raise PosedError(f"{self._path} holds no corrections: {error}; move it away to begin anew") from error

    def save(self, name: str, value: Any) -> None:
        """Keep a correction.

        Raises InvalidArgumentError for a bad name or value, or too many of them; PosedError if it cannot be kept.
        """
        kept = {_checked_name(name): correction(value)}
        with self._locked():
            corrections = {**self.load(), **kept}
            if len(corrections) > _MAX_COUNT:
                raise InvalidArgumentError(f"{_MAX_COUNT} corrections are kept; delete one first")
            self._write(corrections)

    def delete(self, name: str) -> None:
        """Forget a correction; an unknown name is left alone."""
        with self._locked():
            corrections = self.load()
            if corrections.pop(name, None) is not None:
                self._write(corrections)

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        """Keep other threads and other processes from changing the file meanwhile."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            # Beside it, not the file itself: that is another one with each change.
            with Path(f"{self._path}.lock").open("a") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)
                yield
        except OSError as error:
            raise PosedError(
                f"cannot keep corrections in {self._path}: {error.strerror}; name another file with --corrections"
            ) from error

    def _write(self, corrections: dict[str, dict[str, Any]]) -> None:
        # Written beside it and moved into place: whoever reads meanwhile gets the one or the other, whole.
        descriptor, written = tempfile.mkstemp(dir=self._path.parent)
        try:
            with os.fdopen(descriptor, "w") as file:
                json.dump({"corrections": corrections}, file, indent=1)
            os.replace(written, self._path)
        except BaseException:
            os.unlink(written)
            raise


def default_path() -> Path:
    """Return where a user's corrections are kept ($XDG_DATA_HOME, else ~/.local/share)."""
    base = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(base) / "posed" / "corrections.json"


def correction(value: Any) -> dict[str, Any]:
    """Return a correction as it is kept.

    heading_offset_deg: degrees added to every heading, clockwise. position: null, or latitude and longitude (degrees)
    and height (m above the ellipsoid). saved: when, ISO 8601. Raises InvalidArgumentError naming what is wrong.
    """
    if not isinstance(value, dict):
        raise InvalidArgumentError("a correction is a JSON object")
    position = value.get("position")
    if position is not None:
        if not isinstance(position, dict):
            raise InvalidArgumentError("position is null or an object of latitude, longitude and height")
        position = {
            "latitude": _number(position, "latitude", 90),
            "longitude": _number(position, "longitude", 180),
            "height": _number(position, "height", 20_000),
        }
    saved = str(value.get("saved", ""))[:40]
    if not saved.isprintable():
        raise InvalidArgumentError(f"saved = {saved!r}; allowed: printable characters")
    return {
        "heading_offset_deg": _number(value, "heading_offset_deg", 360),
        "position": position,
        "saved": saved,
    }


def _checked_name(name: str) -> str:
    if not 0 < len(name) <= _MAX_NAME or not name.isprintable():
        raise InvalidArgumentError(f"a correction's name has 1 to {_MAX_NAME} printable characters, not {name!r}")
    return name


def _number(values: dict[str, Any], key: str, limit: float) -> float:
    value = values.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= limit:
        raise InvalidArgumentError(f"{key} = {value!r}; allowed: a number from -{limit} to {limit}")
    return float(value)
