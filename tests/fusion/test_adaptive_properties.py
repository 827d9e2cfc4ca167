"""What holds for any stream of events, however bad: cuts, saves and the origin of time do not change a bit."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_phone import FASTEST, GAME, FlatEvents, rotation, sense
from test_dcm_properties import streams

from posed.errors import InvalidArgumentError
from posed.events import SensorType
from posed.fusion import make_filter
from posed.fusion.adaptive import AdaptiveFilter
from posed.fusion.adaptive_state import AdaptiveState
from posed.fusion.event_arrays import MAX_HELD

FORMS = st.sampled_from(["dcm-adaptive", "game", "geomag"])


def fresh(name: str) -> AdaptiveFilter:
    made = make_filter(name)
    assert isinstance(made, AdaptiveFilter)
    return made


@settings(deadline=None, max_examples=60)
@given(FORMS, streams(), st.lists(st.integers(0, 400), max_size=8))
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


@settings(deadline=None, max_examples=60)
@given(FORMS, streams(), st.integers(0, 400))
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


@settings(deadline=None, max_examples=60)
@given(FORMS, streams())
def test_the_state_stays_finite_and_the_matrix_a_rotation(name: str, events: FlatEvents) -> None:
    adaptive = fresh(name)
    adaptive.update_batch(events)
    json.dumps(adaptive.save(), allow_nan=False)
    c = adaptive.state.matrix
    rows = np.array([[c.east_x, c.east_y, c.east_z], [c.north_x, c.north_y, c.north_z], [c.up_x, c.up_y, c.up_z]])
    assert rows @ rows.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(rows) == pytest.approx(1.0)
    assert np.hypot(adaptive.state.heading.north_x, adaptive.state.heading.north_y) == pytest.approx(1.0)
    bias, std = adaptive.gyro_bias()
    assert max(map(abs, bias)) <= adaptive.params.bias.limit
    assert min(std) >= 0.0
    answer = adaptive.orientation()
    if answer is not None:
        assert np.linalg.norm(answer.quaternion) == pytest.approx(1.0)
        assert answer.quaternion[3] >= 0.0
        assert 0.0 < answer.heading_accuracy <= np.pi / np.sqrt(3)


@pytest.mark.parametrize("start_ns", [-(2**40), -1_000_000_000, 2**61])
def test_the_origin_of_time_does_not_matter(start_ns: int) -> None:
    def attitude(t: float) -> np.ndarray:
        return rotation(0.3 * np.sin(t), 0.2 * t, 0.1)

    here = AdaptiveFilter()
    here.update_batch(sense(attitude, 3.0, FASTEST))
    there = AdaptiveFilter()
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
        (lambda saved: saved["state"]["tilt"].pop("age_s"), "age_s"),
        (lambda saved: saved["state"].update(extra=1), "extra"),
        (lambda saved: saved["state"]["heading"].update(variance=float("nan")), "nan"),
        (lambda saved: saved["state"]["bias"]["estimate"].update(xx=1), r"bias\.estimate\.xx is 1"),
        (lambda saved: saved["state"].update(held=[[1, 2, 3.0]]), "held"),
        (lambda saved: saved["state"].update(held=[[1, 2, 0.0, 0.0, 9.8]] * MAX_HELD), "held"),
        (lambda saved: saved["state"].update(held=[[int(SensorType.GYROSCOPE), 2, 0.0, 0.0, 0.0]]), "held"),
        (lambda saved: saved["state"].update(held=[[1, 2**62, 0.0, 0.0, 9.8]]), "held"),
        (lambda saved: saved["state"].update(time_ns=2**70), "time_ns"),
        (lambda saved: saved["state"].update(gyro_ns=-(2**62)), "gyro_ns"),
    ],
)
def test_a_spoilt_save_is_refused_and_leaves_the_filter_alone(spoil, named) -> None:  # type: ignore[no-untyped-def]
    adaptive = AdaptiveFilter()
    adaptive.update_batch(sense(lambda t: np.eye(3), 1.0, GAME))
    before = adaptive.save()
    saved = adaptive.save()
    spoil(saved)
    with pytest.raises(InvalidArgumentError, match=named):
        adaptive.restore(saved)
    assert adaptive.save() == before


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


def test_equal_streams_give_equal_states() -> None:
    assert AdaptiveFilter().state == AdaptiveFilter().state
    assert AdaptiveFilter().state != AdaptiveState()
