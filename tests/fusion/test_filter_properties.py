"""What holds for any stream of events, however bad: cuts, saves and the origin of time do not change a bit."""

import itertools
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_phone import FASTEST, GAME, FlatEvents, rotation, sense

from posed.errors import InvalidArgumentError
from posed.events import Float64Array, SensorType
from posed.fusion import FILTERS, make_filter
from posed.fusion.dcm import DcmFilter
from posed.fusion.direction_cosines import DirectionCosines
from posed.fusion.event_arrays import MAX_HELD

every_filter = pytest.mark.parametrize("name", FILTERS)
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


def fresh(name: str) -> Any:
    """Return a filter by name, with its state, which the protocol keeps to itself."""
    return make_filter(name)


@every_filter
@settings(max_examples=40)
@given(events=streams(), cuts=st.lists(st.integers(0, 400), max_size=8))
def test_cuts_do_not_change_a_bit(name: str, events: FlatEvents, cuts: list[int]) -> None:
    whole = fresh(name)
    whole.update_batch(events)
    cut = fresh(name)
    edges = [0, *sorted(min(c, len(events)) for c in cuts), len(events)]
    for start, end in itertools.pairwise(edges):
        cut.update_batch(events[start:end])
        cut.orientation()
    single = fresh(name)
    for k in range(len(events)):
        single.update(SensorType(events.sensor_type[k]), events.timestamp_ns[k], *events.values[k])
    assert cut.state == whole.state
    assert single.state == whole.state
    assert cut.orientation() == whole.orientation() == single.orientation()


@every_filter
@settings(max_examples=40)
@given(events=streams(), at=st.integers(0, 400))
def test_saving_in_the_middle_does_not_change_a_bit(name: str, events: FlatEvents, at: int) -> None:
    whole = fresh(name)
    whole.update_batch(events[:at])
    restored = fresh(name)
    restored.restore(json.loads(json.dumps(whole.save(), allow_nan=False)))
    assert restored.state == whole.state
    whole.update_batch(events[at:])
    restored.update_batch(events[at:])
    assert restored.state == whole.state
    assert restored.orientation() == whole.orientation()


@every_filter
@settings(max_examples=40)
@given(events=streams())
def test_the_state_stays_finite_and_the_answer_a_rotation(name: str, events: FlatEvents) -> None:
    one = fresh(name)
    one.update_batch(events)
    json.dumps(one.save(), allow_nan=False)
    answer = one.orientation()
    if answer is not None:
        assert np.linalg.norm(answer.quaternion) == pytest.approx(1.0)
        assert answer.quaternion[3] >= 0.0
        assert 0.0 < answer.heading_accuracy <= np.pi / np.sqrt(3)


def rows(c: DirectionCosines) -> Float64Array:
    return np.array([[c.east_x, c.east_y, c.east_z], [c.north_x, c.north_y, c.north_z], [c.up_x, c.up_y, c.up_z]])


@settings(max_examples=60)
@given(streams())
def test_the_matrix_of_dcm_stays_a_rotation(events: FlatEvents) -> None:
    dcm = DcmFilter()
    dcm.update_batch(events)
    matrix = rows(dcm.state.matrix)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert dcm.state.tilt_variance >= 0.0
    assert dcm.state.heading_variance >= 0.0


@pytest.mark.parametrize("name", ["dcm-adaptive", "game", "geomag"])
@settings(max_examples=40)
@given(events=streams())
def test_the_matrix_of_dcm_adaptive_stays_a_rotation_and_its_bias_in_bounds(name: str, events: FlatEvents) -> None:
    adaptive = fresh(name)
    adaptive.update_batch(events)
    matrix = rows(adaptive.state.matrix)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert np.hypot(adaptive.state.heading.north_x, adaptive.state.heading.north_y) == pytest.approx(1.0)
    bias, std = adaptive.gyro_bias()
    assert max(map(abs, bias)) <= adaptive.params.bias.limit
    assert min(std) >= 0.0


