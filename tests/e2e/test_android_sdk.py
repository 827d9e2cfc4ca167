"""Android's SensorManager against a real daemon whose phone has sensors of every reporting mode."""

import asyncio
import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from posed.client import (
    HIGH_SAMPLING_RATE_SENSORS,
    SENSOR_DELAY_FASTEST,
    SENSOR_DELAY_GAME,
    SENSOR_DELAY_NORMAL,
    Handler,
    Package,
    Sensor,
    SensorEvent,
    SensorManager,
    TriggerEvent,
)
from posed.errors import InvalidArgumentError, InvalidStateError, PermissionDeniedError

Eventually = Callable[[Callable[[], object]], None]


class Listener:
    def __init__(self, enough: int = 1) -> None:
        self.events: list[SensorEvent] = []
        self.flushed: list[Sensor] = []
        self.has_enough = threading.Event()
        self.has_flushed = threading.Event()
        self._enough = enough

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.events.append(event)
        if len(self.events) >= self._enough:
            self.has_enough.set()

    def on_flush_completed(self, sensor: Sensor) -> None:
        self.flushed.append(sensor)
        self.has_flushed.set()


class Trigger:
    def __init__(self, manager: SensorManager) -> None:
        self.events: list[TriggerEvent] = []
        self.was_pending: bool | None = None
        self.fired = threading.Event()
        self._manager = manager

    def on_trigger(self, event: TriggerEvent) -> None:
        self.was_pending = self._manager.cancel_trigger_sensor(self, event.sensor)
        self.events.append(event)
        self.fired.set()


def _sensor(manager: SensorManager, kind: int) -> Sensor:
    sensor = manager.get_default_sensor(kind)
    assert sensor is not None
    return sensor


def _uses(manager: SensorManager, kind: int) -> int:
    return sum(each.registrations for each in manager.get_statistics().sensors if each.handle == kind)


def test_most_failures_are_false_and_few_are_exceptions(desk: Any) -> None:
    desk.serve_bench_phone()
    with SensorManager() as manager:
        listener, trigger = Listener(), Trigger(manager)
        gyroscope, motion = _sensor(manager, Sensor.TYPE_GYROSCOPE), _sensor(manager, Sensor.TYPE_MOTION_DETECT)
        assert not manager.register_listener(None, gyroscope, SENSOR_DELAY_GAME)
        assert not manager.register_listener(listener, None, SENSOR_DELAY_GAME)
        assert not manager.register_listener(listener, motion, SENSOR_DELAY_GAME)
        assert not manager.register_listener(listener, gyroscope, -1)
        assert not manager.register_listener(listener, gyroscope, SENSOR_DELAY_GAME, -1)
        for period, latency in ((2**31, 0), ("1", 0), (0.5, 0), (0, 2**63), (0, 0.5)):
            with pytest.raises(InvalidArgumentError):
                manager.register_listener(listener, gyroscope, period, latency)  # type: ignore[arg-type]
        assert manager.register_listener(listener, gyroscope, SENSOR_DELAY_NORMAL)
        assert not manager.register_listener(listener, gyroscope, SENSOR_DELAY_FASTEST)
        assert {s.requested_period_us for s in manager.get_statistics().sensors} == {200_000}
        manager.unregister_listener(None)
        manager.unregister_listener(Listener())
        assert not manager.flush(Listener())
        with pytest.raises(InvalidArgumentError):
            manager.flush(None)
        assert not manager.request_trigger_sensor(trigger, gyroscope)
        with pytest.raises(InvalidArgumentError):
            manager.request_trigger_sensor(None, motion)
        with pytest.raises(InvalidArgumentError):
            manager.request_trigger_sensor(trigger, None)
        assert not manager.cancel_trigger_sensor(trigger, gyroscope)
        assert not manager.cancel_trigger_sensor(trigger, motion)
        with pytest.raises(InvalidArgumentError):
            manager.register_dynamic_sensor_callback(None)
        manager.unregister_dynamic_sensor_callback(None)


def test_a_latency_without_a_fifo_streams(desk: Any) -> None:
    desk.serve_bench_phone()
    listener = Listener(2)
    with SensorManager() as manager:
        light = _sensor(manager, Sensor.TYPE_LIGHT)
        assert light.fifo_max_event_count == 0
        assert manager.register_listener(listener, light, SENSOR_DELAY_GAME, 60_000_000)
        assert listener.has_enough.wait(10)


