"""From paths to trials: which file or folder is a trial of what kind, and those that cannot be read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from posed.errors import RecordingError
from posed.evaluation.attitude_trials import CalibrationChoice, is_attitude_trial, load_attitude_trial
from posed.evaluation.broad import load_broad
from posed.evaluation.csv_trials import is_csv_trial, load_csv_trial
from posed.evaluation.trial import Trial


@dataclass(frozen=True, slots=True)
class Skipped:
    """A recording that could not be read, and why."""

    path: str
    reason: str


def find_trials(paths: Sequence[Path]) -> list[Path]:
    """Return the trials that the paths name: each a trial itself, or a folder whose trials are found at any depth.

    A trial is a BROAD `.mat`, a folder of Android streams with motion capture, or a `.csv` with truth (see
    `csv_trials`); anything else in a folder is passed over. In the order of the paths, within a folder by name, none
    twice. Raises RecordingError for a path that is missing, is no trial or holds none.
    """
    found: dict[Path, Path] = {}
    for path in paths:
        if not path.exists():
            raise RecordingError(f"{path} is missing; name a trial or a folder of trials")
        if path.is_file() and path.suffix not in _LOADERS:
            raise RecordingError(
                f"{path} is no trial; name a .mat of BROAD, a .csv with truth, a folder of Android streams with motion"
                " capture, or a folder of such"
            )
        trials = [path] if path.is_file() else list(_walk(path))
        if not trials:
            raise RecordingError(f"{path} holds no trial: no .mat of BROAD, no .csv with truth, no Android streams")
        for trial in trials:
            found.setdefault(trial.resolve(), trial)
    return list(found.values())


def load_trial(path: Path, calibration: CalibrationChoice = CalibrationChoice.OWN) -> Trial:
    """Read a trial that `find_trials` found; `calibration` is for the phone's.

    Raises RecordingError if it is damaged, MissingExtraError without what reads it.
    """
    if path.is_dir():
        return load_attitude_trial(path, calibration)
    return _LOADERS[path.suffix](path)


def _walk(folder: Path) -> Iterator[Path]:
    if is_attitude_trial(folder):
        yield folder
        return
    for path in sorted(folder.iterdir()):
        # Calibration recordings have the files of a trial and no truth.
        if path.is_dir() and path.name != "calibration" and not path.name.startswith("."):
            yield from _walk(path)
        elif path.suffix == ".mat" or (path.suffix == ".csv" and is_csv_trial(path)):
            yield path


_LOADERS = {".mat": load_broad, ".csv": load_csv_trial}
