"""What holds for any stream of events, however bad: cuts, saves and the origin of time do not change a bit."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_phone import FASTEST, GAME, FlatEvents, rotation, sense

from posed.errors import InvalidArgumentError
from posed.events import SensorType
from posed.fusion.dcm import DcmFilter
from posed.fusion.dcm_literal import LiteralFilter
from posed.fusion.dcm_literal_state import LiteralState
from posed.fusion.dcm_state import DcmState

Kind = type[DcmFilter] | type[LiteralFilter]
both = pytest.mark.parametrize("kind", [DcmFilter, LiteralFilter])
KINDS = np.array([SensorType.ACCELEROMETER, SensorType.MAGNETIC_FIELD, SensorType.GYROSCOPE], np.int64)


@st.composite
def streams(draw: st.DrawFn) -> FlatEvents:
    """Events of a moving phone, with gaps, disorder, duplicates, NaN, free fall, magnets and lost sensors thrown in."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    count = draw(st.integers(1, 400))
    kinds = rng.choice(KINDS, count, p=draw(st.sampled_from([(0.3, 0.2, 0.5), (0.5, 0.5, 0.0), (0.4, 0.2, 0.4)])))
    steps = rng.integers(0, 10_000_000, count)
    odd = rng.random(count)
    steps[odd < 0.05] = rng.integers(-20_000_000, 0, (odd < 0.05).sum())
    steps[odd > 0.99] = draw(st.sampled_from([700_000_000, 30_000_000_000, -2_000_000_000]))
    start = draw(st.sampled_from([0, -5_000_000_000, 2**61]))
    values = rng.normal(0.0, 1.0, (count, 3))
    values[kinds == SensorType.ACCELEROMETER] += (0.0, 5.0, 8.0)
    values[kinds == SensorType.MAGNETIC_FIELD] = values[kinds == SensorType.MAGNETIC_FIELD] * 3.0 + (5.0, 20.0, -40.0)
    values[rng.random(count) < 0.02] = np.nan
    values[rng.random(count) < 0.02] = 0.0
    values[rng.random(count) < 0.05] *= 4.0
    return FlatEvents(kinds, start + np.cumsum(steps), values)


@both
@settings(deadline=None, max_examples=60)
@given(events=streams(), cuts=st.lists(st.integers(0, 400), max_size=8))
def test_cuts_do_not_change_a_bit(kind: Kind, events: FlatEvents, cuts: list[int]) -> None:
    whole = kind()
    whole.update_batch(events)
    cut = kind()
    edges = [0, *sorted(min(c, len(events)) for c in cuts), len(events)]
    for start, end in itertools.pairwise(edges):
        cut.update_batch(events[start:end])
        cut.orientation()
    single = kind()
    for k in range(len(events)):
        single.update(SensorType(events.sensor_type[k]), events.timestamp_ns[k], *events.values[k])
    assert cut.state == whole.state
    assert single.state == whole.state
    assert cut.orientation() == whole.orientation() == single.orientation()


@both
@settings(deadline=None, max_examples=60)
@given(events=streams(), at=st.integers(0, 400))
def test_saving_in_the_middle_does_not_change_a_bit(kind: Kind, events: FlatEvents, at: int) -> None:
    whole = kind()
    whole.update_batch(events[:at])
    restored = kind()
    restored.restore(json.loads(json.dumps(whole.save(), allow_nan=False)))
    assert restored.state == whole.state
    whole.update_batch(events[at:])
    restored.update_batch(events[at:])
    assert restored.state == whole.state
    assert restored.orientation() == whole.orientation()


@both
@settings(deadline=None, max_examples=60)
@given(events=streams())
def test_the_state_stays_finite_and_the_answer_a_rotation(kind: Kind, events: FlatEvents) -> None:
    one = kind()
    one.update_batch(events)
    json.dumps(one.save(), allow_nan=False)
    answer = one.orientation()
    if answer is not None:
        assert np.linalg.norm(answer.quaternion) == pytest.approx(1.0)
        assert answer.quaternion[3] >= 0.0
        assert 0.0 < answer.heading_accuracy <= np.pi / np.sqrt(3)


@settings(deadline=None, max_examples=60)
@given(streams())
def test_the_matrix_stays_a_rotation(events: FlatEvents) -> None:
    dcm = DcmFilter()
    dcm.update_batch(events)
    c = dcm.state.matrix
    rows = np.array([[c.east_x, c.east_y, c.east_z], [c.north_x, c.north_y, c.north_z], [c.up_x, c.up_y, c.up_z]])
    assert rows @ rows.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rows) == pytest.approx(1.0)
    assert dcm.state.tilt_variance >= 0.0
    assert dcm.state.heading_variance >= 0.0


@both
@pytest.mark.parametrize("start_ns", [-(2**40), -1_000_000_000, 2**61])
def test_the_origin_of_time_does_not_matter(kind: Kind, start_ns: int) -> None:
    def attitude(t: float) -> np.ndarray:
        return rotation(0.3 * np.sin(t), 0.2 * t, 0.1)

    here = kind()
    here.update_batch(sense(attitude, 3.0, FASTEST))
    there = kind()
    there.update_batch(sense(attitude, 3.0, FASTEST, start_ns=start_ns))
    one, other = here.orientation(), there.orientation()
    assert one is not None
    assert other is not None
    assert other.quaternion == one.quaternion
    assert other.heading_accuracy == one.heading_accuracy
    assert other.timestamp_ns == one.timestamp_ns + start_ns


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (lambda saved: saved.update(filter="ukf"), "'ukf'"),
        (lambda saved: saved.pop("state"), "state is None"),
        (lambda saved: saved["state"].pop("tilt_variance"), "tilt_variance"),
        (lambda saved: saved["state"].update(extra=1), "extra"),
        (lambda saved: saved["state"].update(tilt_variance="much"), "'much'"),
        (lambda saved: saved["state"].update(tilt_variance=float("nan")), "nan"),
        (lambda saved: saved["state"]["matrix"].update(up_x=1), r"matrix\.up_x is 1"),
        (lambda saved: saved["state"].update(held=[[1, 2, 3.0]]), "held"),
        (lambda saved: saved["state"].update(held=None), "held"),
    ],
)
def test_a_spoilt_save_is_refused_and_leaves_the_filter_alone(spoil, named) -> None:  # type: ignore[no-untyped-def]
    dcm = DcmFilter()
    dcm.update_batch(sense(lambda t: np.eye(3), 1.0, GAME))
    before = dcm.save()
    saved = dcm.save()
    spoil(saved)
    with pytest.raises(InvalidArgumentError, match=named):
        dcm.restore(saved)
    assert dcm.save() == before


def test_equal_streams_give_equal_states() -> None:
    assert DcmFilter().state == DcmFilter().state
    assert DcmFilter().state != DcmState()
    assert LiteralFilter().state == LiteralState()
