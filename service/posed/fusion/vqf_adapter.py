"""VQF (Laidig and Seel 2023), as the package `vqf` has it, with its defaults: to compare with."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posed.errors import InvalidArgumentError, MissingExtraError
from posed.events import FilterStatus, FlatEvent, Float64Array, SensorType
from posed.fusion.filter import SensorErrors
from posed.fusion.paced import UNKNOWN_BIAS, PacedFilter, Periods

try:
    from vqf import VQF
except ImportError as error:
    raise MissingExtraError(
        "the filter 'vqf' needs the package vqf; install it with: pip install 'posed[compare]'"
    ) from error

_ACCELEROMETER = int(SensorType.ACCELEROMETER)


class VqfFilter(PacedFilter):
    """VQF's 9D orientation. Its state can be read and set, so it can be saved and restored."""

    name = "vqf"

    def __init__(self, noise: SensorErrors | None = None) -> None:
        """Take no account of `noise`: VQF's defaults are meant for all sensors."""
        super().__init__()
        self._vqf: Any = None

    def update_synchronous(
        self, period_s: float, rate: Float64Array, acceleration: Float64Array, field: Float64Array
    ) -> None:
        """Take whole arrays in one call, as VQF's compiled batch form does."""
        VQF(period_s).updateBatch(rate, acceleration, field)

    def gyro_bias(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return VQF's bias and its deviations, rad/s: the largest of the three stands for all, as VQF states it."""
        if self._vqf is None:
            return UNKNOWN_BIAS
        (x, y, z), std = self._vqf.getBiasEstimate()
        return (float(x), float(y), float(z)), (float(std), float(std), float(std))

    def save(self) -> dict[str, Any]:
        """Return the state of VQF and of what is held for it, as values that JSON can hold."""
        state = None if self._vqf is None else _without_nan(self._vqf.state)
        return {"filter": self.name, "vqf": state, "state": self._saved()}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue from what `save` returned; raises InvalidArgumentError for anything else."""
        if saved.get("filter") != self.name:
            raise InvalidArgumentError(
                f"the saved state is of filter {saved.get('filter')!r}; restore it into that one, not {self.name!r}"
            )
        state = self._restored(saved.get("state"))
        vqf = None
        if saved.get("vqf") is not None:
            try:
                vqf = VQF(*state.periods)
                vqf.state = _with_nan(saved["vqf"])
            except (TypeError, ValueError, KeyError, AttributeError) as error:
                raise InvalidArgumentError(f"the saved state is none of VQF ({error}); start it afresh") from error
        self._state = state
        self._vqf = vqf

    def _set_periods(self, periods: Periods) -> None:
        fresh = VQF(periods.gyro, periods.acc, periods.mag)
        if self._vqf is not None:
            fresh.state = self._vqf.state
        self._vqf = fresh

    def _step(self, before: Sequence[FlatEvent], rate: FlatEvent, after: Sequence[FlatEvent]) -> None:
        for event in before:
            self._measure(event)
        self._vqf.updateGyr(np.array(rate[2:]))
        for event in after:
            self._measure(event)

    def _measure(self, event: FlatEvent) -> None:
        update = self._vqf.updateAcc if event[0] == _ACCELEROMETER else self._vqf.updateMag
        update(np.array(event[2:]))

    def _answer(self) -> tuple[tuple[float, ...], tuple[float, ...], FilterStatus]:
        status = FilterStatus.OK
        if self._vqf.getRestDetected():
            status |= FilterStatus.AT_REST
        if self._vqf.getMagDistDetected():
            status |= FilterStatus.MAGNETIC_DISTURBANCE
        bias, _ = self._vqf.getBiasEstimate()
        return tuple(self._vqf.getQuat9D().tolist()), tuple(bias.tolist()), status


def _without_nan(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _without_nan(each) for name, each in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_without_nan(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _with_nan(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _with_nan(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_with_nan(each) for each in value]
    return math.nan if value is None else value