def test_129_listeners_are_too_many(desk: Any) -> None:
    desk.serve_bench_phone()
    with SensorManager() as manager:
        light = _sensor(manager, Sensor.TYPE_LIGHT)
        listeners = [Listener() for _ in range(129)]
        for listener in listeners[:128]:
            assert manager.register_listener(listener, light, SENSOR_DELAY_NORMAL)
        with pytest.raises(InvalidStateError, match="128"):
            manager.register_listener(listeners[128], light, SENSOR_DELAY_NORMAL)
        manager.unregister_listener(listeners[0])
        assert manager.register_listener(listeners[128], light, SENSOR_DELAY_NORMAL)


def test_default_sensors_are_those_that_wake_the_phone_where_android_says_so(desk: Any) -> None:
    desk.serve_bench_phone()
    with SensorManager() as manager:
        assert _sensor(manager, Sensor.TYPE_PROXIMITY).name == "Proximity Wakeup"
        assert _sensor(manager, Sensor.TYPE_SIGNIFICANT_MOTION).is_wake_up_sensor
        assert not _sensor(manager, Sensor.TYPE_GYROSCOPE).is_wake_up_sensor
        sleeping = manager.get_default_sensor(Sensor.TYPE_PROXIMITY, wake_up=False)
        assert sleeping is not None
        assert sleeping.name == "Proximity"
        assert manager.get_default_sensor(Sensor.TYPE_GYROSCOPE, wake_up=True) is None


def test_a_one_shot_sensor_is_disabled_before_its_listener_is_called(desk: Any) -> None:
    desk.serve_bench_phone()
    with SensorManager() as manager:
        trigger = Trigger(manager)
        motion = _sensor(manager, Sensor.TYPE_MOTION_DETECT)
        assert (motion.reporting_mode, motion.min_delay) == (Sensor.REPORTING_MODE_ONE_SHOT, -1)
        for times in (1, 2):
            trigger.fired.clear()
            assert manager.request_trigger_sensor(trigger, motion)
            assert not manager.request_trigger_sensor(trigger, motion)
            assert trigger.fired.wait(10)
            assert len(trigger.events) == times
            assert trigger.was_pending is False
            assert _uses(manager, Sensor.TYPE_MOTION_DETECT) == 0


def test_a_cancelled_trigger_request_is_gone(desk: Any) -> None:
    desk.serve_bench_phone()
    with SensorManager() as manager:
        trigger = Trigger(manager)
        significant = _sensor(manager, Sensor.TYPE_SIGNIFICANT_MOTION)
        assert manager.request_trigger_sensor(trigger, significant)
        assert _uses(manager, Sensor.TYPE_SIGNIFICANT_MOTION) == 1
        assert manager.cancel_trigger_sensor(trigger, significant)
        assert _uses(manager, Sensor.TYPE_SIGNIFICANT_MOTION) == 0
        assert not manager.cancel_trigger_sensor(trigger)


def test_an_on_change_sensor_tells_a_joiner_its_value_at_once(desk: Any) -> None:
    desk.serve_bench_phone()
    first = Listener(2)
    with SensorManager() as manager:
        light = _sensor(manager, Sensor.TYPE_LIGHT)

        def is_told_what_was() -> bool:
            joiner = Listener()
            before = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
            assert manager.register_listener(joiner, light, SENSOR_DELAY_NORMAL)
            assert joiner.has_enough.wait(10)
            return joiner.events[0].timestamp < before

        assert manager.register_listener(first, light, SENSOR_DELAY_NORMAL)
        assert first.has_enough.wait(10)
        # Where another process has the core meanwhile, the next value, of ten a second, is there before the joiner.
        assert any(is_told_what_was() for _ in range(10))


def test_timestamps_are_on_the_boot_time_clock(desk: Any) -> None:
    desk.serve_bench_phone()
    listener = Listener(50)
    with SensorManager() as manager:
        began_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
        assert manager.register_listener(listener, _sensor(manager, Sensor.TYPE_GYROSCOPE), SENSOR_DELAY_FASTEST)
        assert listener.has_enough.wait(10)
        times = [event.timestamp for event in listener.events]
    assert began_ns < times[0]
    assert times[-1] < time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    assert times == sorted(set(times))


def test_more_than_200_hz_needs_a_permission(desk: Any) -> None:
    desk.serve_bench_phone("modern")

    def period_us(package: Package) -> tuple[int, int]:
        """Return the gyroscope's min_delay as the package sees it, and the period it gets at FASTEST."""
        with SensorManager(package=package) as manager:
            gyroscope = _sensor(manager, Sensor.TYPE_GYROSCOPE)
            assert manager.register_listener(Listener(), gyroscope, SENSOR_DELAY_FASTEST)
            (statistics,) = manager.get_statistics().sensors
            return gyroscope.min_delay, statistics.requested_period_us

    assert period_us(Package(target_sdk=35)) == (5000, 5000)
    assert period_us(Package(target_sdk=30)) == (2500, 2500)
    assert period_us(Package(target_sdk=35, permissions=(HIGH_SAMPLING_RATE_SENSORS,))) == (2500, 2500)
    with SensorManager(package=Package(debuggable=True)) as manager:
        gyroscope = _sensor(manager, Sensor.TYPE_GYROSCOPE)
        with pytest.raises(PermissionDeniedError, match="sampling rate of 0 microseconds"):
            manager.register_listener(Listener(), gyroscope, SENSOR_DELAY_FASTEST)
        assert manager.register_listener(Listener(), gyroscope, 5000)
        assert manager.register_listener(
            Listener(), _sensor(manager, Sensor.TYPE_ROTATION_VECTOR), SENSOR_DELAY_FASTEST
        )


