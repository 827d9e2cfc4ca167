"""The one protocol behind which samples come, shaped like Android's ISensors."""

from typing import Protocol

from posed.clock import TimeMap
from posed.events import EventBatch, SensorInfo, SensorType, Truth


class SensorSource(Protocol):
    """A phone's sensors: real, recorded or simulated. All times are sample time in ns unless said otherwise.

    A source is given its Clock when it is made. What it yields depends on the calls made between two drains, never on
    how often it is drained.

    Values are what an app may see, rounded by `posed.hal.quantisation`; filters get the same, as in Android: so gravity
    and linear acceleration add up to the accelerometer.

    A source that can lose its phone raises SourceLostError from activate, batch, flush, drain and next_sample_ns, at
    least once and until it has one again. Then it has forgotten what was activated and batched, and the samples of the
    time between; its sensors are the same. The caller tries again, beginning with batch and activate.
    """

    @property
    def sensors(self) -> tuple[SensorInfo, ...]:
        """The physical sensors as the list shows them, in handle order; the same for the life of the source."""

    @property
    def time_map(self) -> TimeMap:
        """The present mapping from sample time to CLOCK_BOOTTIME; it moves when a replay pauses or loops."""

    @property
    def end_ns(self) -> int | None:
        """Sample time of the last sample there will ever be, None for a source without end."""

    def activate(self, handle: int, enabled: bool) -> None:
        """Switch a sensor on or off; idempotent. Samples not drained when it goes off are abandoned.

        An on-change sensor yields its present value when it goes on, and then its changes, none sooner than its period
        after the one before. A one-shot sensor is off once it has fired.
        """

    def batch(self, handle: int, sampling_period_ns: int, max_report_latency_ns: int) -> int:
        """Set a sensor's period, active or not, and return the period configured (ns), which the profile decides."""

    def flush(self, handle: int) -> None:
        """Ask for one flush-complete behind the samples up to the next drain.

        Raises InvalidArgumentError if the sensor is not active.
        """

    def drain(self, until_ns: int) -> EventBatch:
        """Return every sample of the active sensors later than the last drain and not later than `until_ns`."""

    def resume(self) -> None:
        """Go on from the clock's now after a time in which nobody could drain: a suspend, a stopped process.

        A replay continues with what comes next in it, moving its time map; any other source loses what was missed.
        """

    def prepare(self) -> None:
        """Do now, while nobody waits, what the next drains would have to do; they yield the same without it."""

    def set_environment(self, kind: SensorType, value: float) -> None:
        """Set what an ambient sensor reads from now on, in its unit (pressure hPa, light lux, proximity cm).

        Raises InvalidArgumentError where that is not for anyone to set, or for a value that the sensor cannot read.
        """

    def next_sample_ns(self, handle: int) -> int | None:
        """Return when the next sample of an active sensor is due, None if none is expected."""

    def truth(self, timestamp_ns: int) -> Truth | None:
        """Return the true orientation at `timestamp_ns`, None where it is not known."""
