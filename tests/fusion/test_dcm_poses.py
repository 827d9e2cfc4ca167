"""Poses that are known: Android's, the paper's Table 3, every octant, and turns through the singular ones."""

import itertools

import numpy as np
import pytest
from synthetic_phone import FIELD, GRAVITY, error_deg, matrix, rotation, rotation_vector, sense

from posed.events import FilterStatus, Float64Array, SensorType
from posed.fusion import make_filter
from posed.fusion.dcm import DcmFilter
from posed.fusion.filter import OrientationFilter

HALF = np.sqrt(0.5)

# SensorManager.getRotationMatrix over a field of 22 uT north and 42 uT down; readings to the printed digit.
GOLDEN = {
    "flat, top north": ((0, 0, 9.81), (0, 22, -42), (0, 0, 0, 1)),
    "flat, top east": ((0, 0, 9.81), (-22, 0, -42), (0, 0, -HALF, HALF)),
    "flat, top south": ((0, 0, 9.81), (0, -22, -42), (0, 0, 1, 0)),
    "flat, top west": ((0, 0, 9.81), (22, 0, -42), (0, 0, HALF, HALF)),
    "upright, camera north": ((0, 9.81, 0), (0, -42, -22), (HALF, 0, 0, HALF)),
    "top edge raised 30": ((0, 4.9, 8.5), (0, -1.9, -47.4), (0.2588, 0, 0, 0.9659)),
    "top edge lowered 30": ((0, -4.9, 8.5), (0, 40.1, -25.4), (-0.2588, 0, 0, 0.9659)),
    "right edge lowered 30": ((-4.9, 0, 8.5), (21, 22, -36.4), (0, 0.2588, 0, 0.9659)),
    "left edge lowered 30": ((4.9, 0, 8.5), (-21, 22, -36.4), (0, -0.2588, 0, 0.9659)),
    "face down, top north": ((0, 0, -9.81), (0, 22, 42), (0, 1, 0, 0)),
    "landscape, x up, screen south": ((9.81, 0, 0), (-42, 0, -22), (0.5, -0.5, 0.5, 0.5)),
}

# Patonis 2018, Table 3: R11 R21 R31 R12 R22 R32 R13 R23 R33, eight stations of a turn about each axis.
TABLE_3 = """
-0.9677 -0.2519  0.0075  0.2520 -0.9677  0.0016  0.0069  0.0034  1.0000
-0.9666 -0.2564  0.0047  0.2043 -0.7588  0.6184 -0.1550  0.5987  0.7858
-0.9712 -0.2379  0.0100  0.0324 -0.0907  0.9953 -0.2359  0.9670  0.0958
-0.9648 -0.2629  0.0087 -0.1361  0.5273  0.8387 -0.2251  0.8080 -0.5446
-0.9658 -0.2592  0.0089 -0.2592  0.9658 -0.0031 -0.0078 -0.0053 -1.0000
-0.9621 -0.2724 -0.0124 -0.2100  0.7690 -0.6038  0.1740 -0.5783 -0.7971
-0.9678 -0.2516  0.0068 -0.0076  0.0021 -1.0000  0.2516 -0.9678 -0.0040
-0.9609 -0.2767  0.0093  0.1981 -0.7106 -0.6751  0.1934 -0.6469  0.7376
-0.9781 -0.2078  0.0101  0.2079 -0.9782 -0.0007  0.0100  0.0014  0.9999
-0.7457 -0.1457  0.6501  0.1863 -0.9825 -0.0065  0.6397  0.1163  0.7598
-0.0274 -0.0149  0.9995  0.2218 -0.9751 -0.0085  0.9747  0.2214  0.0300
 0.5493  0.0849  0.8313  0.1682 -0.9857 -0.0105  0.8185  0.1456 -0.5557
 0.9734  0.2285  0.0137  0.2287 -0.9735 -0.0088  0.0113  0.0117 -0.9999
 0.6635  0.1952 -0.7223  0.2716 -0.9624 -0.0107 -0.6972 -0.1891 -0.6915
-0.0141  0.0002 -0.9999  0.2889 -0.9574 -0.0042 -0.9573 -0.2889  0.0134
-0.7845 -0.1990 -0.5873  0.2443 -0.9697  0.0022 -0.5700 -0.1418  0.8094
-0.9722 -0.2340  0.0077  0.2340 -0.9722 -0.0020  0.0080 -0.0001  1.0000
-0.8729  0.4878  0.0108 -0.4878 -0.8730  0.0022  0.0105 -0.0034  0.9999
-0.3076  0.9515  0.0100 -0.9515 -0.3076 -0.0037 -0.0005 -0.0107  0.9999
 0.4668  0.8841  0.0221 -0.8842  0.4671 -0.0087 -0.0180 -0.0154  0.9997
 0.9621  0.2717  0.0233 -0.2718  0.9624  0.0025 -0.0218 -0.0088  0.9997
 0.8910 -0.4536  0.0194  0.4537  0.8912  0.0014 -0.0179  0.0075  0.9998
 0.3463 -0.9380  0.0186  0.9380  0.3464  0.0072 -0.0132  0.0150  0.9998
-0.4209 -0.9071  0.0099  0.9071 -0.4208  0.0092 -0.0042  0.0128  0.9999
"""


