"""The filters by name."""

from collections.abc import Callable, Mapping

from posed.errors import InvalidArgumentError
from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams
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


def _adaptive(noise: SensorNoise) -> OrientationFilter:
    """The noise of the parts is far below what this filter reckons with, so it is not asked for."""
    return AdaptiveFilter()


def _game(noise: SensorNoise) -> OrientationFilter:
    return AdaptiveFilter(AdaptiveParams(use_magnetometer=False), name="game")


def _geomag(noise: SensorNoise) -> OrientationFilter:
    return AdaptiveFilter(AdaptiveParams(use_gyroscope=False), name="geomag")


FILTERS: Mapping[str, Callable[[SensorNoise], OrientationFilter]] = {
    "dcm": _dcm,
    "dcm-adaptive": _adaptive,
    "game": _game,
    "geomag": _geomag,
}
