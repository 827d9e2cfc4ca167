"""A phone that turns through the compass, step by step as a test wants it, for a page that shows places around it."""

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyproj import Geod
from served import SilentFeed

from posed.clock import VirtualClock
from posed.events import RateMode
from posed.hal.motion import make_script
from posed.hal.profile import load_profile
from posed.hal.simulated import SimulatedPhone
from posed.sensors import SensorService, make_device_filter

HERE = {"latitude": 40.6265, "longitude": 22.9591, "height": 72.5}
QUARTERS = {"North": 0.0, "East": 90.0, "South": 180.0, "West": 270.0}
# A time that has not come: of what is stamped so, nothing is brought forward to the instant of drawing.
_NEVER_MS = 1e12


@dataclass(frozen=True)
class Step:
    """A pose and the truth of its grid instant, as the page gets them; heading (deg) of the camera by the truth."""

    pose: dict[str, Any]
    truth: dict[str, Any]
    heading: float


class SteppedFeed(SilentFeed):
    """A feed that moves on when it is told to, and says the same again meanwhile, as the page takes silence ill."""

    def __init__(self, steps: Sequence[Step], *, has_truth: bool = True) -> None:
        super().__init__()
        self.steps = steps
        self._has_truth = has_truth
        self._shown: tuple[dict[str, Any], dict[str, Any]] | None = None
        self._repeats = 0
        self._ended = threading.Event()
        self._repeating = threading.Thread(target=self._repeat)

    def start(self, publish: Callable[[str, Any], None]) -> None:
        super().start(publish)
        publish("v", {"name": "patonis2018", "fov_deg": 60.0, "rotation": 0})
        publish("o", {**HERE, "source": "stated", "wmm_declination_deg": None})
        publish("s", {"state": "CONNECTED", "reason": ""})
        self._repeating.start()

    def show(self, number: int, pose_of: Callable[[Sequence[Step], int], dict[str, Any]]) -> None:
        """Publish the truth of a step, and the pose that `pose_of` makes of it."""
        step = self.steps[number]
        self._shown = step.truth, {**pose_of(self.steps, number), "n": step.pose["n"]}
        self._publish_shown()

    def close(self) -> None:
        self._ended.set()
        self._repeating.join()

    def _repeat(self) -> None:
        while not self._ended.wait(0.1):
            self._publish_shown()

    def _publish_shown(self) -> None:
        if self._shown is not None:
            truth, pose = self._shown
            if self._has_truth:
                self.publish("t", truth)
            # The same value twice would be sent but once.
            self._repeats += 1
            self.publish("p", {**pose, "f": self._repeats})


def faithful(steps: Sequence[Step], number: int) -> dict[str, Any]:
    """The pose as it was fused."""
    return steps[number].pose


def frozen(steps: Sequence[Step], number: int) -> dict[str, Any]:
    """The pose of the beginning."""
    return steps[0].pose


def late(steps: Sequence[Step], number: int) -> dict[str, Any]:
    """The pose of 100 ms ago."""
    return steps[number - 1].pose


def turned(steps: Sequence[Step], number: int) -> dict[str, Any]:
    """The pose, five degrees further to the right."""
    half = math.radians(-5.0) / 2
    x, y, z, w = steps[number].pose["q"]
    s, c = math.sin(half), math.cos(half)
    return {**steps[number].pose, "q": [c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z]}


def simulate(script: str, seconds: float) -> list[Step]:
    """Return what the simulated phone's service tells at GAME, from the fifth second on."""
    clock = VirtualClock(1_000_000_000)
    profile = load_profile("patonis2018")
    phone = SimulatedPhone(profile, clock, make_script(script, 0), 0)
    service = SensorService(phone, make_device_filter("dcm", profile), clock)
    service.register_pose("test", 100_000, RateMode.GAME.sampling_period_us)
    steps = []
    for second in range(1, int(seconds) + 5):
        clock.advance_to((1 + second) * 1_000_000_000)
        service.advance()
        for pose in service.take_poses():
            truth = phone.truth(pose.instant_ns)
            if second < 5 or truth is None:
                continue
            x, y, z, w = truth.quaternion
            camera = np.array([-2 * (x * z + y * w), -2 * (y * z - x * w)])
            steps.append(
                Step(
                    pose={
                        "n": pose.sequence,
                        "t": _NEVER_MS,
                        "b": _NEVER_MS,
                        "q": list(pose.orientation.quaternion),
                        "w": list(pose.orientation.angular_rate),
                        "a": 1.0,
                        "s": 0,
                        "m": "GAME",
                        "f": 14,
                        "x": 0,
                    },
                    truth={
                        "t": _NEVER_MS,
                        "q": list(truth.quaternion),
                        "d": math.degrees(truth.declination),
                        "e": list(truth.position_enu) if truth.position_enu is not None else None,
                    },
                    heading=math.degrees(math.atan2(camera[0], camera[1])) % 360,
                )
            )
    return steps


def places_around(bearings: dict[str, float], distance_m: float = 800.0, above_m: float = 112.0) -> dict[str, Any]:
    """Return places at true bearings (deg) from HERE, as the page takes them; 8 degrees high, clear of the crosses."""
    places = []
    for number, (name, bearing) in enumerate(bearings.items(), 1):
        longitude, latitude, _ = Geod(ellps="WGS84").fwd(HERE["longitude"], HERE["latitude"], bearing, distance_m)
        places.append(
            {
                "id": str(number),
                "name": name,
                "kind": "point",
                "note": "",
                "color": None,
                "coordinates": [[longitude, latitude, HERE["height"] + above_m]],
                "ground": None,
            }
        )
    return {"viewpoint": HERE, "places": places}
