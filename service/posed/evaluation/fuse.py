"""A whole recording turned into poses, without a daemon and without waiting."""

from collections.abc import Iterator

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
    filter_name: str = DEFAULT_FILTER,
    pose_period_us: int = 100_000,
    aligned: bool = False,
    step_ns: int = 1_000_000_000,
) -> Iterator[Pose]:
    """Yield the poses that a daemon would publish from a recording, in order.

    sampling_period_us: asked of the sensors (`RateMode.sampling_period_us`; 0 = fastest). pose_period_us: 5,000 to
    1,000,000. aligned: turn each pose on to its grid instant. step_ns: sample time fused at once; it decides about
    speed, never about a pose. Raises InvalidArgumentError for a filter or period that is not allowed or a recording
    that lacks a sensor a pose needs, RecordingError if none of its sensors is the profile's.
    """
    clock = VirtualClock()
    source = ReplaySource(recording, profile, clock)
    service = SensorService(source, make_device_filter(filter_name, profile), clock, aligned=aligned)
    # The replay begins here: its first sample stands at the clock's 0.
    service.register_pose("fuse", pose_period_us, sampling_period_us)
    end_ns = recording.end_ns - recording.start_ns
    for now_ns in (*range(step_ns, end_ns, step_ns), end_ns):
        clock.advance_to(now_ns)
        service.advance()
        yield from service.take_poses()
