"""What every orientation filter can do, and what it is told about the sensors."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol

from posed.errors import InvalidArgumentError
from posed.events import FlatEvent, Orientation, SensorType


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """White noise of the parts at rest, as a data sheet or an Allan deviation states it.

    A filter adds what motion and surroundings contribute: alone these figures would make it trust the gyroscope for
    minutes, and linear acceleration and local fields not at all little enough.
    """

    gyro_density: float = math.radians(0.014)
    """rad/s/sqrt(Hz); independent of the rate. Default: BMI055."""
    acc_std: float = 0.034
    """m/s2, one standard deviation of a sample of one axis. Default: BMI055 at 100 Hz."""
    mag_std: float = 1.2
    """uT, one standard deviation of a sample of one axis. Default: AK8963 at 50 Hz."""

    def __post_init__(self) -> None:
        require_positive(self)


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


def require_positive(params: Any) -> None:
    """Raise InvalidArgumentError unless every float of a params dataclass is finite and above 0."""
    for each in fields(params):
        value = getattr(params, each.name)
        if isinstance(value, float) and not (math.isfinite(value) and value > 0.0):
            raise InvalidArgumentError(f"{type(params).__name__}.{each.name} is {value}; give a finite number above 0")
