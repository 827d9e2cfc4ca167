"""The AHRS algorithm of x-io's Fusion, as the package `imufusion` has it, to compare with.

With its rejection of acceleration and magnetic disturbance and its bias correction, at the settings of its own example.
"""

from collections.abc import Mapping, Sequence
from math import radians, sqrt
from typing import Any

import numpy as np

from posed.errors import InvalidStateError, MissingExtraError
from posed.events import STANDARD_GRAVITY, FilterStatus, FlatEvent, Float64Array, SensorType
from posed.fusion.filter import SensorErrors
from posed.fusion.paced import UNKNOWN_BIAS, PacedFilter, Periods

try:
    import imufusion
except ImportError as error:
    raise MissingExtraError(
        "the filter 'imufusion' needs the package imufusion; install it with: pip install 'posed[compare]'"
    ) from error

_QUARTER = sqrt(0.5)
_ACCELEROMETER = int(SensorType.ACCELEROMETER)
_GAIN = 0.5
_RANGE_DEG_S = 2000.0
_REJECTION_DEG = 10.0
_REJECTION_TIMEOUT_S = 5.0


class ImufusionFilter(PacedFilter):
    """Fusion's AHRS. The package keeps its state to itself, so it can be neither saved nor restored."""

    name = "imufusion"

    def __init__(self, noise: SensorErrors | None = None) -> None:
        """Take no account of `noise`: the package has no such setting."""
        super().__init__()
        self._ahrs: Any = None
        self._bias: Any = None
        self._acceleration = np.zeros(3)
        self._field = np.zeros(3)

    def update_synchronous(
        self, period_s: float, rate: Float64Array, acceleration: Float64Array, field: Float64Array
    ) -> None:
        """Take the samples one by one, without this adapter: the package has no batch form."""
        self._set_periods(Periods(period_s, period_s, period_s))
        correct, update = self._bias.update, self._ahrs.update
        samples = zip(np.degrees(rate), acceleration / STANDARD_GRAVITY, field, strict=True)
        for rate_deg_s, acceleration_g, field_ut in samples:
            update(correct(rate_deg_s), acceleration_g, field_ut)

    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the offset that Fusion takes off, rad/s; it states no deviations: NaN."""
        if self._bias is None:
            return UNKNOWN_BIAS
        x, y, z = (radians(each) for each in self._bias.get_offset().tolist())
        return (x, y, z), UNKNOWN_BIAS[1]

    def save(self) -> dict[str, Any]:
        """Raise InvalidStateError: the state cannot be read."""
        raise InvalidStateError("imufusion gives no access to its state; save another filter, such as dcm or vqf")

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Raise InvalidStateError: the state cannot be set."""
        raise InvalidStateError("imufusion gives no access to its state; restore another filter, such as dcm or vqf")

    def _set_periods(self, periods: Periods) -> None:
        if self._ahrs is None:
            self._ahrs = imufusion.Ahrs()
            self._bias = imufusion.Bias()
        rate_hz = 1.0 / periods.gyro
        self._ahrs.set_settings(
            imufusion.AhrsSettings(
                sample_rate=rate_hz,
                convention=imufusion.CONVENTION_NWU,
                gain=_GAIN,
                gyroscope_range=_RANGE_DEG_S,
                acceleration_rejection=_REJECTION_DEG,
                magnetic_rejection=_REJECTION_DEG,
                rejection_timeout=_REJECTION_TIMEOUT_S,
            )
        )
        self._bias.set_settings(imufusion.BiasSettings(sample_rate=rate_hz))

    def _step(self, before: Sequence[FlatEvent], rate: FlatEvent, after: Sequence[FlatEvent]) -> None:
        # It has one step for all three sensors: the last sample of each stands until the next.
        for event in (*before, *after):
            self._measure(event)
        unbiased = self._bias.update(np.degrees(np.array(rate[2:])))
        self._ahrs.update(unbiased, self._acceleration, self._field)

    def _measure(self, event: FlatEvent) -> None:
        if event[0] == _ACCELEROMETER:
            self._acceleration = np.array(event[2:]) / STANDARD_GRAVITY
        else:
            self._field = np.array(event[2:])

    def _answer(self) -> tuple[tuple[float, ...], tuple[float, ...], FilterStatus]:
        status = FilterStatus.OK
        flags = self._ahrs.get_flags()
        if flags.startup:
            status |= FilterStatus.INITIALISING
        if self._ahrs.get_internal_states().magnetometer_ignored:
            status |= FilterStatus.MAGNETIC_DISTURBANCE
        bias = tuple(radians(each) for each in self._bias.get_offset().tolist())
        # A quarter turn about the vertical makes north, west, up into east, north, up. The package's own ENU reads the
        # magnetic field as pointing east: its headings are 90 degrees off.
        w, x, y, z = (_QUARTER * each for each in self._ahrs.get_quaternion().tolist())
        return (w - z, x - y, x + y, w + z), bias, status