@pytest.mark.parametrize("name", ["dcm", "dcm-adaptive", "dcm-literal"])
@pytest.mark.parametrize("start_ns", [-(2**40), -1_000_000_000, 2**61])
def test_the_origin_of_time_does_not_matter(name: str, start_ns: int) -> None:
    def attitude(t: float) -> np.ndarray:
        return rotation(0.3 * np.sin(t), 0.2 * t, 0.1)

    here, there = fresh(name), fresh(name)
    here.update_batch(sense(attitude, 3.0, FASTEST))
    there.update_batch(sense(attitude, 3.0, FASTEST, start_ns=start_ns))
    one, other = here.orientation(), there.orientation()
    assert one is not None
    assert other is not None
    assert other.quaternion == one.quaternion
    assert other.heading_accuracy == one.heading_accuracy
    assert other.timestamp_ns == one.timestamp_ns + start_ns


@pytest.mark.parametrize(
    ("name", "spoil", "named"),
    [
        ("dcm", lambda saved: saved.update(filter="ukf"), "'ukf'"),
        ("dcm", lambda saved: saved.pop("state"), "state is None"),
        ("dcm", lambda saved: saved["state"].update(extra=1), "extra"),
        ("dcm", lambda saved: saved["state"].update(held=[[1, 2, 3.0]]), "held"),
        ("dcm-adaptive", lambda saved: saved.update(filter="ukf"), "'ukf'"),
        ("dcm-adaptive", lambda saved: saved.pop("state"), "state is None"),
        ("dcm-adaptive", lambda saved: saved["state"].update(extra=1), "extra"),
        ("dcm-adaptive", lambda saved: saved["state"].update(held=[[1, 2, 3.0]]), "held"),
        ("dcm", lambda saved: saved["state"].pop("tilt_variance"), "tilt_variance"),
        ("dcm", lambda saved: saved["state"].update(tilt_variance="much"), "'much'"),
        ("dcm", lambda saved: saved["state"].update(tilt_variance=float("nan")), "nan"),
        ("dcm", lambda saved: saved["state"]["matrix"].update(up_x=1), r"matrix\.up_x is 1"),
        ("dcm", lambda saved: saved["state"].update(held=None), "held"),
        ("dcm-adaptive", lambda saved: saved["state"]["tilt"].pop("age_s"), "age_s"),
        ("dcm-adaptive", lambda saved: saved["state"]["heading"].update(variance=float("nan")), "nan"),
        ("dcm-adaptive", lambda saved: saved["state"]["bias"]["estimate"].update(xx=1), r"bias\.estimate\.xx is 1"),
        ("dcm-adaptive", lambda saved: saved["state"].update(held=[[1, 2, 0.0, 0.0, 9.8]] * MAX_HELD), "held"),
        (
            "dcm-adaptive",
            lambda saved: saved["state"].update(held=[[4, 2, 0.0, 0.0, 0.0]]),
            "held",
        ),
        ("dcm-adaptive", lambda saved: saved["state"].update(held=[[1, 2**62, 0.0, 0.0, 9.8]]), "held"),
        ("dcm-adaptive", lambda saved: saved["state"].update(time_ns=2**70), "time_ns"),
        ("dcm-adaptive", lambda saved: saved["state"].update(gyro_ns=-(2**62)), "gyro_ns"),
    ],
)
def test_a_spoilt_save_is_refused_and_leaves_the_filter_alone(name, spoil, named) -> None:  # type: ignore[no-untyped-def]
    one = fresh(name)
    one.update_batch(sense(lambda t: np.eye(3), 1.0, GAME))
    before = one.save()
    saved = one.save()
    spoil(saved)
    with pytest.raises(InvalidArgumentError, match=named):
        one.restore(saved)
    assert one.save() == before


@pytest.mark.parametrize("name", ["dcm", "dcm-adaptive"])
def test_a_save_with_one_place_left_goes_on(name: str) -> None:
    full = make_filter(name)
    for _ in range(MAX_HELD - 1):
        full.update(SensorType.ACCELEROMETER, 0, 0.0, 0.0, 9.8)
    restored = make_filter(name)
    restored.restore(full.save())
    assert len(full.save()["state"]["held"]) == MAX_HELD - 1
    for each in (full, restored):
        each.update(SensorType.ACCELEROMETER, 0, 0.0, 0.0, 9.8)
    assert restored.save() == full.save()
    assert full.save()["state"]["held"] == []


@every_filter
def test_equal_streams_give_equal_states(name: str) -> None:
    events = sense(lambda t: np.eye(3), 1.0, GAME)
    one, other = fresh(name), fresh(name)
    one.update_batch(events)
    assert one.state != other.state
    other.update_batch(events)
    assert one.state == other.state
