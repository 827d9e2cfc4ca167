"""Where samples come from: one module a source, all behind one protocol."""

from pathlib import Path

from posed.clock import Clock
from posed.errors import InvalidArgumentError
from posed.hal.profile import DeviceProfile
from posed.hal.source import SensorSource


def open_source(
    spec: str, profile: DeviceProfile, clock: Clock, *, seed: int = 0, speed: float = 1.0, loop: bool = False
) -> SensorSource:
    """Open the source that `spec` names: `sim`, `sim:SCRIPT` or `replay:PATH`.

    seed (0 or more) is the simulation's; speed (times real time) and loop are a replay's. Raises InvalidArgumentError
    for anything else, and RecordingError for a recording that cannot be read.
    """
    # Each source is imported only where it is wanted: neither needs what the other loads.
    kind, _, rest = spec.partition(":")
    if kind == "sim":
        from posed.hal.motion import DEFAULT_SCRIPT, make_script
        from posed.hal.simulated import SimulatedPhone

        if speed != 1.0:
            raise InvalidArgumentError(f"speed = {speed} with source {spec!r}; allowed: 1 (only a replay has a speed)")
        if loop:
            raise InvalidArgumentError(f"loop with source {spec!r}; leave it out (only a replay has an end)")
        if seed < 0:
            raise InvalidArgumentError(f"seed = {seed}; allowed: 0 or more")
        return SimulatedPhone(profile, clock, make_script(rest or DEFAULT_SCRIPT, seed), seed)
    if kind == "replay":
        if not rest:
            raise InvalidArgumentError(f"source {spec!r} lacks its path; give replay:PATH")
        from posed.hal.replay import open_replay

        return open_replay(Path(rest), profile, clock, speed=speed, loop=loop)
    raise InvalidArgumentError(f"source {spec!r} is unknown; allowed: sim, sim:SCRIPT, replay:PATH")
