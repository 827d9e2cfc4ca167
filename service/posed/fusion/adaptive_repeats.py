"""Does a sensor hang: values that stay the same to the last bit for long in motion, and often."""

from dataclasses import dataclass

_STUCK_S = 0.5
_STUCK_SAMPLES = 8
"""In motion only: noise below the last bit repeats itself on a table, and at NORMAL half a second is two samples."""


@dataclass
class Repeats:
    """A sensor's last value, how many samples have repeated it, and for how many s of motion."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    count: int = 0
    moved_s: float = 0.0

    def take(self, x: float, y: float, z: float, first: bool) -> bool:
        """Take a sample and return whether it repeats the one before; the `first` repeats none."""
        if first or x != self.x or y != self.y or z != self.z:
            self.x = x
            self.y = y
            self.z = z
            self.count = 0
            self.moved_s = 0.0
            return False
        self.count += 1
        return True

    def stuck(self) -> bool:
        """Return whether the last value is that of a sensor that hangs."""
        return self.moved_s > _STUCK_S and self.count >= _STUCK_SAMPLES