def test_dynamic_sensors_come_and_go(desk: Any, eventually: Eventually) -> None:
    desk.serve_bench_phone()
    said: list[tuple[str, str]] = []

    class Callback:
        def on_dynamic_sensor_connected(self, sensor: Sensor) -> None:
            said.append(("connected", sensor.name))

        def on_dynamic_sensor_disconnected(self, sensor: Sensor) -> None:
            said.append(("disconnected", sensor.name))

    listener = Listener()
    callback = Callback()
    with SensorManager() as manager:
        assert manager.register_listener(Listener(), _sensor(manager, Sensor.TYPE_GYROSCOPE), SENSOR_DELAY_GAME)
        manager.register_dynamic_sensor_callback(callback)
        manager.register_dynamic_sensor_callback(callback)
        assert manager.get_dynamic_sensor_list() == []
        desk.tell_phone("dynamic", True)
        eventually(lambda: said == [("connected", "Clip-on")])
        (clip_on,) = manager.get_dynamic_sensor_list(Sensor.TYPE_LIGHT)
        assert (clip_on.is_dynamic_sensor, clip_on.id) == (True, -1)
        assert clip_on not in manager.get_sensor_list()
        assert manager.register_listener(listener, clip_on, SENSOR_DELAY_GAME)
        assert listener.has_enough.wait(10)
        desk.tell_phone("dynamic", False)
        eventually(lambda: said[1:] == [("disconnected", "Clip-on")])
        manager.unregister_dynamic_sensor_callback(callback)
        desk.tell_phone("dynamic", True)
        eventually(lambda: len(manager.get_dynamic_sensor_list()) == 1)
        assert len(said) == 2
        listener.has_enough.clear()
        assert manager.register_listener(listener, clip_on, SENSOR_DELAY_GAME), "its registration went with it"
        assert listener.has_enough.wait(10)


def test_a_dynamic_sensor_callback_may_have_one_of_its_methods_only(desk: Any, eventually: Eventually) -> None:
    daemon = desk.serve_bench_phone()

    class Coming:
        def __init__(self) -> None:
            self.said: list[str] = []

        def on_dynamic_sensor_connected(self, sensor: Sensor) -> None:
            self.said.append(sensor.name)

    coming = Coming()
    with SensorManager() as manager:
        assert manager.register_listener(Listener(), _sensor(manager, Sensor.TYPE_GYROSCOPE), SENSOR_DELAY_GAME)
        manager.register_dynamic_sensor_callback(coming)  # type: ignore[arg-type]
        desk.tell_phone("dynamic", True)
        eventually(lambda: coming.said == ["Clip-on"])
        daemon.kill()
        daemon.wait()
        desk.serve_bench_phone()
        eventually(lambda: coming.said == ["Clip-on"] * 2)
        desk.tell_phone("dynamic", False)
        eventually(lambda: manager.get_dynamic_sensor_list() == [])


def test_clients_see_a_gap_and_no_error_when_the_phone_is_lost_and_found(desk: Any, eventually: Eventually) -> None:
    desk.serve_bench_phone()
    listener = Listener(20)
    problems: list[str] = []
    with SensorManager(
        on_service_disconnected=lambda: problems.append("disconnected"), on_binding_died=problems.append
    ) as manager:
        assert manager.register_listener(listener, _sensor(manager, Sensor.TYPE_GYROSCOPE), SENSOR_DELAY_GAME)
        assert listener.has_enough.wait(10)
        desk.tell_phone("lost", True)
        seen = -1
        while len(listener.events) != seen:
            seen = len(listener.events)
            assert manager.flush(listener)
            assert listener.has_flushed.wait(10)
            listener.has_flushed.clear()
        desk.tell_phone("lost", False)
        eventually(lambda: len(listener.events) > seen + 10)
        times = [event.timestamp for event in listener.events]
        assert times == sorted(set(times))
        assert manager.get_statistics().sensors[0].configured_period_ns == 20_000_000
    assert problems == []