def table_3() -> list[Float64Array]:
    """Return the printed matrices, made orthonormal again by their polar factor."""
    printed = [np.array(line.split(), float).reshape(3, 3).T for line in TABLE_3.strip().splitlines()]
    factors = [np.linalg.svd(m) for m in printed]
    return [u @ vt for u, _, vt in factors]


def stand(
    dcm: OrientationFilter, acceleration: Float64Array, field: Float64Array, seconds: float, start_ns: int = 0
) -> None:
    """Feed a phone that does not turn, at 50 Hz."""
    for k in range(round(seconds * 50) + 1):
        t = start_ns + k * 20_000_000
        dcm.update(SensorType.ACCELEROMETER, t, *acceleration)
        dcm.update(SensorType.MAGNETIC_FIELD, t, *field)
        dcm.update(SensorType.GYROSCOPE, t, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("pose", GOLDEN)
def test_android_pose(pose: str) -> None:
    acceleration, field, quaternion = GOLDEN[pose]
    dcm = DcmFilter()
    stand(dcm, np.array(acceleration, float), np.array(field, float), 0.0)
    assert error_deg(dcm, matrix(quaternion)) < 0.15
    stand(dcm, np.array(acceleration, float), np.array(field, float), 5.0, 20_000_000)
    assert error_deg(dcm, matrix(quaternion)) < 0.15
    answer = dcm.orientation()
    assert answer is not None
    assert answer.quaternion[3] >= 0.0
    assert np.linalg.norm(answer.quaternion) == pytest.approx(1.0, abs=1e-15)
    assert answer.status == FilterStatus.AT_REST


@pytest.mark.parametrize("name", ["dcm", "dcm-literal"])
@pytest.mark.parametrize("row", range(24))
def test_table_3(row: int, name: str) -> None:
    truth = table_3()[row]
    assert np.linalg.det(truth) == pytest.approx(1.0)
    dcm = make_filter(name)
    stand(dcm, truth.T @ (0.0, 0.0, GRAVITY), truth.T @ FIELD, 1.0)
    assert error_deg(dcm, truth) < 0.1


@pytest.mark.parametrize("axis", range(3))
def test_turning_through_table_3_returns_each_station(axis: int) -> None:
    stations = table_3()[8 * axis : 8 * axis + 8]
    turns = [rotation_vector(a.T @ b) for a, b in itertools.pairwise(stations)]

    def attitude(t: float) -> Float64Array:
        k = min(max(int(t), 0), 6)
        return stations[k] @ rotation(*(turns[k] * min(max(t - k, 0.0), 1.0)))

    events = sense(attitude, 7.0)
    seconds = events.timestamp_ns * 1e-9
    dcm = DcmFilter()
    for k in range(1, 8):
        dcm.update_batch(events[np.searchsorted(seconds, k - 1, "right") : np.searchsorted(seconds, k, "right")])
        assert error_deg(dcm, stations[k]) < 0.1


@pytest.mark.parametrize("up", [up for up in itertools.product((-1, 0, 1), repeat=3) if any(up)])
def test_every_way_up_is_found_and_converged_to(up: tuple[int, int, int]) -> None:
    row_3 = np.array(up) / np.linalg.norm(up)
    least = np.eye(3)[np.argmin(np.abs(row_3))]
    east = np.cross(least, row_3) / np.linalg.norm(np.cross(least, row_3))
    for heading in range(0, 360, 45):
        truth = rotation(0, 0, np.radians(heading)) @ np.array([east, np.cross(row_3, east), row_3])
        dcm = DcmFilter()
        stand(dcm, truth.T @ (0.0, 0.0, GRAVITY), truth.T @ FIELD, 0.0)
        assert error_deg(dcm, truth) < 1e-6


@pytest.mark.parametrize("wrong", [(0.5, 0, 0), (0, 0.5, 0), (0, 0, 1.0), (0, 0, -2.5), (1.0, 1.0, 0)])
def test_an_unmeasured_turn_is_corrected(wrong: tuple[float, float, float]) -> None:
    dcm = DcmFilter()
    stand(dcm, np.array([0.0, 0.0, GRAVITY]), FIELD, 5.0)
    truth = rotation(*wrong)
    stand(dcm, truth.T @ (0.0, 0.0, GRAVITY), truth.T @ FIELD, 120.0, 5_020_000_000)
    assert error_deg(dcm, truth) < 1.0


@pytest.mark.parametrize("spin", [(1.5, 0, 0), (0, 1.5, 0), (0, 0, 1.5), (0.9, -0.9, 0.9)])
@pytest.mark.parametrize("first", [(0, 0, 0.3), (np.pi / 2, 0, 0), (0, np.pi / 2, 0), (0, -np.pi / 2, 0.7)])
def test_no_flip_turning_through_singular_orientations(
    spin: tuple[float, float, float], first: tuple[float, float, float]
) -> None:
    start = rotation(*first)
    events = sense(lambda t: start @ rotation(*(np.array(spin) * t)), 9.0)
    dcm = DcmFilter()
    worst = 0.0
    for k in range(0, len(events), 7):
        dcm.update_batch(events[k : k + 7])
        answer = dcm.orientation()
        if answer is not None:
            truth = start @ rotation(*(np.array(spin) * answer.timestamp_ns * 1e-9))
            worst = max(worst, error_deg(dcm, truth))
    assert worst < 0.01
