"""What SensorTest, the integration tests of CTS and VTS ask of registering, flushing and triggering."""

import itertools
import random
from collections.abc import Callable, Iterator

from posed.client.sensor import Sensor
from posed.verify.collector import Collector
from posed.verify.fifo import verify_fifo_length
from posed.verify.finding import Finding, judged, skipped
from posed.verify.recording import Recording
from posed.verify.source import EventSource, SuiteClock

_EVENT_S = 5.0
_FLUSH_S = 10.0
_CHURNS = 50
_MOVES = 100
_LONGEST_FIFO_S = 10.0
_FLUSHES = 5
_STALE_NS = 500_000_000
_CLIENT_PERIODS_US = (0, 20_000, 66_667, 200_000)


class Behaviour:
    """Judges one sensor's calls; each verification leaves nothing registered."""

    def __init__(self, source: EventSource, clock: SuiteClock, sensor: Sensor) -> None:
        self._source = source
        self._clock = clock
        self._sensor = sensor
        self._subject = sensor.string_type.removeprefix("android.sensor.")

    def verifications(self) -> dict[str, Callable[[], Iterator[Finding]]]:
        """Return those that apply to the sensor, by name."""
        if self._sensor.reporting_mode == Sensor.REPORTING_MODE_ONE_SHOT:
            return {"OneShot": self.one_shot}
        always = {"RegisterTwice": self.register_twice, "Trigger": self.trigger, "Flush": self.flush}
        if self._sensor.reporting_mode == Sensor.REPORTING_MODE_ON_CHANGE:
            return {**always, "OnChange": self.on_change}
        if self._sensor.reporting_mode != Sensor.REPORTING_MODE_CONTINUOUS:
            return always
        return {
            **always,
            "FlushInactive": self.flush_inactive,
            **({"FifoLength": self.fifo_length} if self._sensor.fifo_max_event_count else {}),
            "NoStaleEvents": self.no_stale_events,
            "MultiClient": self.multi_client,
            "Churn": self.churn,
            "MovingRates": self.moving_rates,
        }

    def register_twice(self) -> Iterator[Finding]:
        """A second registration is refused and changes nothing (SensorTest.testRegisterTwiceWithSameSensor)."""
        listener = self._listener()
        first = self._register(listener, 200_000)
        second = self._register(listener, 0)
        self._source.unregister_listener(listener)
        yield self._judged("RegisterTwice", f"{first}, {second}", "True, False", first and not second)

    def trigger(self) -> Iterator[Finding]:
        """A sensor that is not one-shot cannot be waited for (SensorTest.testRequestTriggerWithNonTriggerSensor)."""
        listener = self._listener()
        found = self._source.request_trigger_sensor(listener, self._sensor)
        if found:
            self._source.cancel_trigger_sensor(listener, self._sensor)
        yield self._judged("Trigger", str(found), "False", not found)

    def one_shot(self) -> Iterator[Finding]:
        """A one-shot sensor cannot be listened to; waiting can be begun and, until it fired, undone once."""
        listener = self._listener()
        listened = self._register(listener, 0)
        self._source.unregister_listener(listener)
        begun = self._source.request_trigger_sensor(listener, self._sensor)
        first = self._source.cancel_trigger_sensor(listener, self._sensor)
        fired = len(listener.triggered)
        second = self._source.cancel_trigger_sensor(listener, self._sensor)
        yield self._judged(
            "OneShot",
            f"listen {listened}, request {begun}, cancel {first} then {second}, fired {fired}",
            "listen False, request True, cancel True then False, or fired once",
            not listened and begun and not second and fired + first == 1,
        )

    def on_change(self) -> Iterator[Finding]:
        """Who registers first is told the value, and who joins the same one (SensorService::enable)."""
        first, joiner = self._listener(), self._listener()
        self._register(first, 0)
        told = self._clock.wait(_EVENT_S, lambda: len(first.received) > 0)
        self._register(joiner, 0)

        def is_told_the_same() -> bool:
            known = {each.event.timestamp for each in first.received}
            return bool(joiner.received) and joiner.received[0].event.timestamp in known

        same = self._clock.wait(_EVENT_S, is_told_the_same)
        self._source.unregister_listener(first)
        self._source.unregister_listener(joiner)
        yield self._judged(
            "OnChange",
            f"{'a' if told else 'no'} value, {'the same' if same else 'not the same'} to who joined",
            f"a value in {_EVENT_S:g} s, the same to who joined",
            told and same,
        )

    def flush(self) -> Iterator[Finding]:
        """Each flush is completed once, for the listener that asked only (SensorTest.testBatchAndFlush, VTS Flush)."""
        for count in (1, _FLUSHES):
            asking, other = self._listener(), self._listener()
            for listener in (asking, other):
                self._register(listener, 0, 10_000_000)
            accepted = sum(self._source.flush(asking) for _ in range(count))
            self._clock.wait(_FLUSH_S, lambda asking=asking, count=count: len(asking.flushed) >= count)  # type: ignore[misc]
            # What comes beyond that would come at once.
            self._clock.wait(0.1)
            self._source.unregister_listener(asking)
            self._source.unregister_listener(other)
            yield self._judged(
                "Flush",
                f"{accepted} of {count} accepted, {len(asking.flushed)} completed, {len(other.flushed)} astray",
                f"{count}, {count} within {_FLUSH_S:g} s, 0",
                (accepted, len(asking.flushed), len(other.flushed)) == (count, count, 0),
            )

    def flush_inactive(self) -> Iterator[Finding]:
        """A listener without a registration cannot flush (VTS FlushInactiveSensor)."""
        listener = self._listener()
        accepted = self._source.flush(listener)
        self._clock.wait(0.1)
        yield self._judged(
            "FlushInactive",
            f"{accepted}, {len(listener.flushed)} completed",
            "False, 0",
            not accepted and not listener.flushed,
        )

    def fifo_length(self) -> Iterator[Finding]:
        """A FIFO holds what it is said to hold (BatchAndFlush of CTS Verifier)."""
        seconds = self._sensor.fifo_max_event_count * self._sensor.min_delay / 1e6
        if seconds > _LONGEST_FIFO_S:
            yield skipped("FifoLength", self._subject, f"to fill the FIFO would take longer than {_LONGEST_FIFO_S:g} s")
            return
        listener = self._listener()
        begun_ns = self._clock.now_ns()
        latency_us = round(4e6 * seconds)
        self._register(listener, 0, latency_us)
        # Twice its length: the first filling can be cut short by what was there before.
        self._clock.wait(2.5 * seconds + 0.5)
        self._source.unregister_listener(listener)
        received = tuple(listener.received)
        yield verify_fifo_length(
            Recording(self._subject, self._sensor, 0, latency_us, begun_ns, self._clock.now_ns(), received)
        )

    def no_stale_events(self) -> Iterator[Finding]:
        """After re-activation, no event is older than it (VTS NoStaleEvents: 500 ms + 3 periods after the last)."""
        before, after = self._listener(), self._listener()
        # Batched, so that something is left to be forgotten.
        self._register(before, 0, 200_000)
        self._clock.wait(_EVENT_S, lambda: len(before.received) > 0)
        self._source.unregister_listener(before)
        pause_ns = _STALE_NS + 3000 * self._sensor.min_delay
        self._clock.wait(pause_ns / 1e9)
        last_ns = max((each.event.timestamp for each in before.received), default=0)
        self._register(after, 0)
        self._clock.wait(_EVENT_S, lambda: len(after.received) > 0)
        self._source.unregister_listener(after)
        first_ns = min((each.event.timestamp for each in after.received), default=0)
        apart_ns = first_ns - last_ns
        yield self._judged(
            "NoStaleEvents",
            f"{apart_ns / 1e6:.0f} ms" if before.received and after.received else "no event",
            f"at least {pause_ns / 1e6:.0f} ms",
            bool(before.received and after.received) and apart_ns >= pause_ns,
        )

    def multi_client(self) -> Iterator[Finding]:
        """Listeners at several rates all get every event of the fastest (SensorIntegrationTests)."""
        listeners = [self._listener() for _ in _CLIENT_PERIODS_US]
        for listener, period_us in zip(listeners, _CLIENT_PERIODS_US, strict=True):
            self._register(listener, period_us)
        self._clock.wait(_EVENT_S, lambda: all(listener.received for listener in listeners))
        self._clock.wait(1.0)
        for listener in listeners:
            self._source.unregister_listener(listener)
        times = [{each.event.timestamp for each in listener.received} for listener in listeners]
        begin = max((min(each) for each in times if each), default=0)
        end = min((max(each) for each in times if each), default=0)
        inside = [{t for t in each if begin <= t <= end} for each in times]
        missing = max((len(inside[0] ^ each) for each in inside), default=0)
        yield self._judged(
            "MultiClient",
            f"{len(inside[0])} events, {missing} not given to all",
            f"2 or more, 0, at {len(listeners)} rates",
            len(inside[0]) >= 2 and missing == 0 and all(times),
        )

    def churn(self) -> Iterator[Finding]:
        """Registering and unregistering many times leaves a sensor that works, and a listener that is left in peace."""
        refused = astray = 0
        for _ in range(_CHURNS):
            listener = self._listener()
            refused += not self._register(listener, 0)
            self._source.unregister_listener(listener)
            count = len(listener.received)
            self._clock.wait(0.002)
            astray += len(listener.received) - count
        yield self._still_works("Churn", f"{refused} refused, {astray} astray", "0, 0", refused == astray == 0)

    def moving_rates(self) -> Iterator[Finding]:
        """A listener at a steady rate stays served while another changes its rate (SensorIntegrationTests)."""
        steady = self._listener()
        refused = int(not self._register(steady, 200_000))
        rng = random.Random(0)
        for _ in range(_MOVES):
            moving = self._listener()
            refused += not self._register(moving, rng.randrange(self._sensor.min_delay or 1, 200_000))
            self._clock.wait(0.01)
            self._source.unregister_listener(moving)
        self._source.unregister_listener(steady)
        times = [each.event.timestamp for each in steady.received]
        backwards = sum(b <= a for a, b in itertools.pairwise(times))
        yield self._still_works(
            "MovingRates",
            f"{refused} refused, {len(times)} events, {backwards} out of order",
            "0, 2 or more, 0",
            refused == backwards == 0 and len(times) >= 2,
        )

    def _still_works(self, name: str, measured: str, threshold: str, passes: bool) -> Finding:
        listener = self._listener()
        self._register(listener, 0)
        works = self._clock.wait(_EVENT_S, lambda: len(listener.received) > 0)
        self._source.unregister_listener(listener)
        event = "an event" if works else "no event"
        return self._judged(
            name, f"{measured}, then {event}", f"{threshold}, an event in {_EVENT_S:g} s", passes and works
        )

    def _listener(self) -> Collector:
        return Collector(self._clock)

    def _register(self, listener: Collector, period_us: int, latency_us: int = 0) -> bool:
        return self._source.register_listener(listener, self._sensor, period_us, latency_us)

    def _judged(self, name: str, measured: str, threshold: str, passes: bool) -> Finding:
        return judged(name, self._subject, measured, threshold, passes)
