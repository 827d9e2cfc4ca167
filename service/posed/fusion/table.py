"""The filters by name."""

from collections.abc import Callable, Mapping

from posed.errors import InvalidArgumentError
from posed.fusion.dcm import DcmFilter, DcmParams
from posed.fusion.filter import OrientationFilter, SensorNoise


def make_filter(name: str, noise: SensorNoise | None = None) -> OrientationFilter:
    """Return a fresh filter; `noise` is that of the device profile, the default of SensorNoise without.

    Raises InvalidArgumentError when no filter has this name.
    """
    maker = FILTERS.get(name)
    if maker is None:
        raise InvalidArgumentError(f"no filter is named {name!r}; choose one of {', '.join(sorted(FILTERS))}")
    return maker(noise if noise is not None else SensorNoise())


def _dcm(noise: SensorNoise) -> OrientationFilter:
    return DcmFilter(DcmParams(noise=noise))


FILTERS: Mapping[str, Callable[[SensorNoise], OrientationFilter]] = {"dcm": _dcm}
