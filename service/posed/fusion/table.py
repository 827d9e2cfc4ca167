"""The filters by name."""

from collections.abc import Callable, Mapping
from importlib import import_module

from posed.errors import InvalidArgumentError
from posed.fusion.filter import OrientationFilter, SensorNoise


def make_filter(name: str, noise: SensorNoise | None = None) -> OrientationFilter:
    """Return a fresh filter; `noise` is that of the device profile, the default of SensorNoise without.

    Raises InvalidArgumentError when no filter has this name, MissingExtraError when its package is not installed.
    """
    maker = FILTERS.get(name) or _packaged(name)
    if maker is None:
        known = ", ".join(sorted({*FILTERS, *PACKAGED}))
        raise InvalidArgumentError(f"no filter is named {name!r}; choose one of {known}")
    return maker(noise if noise is not None else SensorNoise())


def _packaged(name: str) -> Callable[[SensorNoise], OrientationFilter] | None:
    if name not in PACKAGED:
        return None
    module, attribute = PACKAGED[name]
    maker: Callable[[SensorNoise], OrientationFilter] = getattr(import_module(module), attribute)
    return maker


# Each imports its filter when it is wanted: the compiled code of those that are not would stay in the daemon's memory.
def _dcm(noise: SensorNoise) -> OrientationFilter:
    from posed.fusion.dcm import DcmFilter, DcmParams

    return DcmFilter(DcmParams(noise=noise))


def _literal(noise: SensorNoise) -> OrientationFilter:
    from posed.fusion.dcm_literal import LiteralFilter, LiteralParams

    return LiteralFilter(LiteralParams(noise=noise))


def _adaptive(noise: SensorNoise) -> OrientationFilter:
    """The noise of the parts is far below what this filter reckons with, so it is not asked for."""
    from posed.fusion.adaptive import AdaptiveFilter

    return AdaptiveFilter()


def _game(noise: SensorNoise) -> OrientationFilter:
    from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams

    return AdaptiveFilter(AdaptiveParams(use_magnetometer=False), name="game")


def _geomag(noise: SensorNoise) -> OrientationFilter:
    from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams

    return AdaptiveFilter(AdaptiveParams(use_gyroscope=False), name="geomag")


DEFAULT_FILTER = "dcm-adaptive"

FILTERS: Mapping[str, Callable[[SensorNoise], OrientationFilter]] = {
    "dcm": _dcm,
    "dcm-adaptive": _adaptive,
    "dcm-literal": _literal,
    "game": _game,
    "geomag": _geomag,
}

PACKAGED: Mapping[str, tuple[str, str]] = {
    "vqf": ("posed.fusion.vqf_adapter", "VqfFilter"),
    "imufusion": ("posed.fusion.imufusion_adapter", "ImufusionFilter"),
}
"""Filters of other packages (extra `compare`), by the module and class that adapt them; imported when wanted."""
