"""The filters by name, and what they are told."""

import math

import pytest

from posed.errors import InvalidArgumentError
from posed.fusion import FILTERS, SensorErrors, make_filter
from posed.fusion.adaptive import AdaptiveFilter
from posed.fusion.dcm import DcmFilter, DcmParams
from posed.fusion.gate import GateParams
from posed.fusion.rest import RestParams


@pytest.mark.parametrize("name", sorted(FILTERS))
def test_every_named_filter_is_made_fresh(name: str) -> None:
    one, other = make_filter(name), make_filter(name)
    assert one.name == name
    assert one is not other
    assert one.orientation() is None


def test_the_noise_reaches_the_filter() -> None:
    noise = SensorErrors(gyro_density=1e-3, acc_std=0.1, mag_std=0.5)
    dcm = make_filter("dcm", noise)
    assert isinstance(dcm, DcmFilter)
    assert dcm.params == DcmParams(noise=noise)


@pytest.mark.parametrize("name", ["dcm-adaptive", "game", "geomag"])
def test_the_delays_reach_the_filters_that_make_them_good(name: str) -> None:
    adaptive = make_filter(name, SensorErrors(gyro_delay_s=0.0, acc_delay_s=0.001, mag_delay_s=0.002))
    assert isinstance(adaptive, AdaptiveFilter)
    params = adaptive.params
    assert (params.gyro_delay_s, params.acc_delay_s, params.mag_delay_s) == (0.0, 0.001, 0.002)
    with pytest.raises(InvalidArgumentError, match="acc_delay_s"):
        SensorErrors(acc_delay_s=-0.001)


def test_an_unknown_name_lists_the_names() -> None:
    with pytest.raises(InvalidArgumentError, match=r"'kalman'.*\bdcm\b"):
        make_filter("kalman")


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_parameters_without_meaning_are_refused(value: float) -> None:
    with pytest.raises(InvalidArgumentError, match="acc_std"):
        SensorErrors(acc_std=value)
    with pytest.raises(InvalidArgumentError, match="field_density"):
        DcmParams(field_density=value)
    with pytest.raises(InvalidArgumentError, match="settle_s"):
        RestParams(settle_s=value)
    with pytest.raises(InvalidArgumentError, match="norm_tolerance"):
        GateParams(norm_tolerance=value)
