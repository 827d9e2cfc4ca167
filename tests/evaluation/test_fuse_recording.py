"""A recording fused as fast as it goes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posed.errors import InvalidArgumentError
from posed.evaluation.fuse import fuse_recording
from posed.events import Pose, RateMode, SensorType
from posed.hal.profile import load_profile
from posed.hal.recording import Recording, in_time_order

_PROFILE = load_profile("patonis2018")
_START_NS = 5_000_000_000


def _recording(seconds: float = 3.0, seed: int = 0) -> Recording:
    rng = np.random.default_rng(seed)
    columns = {}
    for kind, hz, mean, std in (
        (SensorType.GYROSCOPE, 200, (0.0, 0.0, 0.3), 0.02),
        (SensorType.ACCELEROMETER, 100, (0.0, 0.0, 9.81), 0.1),
        (SensorType.MAGNETIC_FIELD, 50, (0.0, 22.0, -40.0), 0.5),
    ):
        count = int(seconds * hz)
        times = _START_NS + np.arange(count) * (1_000_000_000 // hz) + rng.integers(0, 1_000_000, count)
        columns[kind], _ = in_time_order(times, rng.normal(mean, std, (count, 3)))
    return Recording("made", columns, {})


def _poses(mode: RateMode, step_ns: int, pose_period_us: int = 100_000) -> list[Pose]:
    return list(
        fuse_recording(
            _recording(),
            _PROFILE,
            sampling_period_us=mode.sampling_period_us,
            pose_period_us=pose_period_us,
            step_ns=step_ns,
        )
    )


@settings(max_examples=20)
@given(
    st.sampled_from([RateMode.NORMAL, RateMode.UI, RateMode.GAME, RateMode.FASTEST]),
    st.integers(2_000_000, 5_000_000_000),
    st.sampled_from([5_000, 33_333, 100_000, 1_000_000]),
)
def test_the_step_decides_about_speed_alone(mode: RateMode, step_ns: int, pose_period_us: int) -> None:
    assert _poses(mode, step_ns, pose_period_us) == _poses(mode, 1_000_000_000, pose_period_us)


@pytest.mark.parametrize("mode", [RateMode.NORMAL, RateMode.UI, RateMode.GAME, RateMode.FASTEST])
def test_poses_stand_on_the_grid_to_the_end(mode: RateMode) -> None:
    poses = _poses(mode, 1_000_000_000)
    assert [pose.sequence for pose in poses] == list(range(poses[0].sequence, poses[-1].sequence + 1))
    assert poses[-1].sequence == 29
    assert {pose.rate_mode for pose in poses} == {mode}
    assert all((pose.instant_ns - poses[0].instant_ns) % 100_000_000 == 0 for pose in poses)


def test_a_filter_or_period_that_is_not_allowed_is_refused() -> None:
    with pytest.raises(InvalidArgumentError, match="no filter is named 'best'"):
        next(fuse_recording(_recording(), _PROFILE, sampling_period_us=0, filters=["best"]))
    with pytest.raises(InvalidArgumentError, match="pose period 1 us"):
        next(fuse_recording(_recording(), _PROFILE, sampling_period_us=0, pose_period_us=1))
