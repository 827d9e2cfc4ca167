"""What an app sees of a sensor and of its values."""

from dataclasses import replace

import numpy as np

from posed.events import ReportingMode, SensorInfo, SensorType
from posed.hal.quantisation import Quantiser, as_listed

_INFO = SensorInfo(4, SensorType.GYROSCOPE, "Gyroscope", "test", 1, 10.035, 0.02, 0.0, 5_000, 200_000)


def test_a_listed_sensor_has_whole_steps_and_some_power() -> None:
    listed = as_listed(_INFO)
    assert listed.max_range == 502 * 0.02
    assert listed.power_ma == 0.001
    trigger = replace(_INFO, type=SensorType.STEP_COUNTER, resolution=0.0, reporting_mode=ReportingMode.ON_CHANGE)
    assert as_listed(trigger).resolution == 1.0
    fine = as_listed(replace(_INFO, resolution=1e-12))
    assert fine.resolution == 2 * 10.035 / 2**24


def test_values_are_rounded_to_an_eighth_of_the_resolution() -> None:
    values = np.array([[1.23456, -0.00124, 0.00126]])
    assert Quantiser(replace(_INFO, resolution=0.01))(values).tolist() == [[988 * 0.00125, -0.00125, 0.00125]]


def test_the_bias_beside_uncalibrated_values_is_not_rounded() -> None:
    values = np.array([[0.0111, 0.0, 0.0, 0.0111, 0.0, 0.0]])
    quantise = Quantiser(replace(_INFO, type=SensorType.GYROSCOPE_UNCALIBRATED))
    assert quantise(values).tolist() == [[4 * 0.0025, 0.0, 0.0, 0.0111, 0.0, 0.0]]
    assert values[0, 0] == 0.0111


def test_fused_values_are_not_rounded() -> None:
    values = np.array([[0.0111, 0.0, 0.0]])
    assert Quantiser(replace(_INFO, type=SensorType.ROTATION_VECTOR))(values) is values
