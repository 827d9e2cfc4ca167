"""How far a filter's orientations are off the truth of a trial, at gyroscope samples and as a client sees them.

Two errors are told apart:

- of the **filter**: its orientation right after each gyroscope sample, against the truth at that sample's time;
- of the **10 Hz pose**: at each instant of the pose grid (every 100 ms from the first event on, as the daemon has it)
  the newest orientation there is, held, against the truth at the instant. What the newest sample is old by is lag, and
  counts: at NORMAL up to 200 ms. An *aligned* pose is turned on to the instant by its own angular rate.

Instants before a filter's first answer do not count.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from posed.errors import InvalidArgumentError
from posed.evaluation.measures import heading_error, inclination_error, rmse, total_error
from posed.evaluation.rates import pose_instants
from posed.evaluation.trial import Trial
from posed.events import FlatEvent, Float64Array, Int64Array, SensorType
from posed.fusion.filter import OrientationFilter
from posed.sensors.alignment import aligned as aligned_to

_GYROSCOPE = int(SensorType.GYROSCOPE)


@dataclass(frozen=True, eq=False)
class Track:
    """Orientations at instants: timestamp_ns int64[n]; quaternion float64[n, 4] (x, y, z, w), NaN where unanswered."""

    timestamp_ns: Int64Array
    quaternion: Float64Array


@dataclass(frozen=True, eq=False)
class Answers:
    """What a filter said: after each gyroscope sample, and the poses of the 10 Hz grid, as held and aligned."""

    filtered: Track
    poses: Track
    aligned: Track


@dataclass(frozen=True, slots=True)
class Errors:
    """RMSE in degrees by BROAD's definitions, over the instants that count."""

    total: float
    heading: float
    inclination: float


def run_filter(orientation_filter: OrientationFilter, events: Sequence[FlatEvent]) -> Answers:
    """Feed a fresh filter a trial's events in order and return its answers.

    Raises InvalidArgumentError if there is no gyroscope event.
    """
    events = list(events)
    after_gyro = [row + 1 for row, event in enumerate(events) if event[0] == _GYROSCOPE]
    if not after_gyro:
        raise InvalidArgumentError("no gyroscope event, so there is nothing to score at")
    grid = pose_instants(events)
    times = np.array([event[1] for event in events], np.int64)
    pose_rows = np.searchsorted(times, grid, side="right").tolist()
    filtered = np.full((len(after_gyro), 4), np.nan)
    poses = np.full((len(grid), 4), np.nan)
    aligned = np.full((len(grid), 4), np.nan)
    stops = sorted(
        [(row, 0, index) for index, row in enumerate(after_gyro)]
        + [(row, 1, index) for index, row in enumerate(pose_rows)]
    )
    instants = grid.tolist()
    done = 0
    for row, is_pose, index in stops:
        if row > done:
            orientation_filter.update_batch(events[done:row])
            done = row
        answer = orientation_filter.orientation()
        if answer is None:
            continue
        if is_pose:
            poses[index] = answer.quaternion
            aligned[index] = aligned_to(answer, instants[index])[0].quaternion
        else:
            filtered[index] = answer.quaternion
    gyro_ns = times[np.array(after_gyro) - 1]
    return Answers(Track(gyro_ns, filtered), Track(grid, poses), Track(grid, aligned))


def phone_answers(trial: Trial) -> Answers:
    """Return what the phone's own fusion said: at its own samples, and held on the grid of the recorded events.

    Its rotation vector has no rate, so it cannot be aligned. Raises InvalidArgumentError if the trial has none.
    """
    column = trial.rotation_vector
    if column is None or not len(column):
        raise InvalidArgumentError(f"trial {trial.name!r} has no rotation vector of the phone")
    quaternion = column.values[:, :4]
    grid = pose_instants([(0, trial.recording.start_ns, 0.0, 0.0, 0.0), (0, trial.recording.end_ns, 0.0, 0.0, 0.0)])
    newest = np.searchsorted(column.timestamp_ns, grid, side="right") - 1
    held = np.where((newest >= 0)[:, None], quaternion[np.maximum(newest, 0)], np.nan)
    nothing = np.full_like(held, np.nan)
    return Answers(Track(column.timestamp_ns, quaternion), Track(grid, held), Track(grid, nothing))


def error_track(trial: Trial, track: Track) -> Float64Array:
    """Return the total error at each instant of a track, rad[n], NaN where it does not count or is not known."""
    return total_error(track.quaternion, trial.truth_at(track.timestamp_ns))


def score(trial: Trial, track: Track) -> Errors:
    """Return the RMSE of a track over the instants that count; NaN if the filter answered at none of them."""
    truth = trial.truth_at(track.timestamp_ns)
    rows = np.isfinite(truth).all(axis=1) & np.isfinite(track.quaternion).all(axis=1)
    if not rows.any():
        return Errors(math.nan, math.nan, math.nan)
    estimate, truth = track.quaternion[rows], truth[rows]
    return Errors(
        *(math.degrees(rmse(measure(estimate, truth))) for measure in (total_error, heading_error, inclination_error))
    )
