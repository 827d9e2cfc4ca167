"""What dcm-adaptive's gate pays where the surroundings' field is not the one that it began with.

    python benchmarks/surroundings.py

The simulated tablet of the paper in three places that no recording shows, the filter with one thing left out at a time.
Printed is the root mean square of the total error in degrees, over the whole of it but for the first ten seconds.

- began beside a magnet: 60 uT for the first five seconds, then five minutes in the hand without it;
- into a building: after half a minute its steel adds 25 uT downward, for ten minutes in the hand;
- put down beside a magnet: as the first, but on a table.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from ablation import ABLATIONS, changed
from simulation import simulate

from posed.evaluation.measures import rmse, to_magnetic_north, total_error
from posed.events import Float64Array, RateMode
from posed.fusion.adaptive import AdaptiveFilter, AdaptiveParams
from posed.hal.motion import MotionScript, Target, make_script

WARM_UP_S = 10.0
SEEDS = (1, 2, 3)
LEFT_OUT: dict[str, dict[str, object]] = {
    name: ABLATIONS[name]
    for name in ("all of it", "no new reference", "no late re-acceptance", "no gate on magnetic disturbance")
} | {"neither new reference nor late re-acceptance": ABLATIONS["no new reference"] | ABLATIONS["no late re-acceptance"]}


@dataclass(frozen=True)
class Among:
    """A motion with something magnetic near; `added`: uT in the world frame, from `from_s` to `until_s`."""

    motion: MotionScript
    added: tuple[float, float, float]
    from_s: float
    until_s: float

    @property
    def targets(self) -> tuple[Target, ...]:
        return self.motion.targets

    def attitude(self, t: Float64Array) -> Float64Array:
        return self.motion.attitude(t)

    def position(self, t: Float64Array) -> Float64Array:
        return self.motion.position(t)

    def acceleration(self, t: Float64Array) -> Float64Array:
        return self.motion.acceleration(t)

    def disturbance(self, t: Float64Array) -> Float64Array:
        return np.outer((t >= self.from_s) & (t < self.until_s), self.added)


PLACES: dict[str, tuple[str, float, Callable[[MotionScript], Among]]] = {
    "began beside a magnet": ("look-around", 300.0, partial(Among, added=(60.0, 0.0, 0.0), from_s=0.0, until_s=5.0)),
    "into a building": ("look-around", 630.0, partial(Among, added=(0.0, 0.0, -25.0), from_s=30.0, until_s=1e9)),
    "put down beside a magnet": ("still", 300.0, partial(Among, added=(60.0, 0.0, 0.0), from_s=0.0, until_s=5.0)),
}


def error_deg(place: str, changes: dict[str, object], seed: int) -> float:
    """Return the root mean square of the total error in a place (deg)."""
    script, seconds, among = PLACES[place]
    make = partial(AdaptiveFilter, changed(AdaptiveParams(), changes))
    done = simulate(
        among(make_script(script, seed)), seconds - WARM_UP_S, make, RateMode.GAME, warm_up_s=WARM_UP_S, seed=seed
    )
    times = np.array([pose.orientation.timestamp_ns for pose in done.poses])
    truth = to_magnetic_north(done.truth(times), done.declination)
    return float(np.degrees(rmse(total_error(done.quaternions, truth))))


def main() -> int:
    """Print the table: the mean over the seeds."""
    print(f"{'':<48}" + "".join(f"{place:>26}" for place in PLACES))
    for name, changes in LEFT_OUT.items():
        means = [np.mean([error_deg(place, changes, seed) for seed in SEEDS]) for place in PLACES]
        print(f"{name:<48}" + "".join(f"{mean:26.2f}" for mean in means), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
