"""Events as arrays are the events they were made of, to every filter and to the last bit."""

import numpy as np
import pytest
from synthetic_phone import GAME, rotation, sense

from posed.errors import InvalidArgumentError
from posed.events import Float64Array
from posed.fusion import FILTERS, make_filter
from posed.fusion.event_arrays import EventArrays


def swung(t: float) -> Float64Array:
    return rotation(0.8 * np.sin(2.0 * t), 0.3 * t, 0.4 * np.sin(t))


@pytest.fixture(scope="module")
def arrays() -> EventArrays:
    made = sense(swung, 20.0, GAME, bias=(0.004, -0.003, 0.005), noise=np.random.default_rng(3))
    values = made.values.copy()
    values[::97, 1] = np.nan
    return EventArrays(made.sensor_type, made.timestamp_ns, values)


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_says_the_same_of_arrays_and_of_a_list(name: str, arrays: EventArrays) -> None:
    by_list, by_arrays = make_filter(name), make_filter(name)
    events = list(arrays)
    for start in range(0, len(arrays), 7):
        by_list.update_batch(events[start : start + 7])
        by_arrays.update_batch(arrays[start : start + 7])
        assert by_arrays.orientation() == by_list.orientation()
    assert by_arrays.save() == by_list.save()
    whole = make_filter(name)
    whole.update_batch(arrays)
    assert whole.save() == by_list.save()


def test_arrays_are_read_only_where_their_owner_says_so(arrays: EventArrays) -> None:
    values = np.zeros((1, 3))
    values.setflags(write=False)
    assert list(EventArrays(np.array([1]), np.array([5]), values)) == [(1, 5, 0.0, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("types", "times", "shape"), [(2, 3, (3, 3)), (3, 2, (3, 3)), (3, 3, (2, 3)), (3, 3, (3, 4)), (3, 3, (3,))]
)
def test_arrays_of_different_lengths_are_refused(types: int, times: int, shape: tuple[int, ...]) -> None:
    with pytest.raises(InvalidArgumentError, match="events of shapes"):
        EventArrays(np.zeros(types, np.int64), np.zeros(times, np.int64), np.zeros(shape))
