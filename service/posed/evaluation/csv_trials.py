"""Recordings in comma-separated text that tell the truth too.

The layout is that of `posed.hal.csv_recording`, with truth among the samples. In its own layout truth is a row of its
own, `truth,TIMESTAMP_NS,x,y,z,w`, under a header that has a column `w`:

    sensor,timestamp_ns,x,y,z,w
    gyroscope,12500000,0.010,0.002,-0.001,
    truth,12600000,0.0,0.0,0.7071,0.7071

and in a layout of one's own the sidecar FILE.toml names its four columns:

    [truth]
    columns = ["qx", "qy", "qz", "qw"]
    declination_deg = 1.75             # if its north is the true one; 0, magnetic north, if not said

The quaternion turns device axes into east, north, up. An instant counts if truth is known within 100 ms on both sides
of it; leave the rows out of the stretches that are not to count.
"""

from pathlib import Path

import numpy as np

from posed.errors import RecordingError
from posed.evaluation.trial import Trial
from posed.hal.csv_recording import has_truth, load_csv

DATASET = "csv"


def is_csv_trial(path: Path) -> bool:
    """Return whether a CSV file is one of sensors and truth, by its header or sidecar; True if it cannot be told."""
    try:
        return has_truth(path)
    except RecordingError:
        return True


def load_csv_trial(path: Path) -> Trial:
    """Read a recording with truth; its group is its folder.

    Raises RecordingError if it is malformed or has no truth.
    """
    recording = load_csv(path)
    truth = recording.truth
    if truth is None:
        raise RecordingError(
            f"{path} holds no truth; expected rows truth,TIMESTAMP_NS,x,y,z,w or [truth] in its sidecar"
        )
    return Trial(
        DATASET,
        ("all_trials", path.absolute().parent.name),
        recording,
        truth,
        np.ones(len(truth.timestamp_ns), np.bool_),
    )
