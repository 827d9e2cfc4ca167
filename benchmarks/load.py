"""The client processes of the benchmarks; they keep to the rules of posed.cli.profiling.workload.

python load.py many COUNT      pose clients at 10 Hz in one process
python load.py latency         a listener to the raw sensors, each event as it happens, that notes how old they are
python load.py count NUMBER... listeners at mixed rates in one process, which count what they get
python load.py first MODE      a pose client that notes when its first pose was published
python load.py loop deadline|event RECORDING DIRECTORY
                               the daemon's pipeline alone, woken for each pose or for each event
python load.py bare DIRECTORY  nothing but ten wake-ups a second and as large a message sent at each
"""

import json
import resource
import sys
import threading
import time
from pathlib import Path
from typing import Any

from posed.cli.profiling.workload import begin
from posed.client import SENSOR_DELAY_FASTEST, Package, Pose, PoseClient, Sensor, SensorEvent, SensorManager

_INPUTS = (Sensor.TYPE_ACCELEROMETER, Sensor.TYPE_GYROSCOPE, Sensor.TYPE_MAGNETIC_FIELD)


def many(count: int) -> dict[str, Any]:
    """Hold `count` pose clients; return the poses that each got."""
    # Each has a ZeroMQ context of its own, a dozen descriptors.
    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))
    ended = threading.Event()
    poses = [0] * count
    started = [threading.Event() for _ in range(count)]

    def client(index: int) -> PoseClient:
        def take(pose: Pose) -> None:
            poses[index] += 1
            started[index].set()

        return PoseClient(SENSOR_DELAY_FASTEST, on_pose=take)

    clients = [client(index) for index in range(count)]
    for event in started:
        event.wait()
    before = list(poses)
    began_at = time.monotonic()
    begin(ended.set)
    ended.wait()
    result = [now - then for now, then in zip(poses, before, strict=True)]
    elapsed_s = time.monotonic() - began_at
    for each in clients:
        each.close()
    return {"fewest": min(result), "most": max(result), "seconds": elapsed_s}