def test_callbacks_run_on_the_thread_that_pumps_their_handler(desk: Any) -> None:
    desk.serve_bench_phone()
    threads: set[int] = set()
    handler = Handler()

    class Noting:
        count = 0

        def on_sensor_changed(self, event: SensorEvent) -> None:
            threads.add(threading.get_ident())
            self.count += 1
            if self.count == 10:
                handler.quit()

    with SensorManager() as manager:
        assert manager.register_listener(
            Noting(), _sensor(manager, Sensor.TYPE_GYROSCOPE), SENSOR_DELAY_GAME, handler=handler
        )
        handler.run()
    assert threads == {threading.get_ident()}


def test_events_can_be_iterated_over(desk: Any, eventually: Eventually) -> None:
    desk.serve_bench_phone()
    with SensorManager() as manager:
        gyroscope = _sensor(manager, Sensor.TYPE_GYROSCOPE)
        times = []
        for event in manager.stream(gyroscope, SENSOR_DELAY_GAME):
            times.append(event.timestamp)
            if len(times) == 5:
                break
        assert times == sorted(set(times))
        eventually(lambda: _uses(manager, Sensor.TYPE_GYROSCOPE) == 0)
        with manager.stream(gyroscope, SENSOR_DELAY_GAME) as stream:
            assert stream.next(timeout_s=10) is not None
        assert _uses(manager, Sensor.TYPE_GYROSCOPE) == 0
        with pytest.raises(InvalidArgumentError, match="one-shot"):
            manager.stream(_sensor(manager, Sensor.TYPE_MOTION_DETECT), SENSOR_DELAY_GAME)
        left = manager.stream(gyroscope, SENSOR_DELAY_GAME)
    for event in left:
        assert event.sensor == gyroscope
    assert left.next() is None


def test_events_can_be_awaited(desk: Any) -> None:
    desk.serve_bench_phone()

    async def take(manager: SensorManager, kind: int) -> list[int]:
        times: list[int] = []
        async for event in manager.stream(_sensor(manager, kind), SENSOR_DELAY_GAME):
            times.append(event.timestamp)
            if len(times) == 5:
                break
        return times

    async def both(manager: SensorManager) -> list[list[int]]:
        kinds = (Sensor.TYPE_GYROSCOPE, Sensor.TYPE_ACCELEROMETER)
        return list(await asyncio.gather(*(take(manager, kind) for kind in kinds)))

    with SensorManager() as manager:
        for times in asyncio.run(both(manager)):
            assert times == sorted(set(times))
            assert len(times) == 5


_FIVE_LINES = """
from posed.client import SENSOR_DELAY_GAME, Sensor, SensorManager
with SensorManager() as manager:
    gyroscope = manager.get_default_sensor(Sensor.TYPE_GYROSCOPE)
    for event in manager.stream(gyroscope, SENSOR_DELAY_GAME):
        print(event.timestamp, event.values, flush=True)
"""


def test_a_script_is_five_lines(desk: Any) -> None:
    desk.serve_bench_phone()
    with subprocess.Popen([sys.executable, "-c", _FIVE_LINES], stdout=subprocess.PIPE, text=True) as script:
        assert script.stdout is not None
        assert len([script.stdout.readline() for _ in range(5)]) == 5
        script.kill()


def test_dumpsys_tells_the_package_the_kernels_user_and_what_it_asked(desk: Any) -> None:
    desk.serve_bench_phone()
    listener = Listener(5)
    with SensorManager(package=Package("com.example.walk")) as manager:
        assert manager.register_listener(listener, _sensor(manager, Sensor.TYPE_GYROSCOPE), SENSOR_DELAY_GAME, 100_000)
        assert listener.has_enough.wait(10)
        run = desk.posed("dumpsys", "sensorservice")
    assert run.returncode == 0
    assert len(run.stdout) > 2000
    assert "BMI055 Gyroscope (handle=0x00000004, connections=1)\n" in run.stdout
    assert "\t com.example.walk | WakeLockRefCount 0 | uid " in run.stdout
    assert "package=com.example.walk samplingPeriod=20000us batchingPeriod=100000us\n" in run.stdout
    assert run.stdout.index("Captured at: ") == 0


def test_the_command_shows_sensors_of_every_reporting_mode(desk: Any) -> None:
    desk.serve_bench_phone()
    table = desk.posed("sensors")
    assert table.returncode == 0
    assert "motion_detect" in table.stdout
    once = desk.posed("events", "motion_detect", "--json")
    assert (once.returncode, once.stderr) == (0, "")
    assert json.loads(once.stdout)["sensor"] == "motion_detect"
    changes = desk.posed("events", "light", "--json", "--count", "3")
    assert changes.returncode == 0
    assert len(changes.stdout.splitlines()) == 3
