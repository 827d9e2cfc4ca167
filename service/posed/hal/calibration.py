"""A sensor's calibration: what turns raw readings into calibrated ones."""

from dataclasses import dataclass, field

import numpy as np

from posed.events import Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """calibrated = matrix @ (raw - bias).

    bias: float64[3], the sensor's own unit (a magnetometer's hard iron). matrix: float64[3, 3], regular (scale and
    misalignment; a magnetometer's soft iron).
    """

    bias: Float64Array = field(default_factory=lambda: np.zeros(3))
    matrix: Float64Array = field(default_factory=lambda: np.eye(3))
    is_identity: bool = field(init=False)
    """True when raw and calibrated readings are the same."""

    def __post_init__(self) -> None:
        identity = not self.bias.any() and np.array_equal(self.matrix, np.eye(3))
        object.__setattr__(self, "is_identity", bool(identity))

    def apply(self, raw: Float64Array) -> Float64Array:
        """Return the calibrated readings of `raw` (float64[n, 3]); `raw` itself when there is nothing to correct."""
        if self.is_identity:
            return raw
        return (raw - self.bias) @ self.matrix.T

    def invert(self, calibrated: Float64Array) -> Float64Array:
        """Return the raw readings (float64[n, 3]) that `apply` turns into `calibrated`."""
        if self.is_identity:
            return calibrated
        return np.linalg.solve(self.matrix, calibrated.T).T + self.bias
