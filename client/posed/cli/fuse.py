"""`posed fuse`: a recording into poses, as CSV."""

import argparse
import contextlib
import errno
import itertools
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from posed.cli.options import (
    add_aligned_option,
    add_filters_option,
    add_pose_rate_option,
    add_profile_option,
    add_rate_mode_option,
)
from posed.errors import InvalidArgumentError, RecordingError
from posed.evaluation.fuse import fuse_recording
from posed.events import Pose, RateMode
from posed.fusion import DEFAULT_FILTER
from posed.hal.profile import load_profile
from posed.hal.recording import Recording
from posed.hal.replay import load_recording

HEADER = (
    "sequence,timestamp_ns,qx,qy,qz,qw,wx,wy,wz,heading_accuracy_rad,status,rate_mode,events_fused,filter,predicted_ns"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording and how to fuse it."""
    parser.add_argument("recording", type=Path, metavar="RECORDING", help="a FILE.csv or the folder of a trial")
    add_rate_mode_option(parser)
    add_filters_option(parser, (DEFAULT_FILTER,))
    add_profile_option(parser, "patonis2018")
    add_pose_rate_option(parser)
    add_aligned_option(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="where the CSV goes (default: stdout)")
    parser.epilog = f"""\
Columns: {HEADER.replace(",", ", ")}.
q is device to world (east, magnetic north, up), w in rad/s in device axes, status the bits of a pose's status;
predicted_ns is how far --aligned turned q on past the newest gyroscope sample, timestamp_ns. Several filters get the
same events and a row each at every instant, from the first pose of each on. The same recording and options give the
same bytes. A recording that gives no pose is an error, and nothing is written."""


def run(arguments: argparse.Namespace) -> int:
    """Fuse as fast as it goes."""
    if arguments.output is not None:
        _refuse_input_as_output(arguments.recording, arguments.output)
    recording = load_recording(arguments.recording)
    for kind, count in recording.dropped_rows.items():
        if count:
            print(f"posed: note: {count} {kind.name.lower()} rows out of time order are left out", file=sys.stderr)
    poses = fuse_recording(
        recording,
        load_profile(arguments.profile),
        sampling_period_us=RateMode[arguments.mode].sampling_period_us,
        filters=arguments.filters,
        pose_period_us=round(1e6 / arguments.rate),
        aligned=arguments.aligned,
    )
    # A recording that cannot be fused says so at its first pose: before anything is written.
    first = list(itertools.islice(poses, 1))
    if not first:
        raise RecordingError(
            f"{recording.name} gives no pose: in time order it has {_contents(recording)}; a pose needs samples of"
            " accelerometer, gyroscope and magnetic_field, and its filter time to see gravity and north"
        )
    written = 0
    with _output(arguments.output) as output, _progress(output) as progress:
        bar = progress.add_task(recording.name, total=recording.end_ns - recording.start_ns)
        output.write(f"{HEADER}\n")
        for pose in itertools.chain(first, poses):
            output.write(csv_row(pose))
            written += 1
            progress.update(bar, completed=pose.instant_ns - recording.start_ns)
    if arguments.output is not None:
        print(f"{written} poses written to {arguments.output}", file=sys.stderr)
    return 0


def _contents(recording: Recording) -> str:
    kinds = (f"{len(column)} {kind.name.lower()}" for kind, column in recording.columns.items())
    return f"{', '.join(kinds)} rows over {(recording.end_ns - recording.start_ns) / 1e9:.3g} s"


def csv_row(pose: Pose) -> str:
    """Return a pose as a line of CSV; repr is the shortest text from which the same float is read."""
    orientation = pose.orientation
    numbers = (*orientation.quaternion, *orientation.angular_rate, orientation.heading_accuracy)
    return (
        f"{pose.sequence},{orientation.timestamp_ns},{','.join(map(repr, numbers))},{int(orientation.status)},"
        f"{pose.rate_mode.name},{pose.events_fused},{pose.filter_name},{pose.predicted_ns}\n"
    )


@contextlib.contextmanager
def _output(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stdout
        return
    # Written beside the target of a link and renamed when whole; a device or a pipe cannot be replaced.
    target = Path(os.path.realpath(path))
    special = target.exists() and not target.is_file()
    beside = target if special else target.with_name(f".{target.name}.{os.getpid()}")
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        file = beside.open("w", encoding="ascii", newline="\n")
    except OSError as error:
        raise InvalidArgumentError(f"cannot write {path}: {error.strerror}; name a file that can be written") from error
    try:
        with file:
            yield file
        if not special:
            beside.replace(target)
    except BaseException:
        if not special:
            beside.unlink(missing_ok=True)
        raise


def _refuse_input_as_output(recording: Path, output: Path) -> None:
    inputs = [recording, *recording.iterdir()] if recording.is_dir() else [recording]
    if output.exists() and any(path.exists() and path.samefile(output) for path in inputs):
        raise InvalidArgumentError(f"output {output} is the recording itself; name another file")


def _progress(output: TextIO) -> Progress:
    """Return a progress bar on stderr, silent unless that is a terminal that the poses do not fill."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        disable=not sys.stderr.isatty() or output.isatty(),
        transient=True,
    )