def latency() -> dict[str, Any]:
    """Return the percentiles of callback time minus sample time, ms; a simulated phone's samples are on BOOTTIME."""
    ages: list[int] = []
    ended = threading.Event()

    class Listener:
        def on_sensor_changed(self, event: SensorEvent) -> None:
            ages.append(time.clock_gettime_ns(time.CLOCK_BOOTTIME) - event.timestamp)

    listener = Listener()
    with SensorManager() as manager:
        manager.wait_connected()
        for sensor_type in _INPUTS:
            manager.register_listener(listener, manager.get_default_sensor(sensor_type), SENSOR_DELAY_FASTEST, 0)
        begin(ended.set)
        ended.wait()
    ages.sort()
    return {"count": len(ages), "p50_ms": ages[len(ages) // 2] / 1e6, "p99_ms": ages[len(ages) * 99 // 100] / 1e6}


def count(numbers: list[int]) -> dict[str, Any]:
    """Return what each client got: its events, those out of order or twice, and those it knows were dropped."""
    rates = (*range(4), 100_000)
    latencies_us = (0, 0, 50_000, 500_000)
    ended = threading.Event()

    class Counting:
        def __init__(self, number: int) -> None:
            self.count = self.disorder = 0
            self.last: dict[int, int] = {}
            self.manager = SensorManager(package=Package(f"com.example.client{number:02d}"))
            listed = self.manager.get_sensor_list()
            sensors = [each for each in listed if each.reporting_mode == Sensor.REPORTING_MODE_CONTINUOUS]
            if number not in (1, 25):  # these have all there are
                sensors = [sensors[(number + k) % len(sensors)] for k in range(2)]
            for sensor in sensors:
                rate, latency_us = rates[number % len(rates)], latencies_us[number % len(latencies_us)]
                if not self.manager.register_listener(self, sensor, rate, latency_us, decimate=number % 7 == 3):
                    raise SystemExit(f"client {number} was refused")

        def on_sensor_changed(self, event: SensorEvent) -> None:
            self.count += 1
            self.disorder += event.timestamp <= self.last.get(event.sensor.handle, -1)
            self.last[event.sensor.handle] = event.timestamp

        def result(self) -> dict[str, int]:
            return {
                "count": self.count,
                "disorder": self.disorder,
                "dropped": self.manager.get_events_dropped(self),
            }

    clients = {f"com.example.client{number:02d}": Counting(number) for number in numbers}
    begin(ended.set)
    ended.wait()
    return {name: client.result() for name, client in clients.items()}


def first(rate_mode: int) -> dict[str, Any]:
    """Return sequence and publication time of the first pose, and where the recording's time 0 stood."""
    ended = threading.Event()
    with PoseClient(rate_mode) as client:
        pose = client.next_pose()
        begin(ended.set)
        ended.wait()
    if pose is None:
        raise SystemExit("no pose")
    return {"published_ns": pose.delivery.published_ns, "zero_ns": pose.delivery.to_boot_ns(0)}


def loop(wake_per: str, recording: str, directory: Path) -> dict[str, Any]:
    """Run source, sensor service, filter and publisher as the daemon does, without its control socket."""
    from posed.binder.runtime import pose_path
    from posed.binder.sockets import context
    from posed.clock import BootClock
    from posed.daemon.publisher import PosePublisher
    from posed.daemon.statistics import PublicationStatistics
    from posed.daemon.waiting import Waiter
    from posed.events import SensorType
    from posed.fusion import DEFAULT_FILTER
    from posed.hal import open_source
    from posed.hal.profile import load_profile
    from posed.sensors import SensorService, make_device_filter

    clock = BootClock()
    profile = load_profile("patonis2018")
    source = open_source(f"replay:{recording}", profile, clock, loop=True)
    service = SensorService(source, make_device_filter(DEFAULT_FILTER, profile), clock)
    statistics = PublicationStatistics()
    publisher = PosePublisher(pose_path(directory), context(), bytes(16), clock, source, statistics)
    service.register_pose("loop", 100_000, 0)
    inputs = (SensorType.ACCELEROMETER, SensorType.GYROSCOPE, SensorType.MAGNETIC_FIELD)
    handles = [sensor.handle for sensor in source.sensors if sensor.type in inputs]
    ended = threading.Event()
    begin(ended.set)
    waiter = Waiter((publisher.socket,))
    readable = waiter.readable()
    while not ended.is_set():
        if readable:
            publisher.read_subscriptions()
        service.advance()
        publisher.publish(service.take_poses())
        due = service.next_deadline_ns()
        if wake_per == "event":
            samples = (source.next_sample_ns(handle) for handle in handles)
            due = source.time_map.to_boot(min(sample for sample in samples if sample is not None))
        readable = waiter.readable()
        if not readable and waiter.wait(due):
            readable = waiter.readable()
    waiter.close()
    publisher.close()
    return {"poses": statistics.published, "events": service.events_fused}


def bare(directory: Path) -> dict[str, Any]:
    """Wake and send as a daemon does for its poses, with nothing between."""
    from posed.binder.runtime import bind_socket, pose_path, unlink_socket
    from posed.binder.sockets import context, xpub
    from posed.clock import BootClock
    from posed.daemon.encoding import pose_topic
    from posed.daemon.waiting import Waiter
    from posed.fusion import DEFAULT_FILTER

    path = pose_path(directory)
    socket = xpub(context())
    bind_socket(socket, path)
    ended = threading.Event()
    begin(ended.set)
    waiter = Waiter((socket,))
    due_ns = BootClock().now_ns()
    message = pose_topic(100_000, DEFAULT_FILTER) + bytes(150)
    sent = 0
    while not ended.is_set():
        for _ in waiter.readable():
            socket.recv()
        if not waiter.wait(due_ns):
            socket.send(message)
            sent += 1
            due_ns += 100_000_000
    waiter.close()
    socket.close()
    unlink_socket(path)
    return {"poses": sent}


def main() -> int:
    """Run the process that the command line names."""
    kind, *rest = sys.argv[1:]
    if kind == "many":
        result = many(int(rest[0]))
    elif kind == "latency":
        result = latency()
    elif kind == "count":
        result = count([int(number) for number in rest])
    elif kind == "first":
        result = first(int(rest[0]))
    elif kind == "bare":
        result = bare(Path(rest[0]))
    else:
        result = loop(rest[0], rest[1], Path(rest[2]))
    print(json.dumps(result), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
