"""What every orientation filter can do, and what it is told about the sensors."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol

from posed.errors import InvalidArgumentError
from posed.events import FlatEvent, Orientation, SensorType

MAX_DELAY_S = 0.1
"""A sample later than this is given up."""


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """White noise of the parts at rest, as a data sheet or an Allan deviation states it, and how late they are.

    A filter adds what motion and surroundings contribute: alone the noise would make it trust the gyroscope for
    minutes, and linear acceleration and local fields not at all little enough. A delay is the group delay of the part's
    low-pass: a sample stands for what was felt so long before its stamp.
    """

    gyro_density: float = math.radians(0.014)
    """rad/s/sqrt(Hz); independent of the rate. Default: BMI055."""
    acc_std: float = 0.034
    """m/s2, one standard deviation of a sample of one axis. Default: BMI055 at 100 Hz."""
    mag_std: float = 1.2
    """uT, one standard deviation of a sample of one axis. Default: AK8963 at 50 Hz."""
    gyro_delay_s: float = 0.003
    """s. Default: MPU-6500 at 184 Hz, 2.9 ms."""
    acc_delay_s: float = 0.006
    """s. Default: the same part's accelerometer, 5.8 ms."""
    mag_delay_s: float = 0.008
    """s. Default: AK8963, whose conversion takes 7 ms."""

    def __post_init__(self) -> None:
        require_positive(self, "gyro_density", "acc_std", "mag_std")
        require_delays(self)


class OrientationFilter(Protocol):
    """Accelerometer (m/s2), gyroscope (rad/s) and magnetometer (uT) events in, orientation out.

    Feeding events one at a time or all at once gives the same result, bit for bit.
    """

    name: str

    def update(self, sensor_type: SensorType, timestamp_ns: int, x: float, y: float, z: float) -> None:
        """Take one event; other sensor types are ignored."""

    def update_batch(self, events: Iterable[FlatEvent]) -> None:
        """Take events in the order given."""

    def orientation(self) -> Orientation | None:
        """Return the orientation at the newest gyroscope sample, None until gravity and north have been seen.

        While the gyroscope is lost it stands at the newest measurement instead. Asking changes nothing.
        """

    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the gyroscope's bias and its standard deviations, rad/s in device axes; NaN for deviations unknown."""

    def clear_events(self) -> None:
        """Forget the flags that speak of what happened since the last pose (GAP, BAD_SAMPLE); call at each pose."""

    def save(self) -> dict[str, Any]:
        """Return the whole state as values that JSON can hold; floats survive its text to the last bit."""

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue from a saved state, bit for bit, given the same parameters.

        Raises InvalidArgumentError, and leaves the filter as it was, when `saved` is not a state of this filter.
        """


def require_positive(params: Any, *names: str) -> None:
    """Raise InvalidArgumentError unless the named floats of a params dataclass, or all, are finite and above 0."""
    for name in names or [each.name for each in fields(params)]:
        value = getattr(params, name)
        if isinstance(value, float) and not (math.isfinite(value) and value > 0.0):
            raise InvalidArgumentError(f"{type(params).__name__}.{name} is {value}; give a finite number above 0")


def require_delays(params: Any) -> None:
    """Raise InvalidArgumentError unless the three delays of a params dataclass are from 0 to MAX_DELAY_S."""
    for name in ("gyro_delay_s", "acc_delay_s", "mag_delay_s"):
        value = getattr(params, name)
        if not 0.0 <= value <= MAX_DELAY_S:
            raise InvalidArgumentError(
                f"{type(params).__name__}.{name} is {value}; give seconds from 0 to {MAX_DELAY_S}, usually thousandths"
            )
