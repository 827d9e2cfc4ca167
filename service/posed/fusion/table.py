"""The filters by name."""

from collections.abc import Callable, Mapping
from importlib import import_module

from posed.errors import InvalidArgumentError
from posed.fusion.filter import OrientationFilter, SensorErrors


def make_filter(name: str, errors: SensorErrors | None = None) -> OrientationFilter:
    """Return a fresh filter; `errors` are those of the device profile, SensorErrors' defaults without.

    Raises InvalidArgumentError when no filter has this name, MissingExtraError when its package is not installed.
    """
    maker = FILTERS.get(name) or _packaged(name)
    if maker is None:
        known = ", ".join(sorted({*FILTERS, *PACKAGED}))
        raise InvalidArgumentError(f"no filter is named {name!r}; choose one of {known}")
    return maker(errors if errors is not None else SensorErrors())


def _packaged(name: str) -> Callable[[SensorErrors], OrientationFilter] | None:
    if name not in PACKAGED:
        return None
    module, attribute = PACKAGED[name]
    maker: Callable[[SensorErrors], OrientationFilter] = getattr(import_module(module), attribute)
    return maker


# Each imports its filter when it is wanted: the compiled code of those that are not would stay in the daemon's memory.
def _dcm(errors: SensorErrors) -> OrientationFilter:
    from posed.fusion.dcm import DcmFilter, DcmParams

    return DcmFilter(DcmParams(noise=errors))


def _literal(errors: SensorErrors) -> OrientationFilter:
    from posed.fusion.dcm_literal import LiteralFilter, LiteralParams

    return LiteralFilter(LiteralParams(noise=errors))


def _adaptive(errors: SensorErrors) -> OrientationFilter:
    return _adaptive_form("dcm-adaptive", errors)


def _game(errors: SensorErrors) -> OrientationFilter:
    return _adaptive_form("game", errors, use_magnetometer=False)


def _geomag(errors: SensorErrors) -> OrientationFilter:
    return _adaptive_form("geomag", errors, use_gyroscope=False)


def _adaptive_form(
    name: str, errors: SensorErrors, *, use_gyroscope: bool = True, use_magnetometer: bool = True
) -> OrientationFilter:
    """The noise of the parts is far below what this filter reckons with; their delays it makes good."""
    from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams

    params = AdaptiveParams(
        gyro_delay_s=errors.gyro_delay_s,
        acc_delay_s=errors.acc_delay_s,
        mag_delay_s=errors.mag_delay_s,
        use_gyroscope=use_gyroscope,
        use_magnetometer=use_magnetometer,
    )
    return AdaptiveFilter(params, name=name)


DEFAULT_FILTER = "dcm-adaptive"

FILTERS: Mapping[str, Callable[[SensorErrors], OrientationFilter]] = {
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
