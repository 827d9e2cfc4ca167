"""A whole recording turned into poses, without a daemon and without waiting."""

from collections.abc import Iterator, Sequence
from itertools import chain
from operator import attrgetter

from posed.clock import VirtualClock
from posed.events import Pose
from posed.fusion import DEFAULT_FILTER
from posed.hal.profile import DeviceProfile
from posed.hal.recording import Recording
from posed.hal.replay import ReplaySource
from posed.sensors import SensorService, make_device_filter


def fuse_recording(
    recording: Recording,
    profile: DeviceProfile,
    *,
    sampling_period_us: int,
    filters: Sequence[str] = (DEFAULT_FILTER,),
    pose_period_us: int = 100_000,
    aligned: bool = False,
    step_ns: int = 1_000_000_000,
) -> Iterator[Pose]:
    """Yield the poses that a daemon would publish from a recording, by instant, those of one instant as `filters`.

    sampling_period_us: asked of the sensors (`RateMode.sampling_period_us`; 0 = fastest). pose_period_us: 5,000 to
    1,000,000. aligned: turn each pose on to its grid instant. step_ns: sample time fused at once; it decides about
    speed, never about a pose. Raises InvalidArgumentError for a filter or period that is not allowed or a recording
    that lacks a sensor a pose needs, RecordingError if none of its sensors is the profile's.
    """
    clock = VirtualClock()
    source = ReplaySource(recording, profile, clock)
    first, *beside = (make_device_filter(name, profile) for name in filters)
    service = SensorService(source, first, clock, beside=beside, aligned=aligned)
    # The replay begins here: its first sample stands at the clock's 0.
    for name in filters:
        service.register_pose(name, pose_period_us, sampling_period_us, name)
    end_ns = recording.end_ns - recording.start_ns
    for now_ns in chain(range(step_ns, end_ns, step_ns), (end_ns,)):
        clock.advance_to(now_ns)
        service.advance()
        yield from sorted(service.take_poses(), key=_instant_of)


_instant_of = attrgetter("instant_ns")
