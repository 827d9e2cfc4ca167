"""The text of `dumpsys sensorservice`, line by line."""

import os
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from posed.events import ReportingMode, SensorInfo, SensorType
from posed.sensors import Client
from posed.sensors.dump import Traffic, _listed, dump

MakeBench = Callable[..., Any]
ACC, GYRO = SensorType.ACCELEROMETER, SensorType.GYROSCOPE
_WALL_NS = 1_700_000_000_123_000_000  # 22:13:20 UTC
_APP = Client("com.example", 10123, 4321, 35)


@pytest.fixture(autouse=True)
def _utc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(os.environ, "TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def _dump(bench: Any, traffic: dict[Any, Traffic] | None = None) -> list[str]:
    return dump(bench.service, bench.clock.now_ns(), _WALL_NS, traffic or {}).splitlines()


def _section(lines: list[str], title: str) -> list[str]:
    """Return the lines below a title that are its own."""
    start = next(row for row, line in enumerate(lines) if line.startswith(title)) + 1
    titles = ("Sensor Device", "Sensor List", "Fusion States", "Recent Sensor", "Active sensors", "Socket Buffer")
    end = next((row for row in range(start, len(lines)) if lines[row].startswith(titles)), len(lines))
    return lines[start:end]


def test_it_has_androids_sections_in_androids_order(make_bench: MakeBench) -> None:
    lines = _dump(make_bench())
    assert lines[0] == "Captured at: 22:13:20.123"
    headings = [line for line in lines if re.match(r"[A-Z0-9]", line) and not line.startswith("0x")]
    assert [re.sub(r"fusion.*", "fusion", line) for line in headings] == [
        "Captured at: 22:13:20.123",
        "Sensor Device:",
        "Total 3 h/w sensors, 0 running 0 disabled clients:",
        "Sensor List:",
        "Fusion States:",
        "9-axis fusion",
        "Recent Sensor events:",
        "Active sensors:",
        "Socket Buffer size = 984 events",
        "WakeLock Status: not held ",
        "Mode : NORMAL",
        "Sensor Privacy: disabled",
        "0 active connections",
        "0 direct connections",
        "Previous Registrations:",
    ]


def test_it_tells_what_each_client_asked_and_what_was_selected(make_bench: MakeBench) -> None:
    bench = make_bench()
    for period_us, latency_us in ((20_000, 1_000_000), (200_000, 0)):
        bench.service.enable(bench.service.connect(_APP), GYRO, period_us, latency_us)
    lines = _section(_dump(bench), "Sensor Device")
    assert lines == [
        "Total 3 h/w sensors, 1 running 0 disabled clients:",
        "0x00000004) active-count = 2; sampling_period(ms) = {20.0, 200.0}, selected = 20.00 ms; "
        "batching_period(ms) = {1000.0, 0.0}, selected = 200.00 ms",
    ]


def _info(**changes: Any) -> SensorInfo:
    info = SensorInfo(
        handle=4,
        type=GYRO,
        name="Part",
        vendor="Maker",
        version=2,
        max_range=10.0,
        resolution=0.01,
        power_ma=1.0,
        min_delay_us=5_000,
        max_delay_us=200_000,
        fifo_reserved_event_count=10,
        fifo_max_event_count=100,
    )
    return replace(info, **changes)


@pytest.mark.parametrize(
    ("info", "first", "second"),
    [
        (
            _info(),
            "0x00000004) Part                      | Maker           | ver: 2 | type: android.sensor.gyroscope(4) "
            "| perm: n/a | flags: 0x00000000",
            "\tcontinuous | minRate=5.00Hz | maxRate=200.00Hz | FIFO (max,reserved) = (100, 10) events | non-wakeUp | ",
        ),
        (
            _info(
                handle=8,
                type=SensorType.PROXIMITY,
                reporting_mode=ReportingMode.ON_CHANGE,
                wake_up=True,
                min_delay_us=0,
                max_delay_us=0,
                fifo_max_event_count=0,
                fifo_reserved_event_count=0,
                required_permission="android.permission.X",
                is_dynamic=True,
                has_additional_info=True,
                supports_data_injection=True,
            ),
            "0x00000008) Part                      | Maker           | ver: 2 | type: android.sensor.proximity(8) "
            "| perm: android.permission.X | flags: 0x00000073",
            "\ton-change | maxDelay=0us | minDelay=0us | no batching | wakeUp | "
            "data-injection, dynamic, has-additional-info, ",
        ),
        (
            _info(
                handle=17, type=SensorType.SIGNIFICANT_MOTION, reporting_mode=ReportingMode.ONE_SHOT, min_delay_us=-1
            ),
            "0x00000011) Part                      | Maker           | ver: 2 | "
            "type: android.sensor.significant_motion(17) | perm: n/a | flags: 0x00000004",
            "\tone-shot | minRate=5.00Hz | minDelay=-1us | FIFO (max,reserved) = (100, 10) events | non-wakeUp | ",
        ),
    ],
)
def test_a_sensor_has_two_lines(info: SensorInfo, first: str, second: str) -> None:
    assert list(_listed(info)) == [first, second]


def test_recent_events_stand_with_their_times_oldest_first(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.enable(bench.service.connect(_APP), GYRO, 20_000, 0)
    bench.advance_ms(1000)
    lines = _section(_dump(bench), "Recent Sensor")
    assert lines[0] == "GYROSCOPE: last 10 events"
    assert lines[1] == "\t 1 (ts=0.820000000, wall=22:13:20.123) 1.00, 1.00, 1.00, "
    assert lines[10] == "\t10 (ts=1.000000000, wall=22:13:20.123) 1.00, 1.00, 1.00, "
    assert len(lines) == 11


def test_values_that_need_a_permission_are_masked(make_bench: MakeBench) -> None:
    bench = make_bench((SensorType.STEP_DETECTOR,))
    sensor = bench.service._table[SensorType.STEP_DETECTOR]
    sensor.info = replace(sensor.info, required_permission="android.permission.ACTIVITY_RECOGNITION")
    walker = replace(_APP, permissions=frozenset((sensor.info.required_permission,)))
    bench.service.enable(bench.service.connect(walker), SensorType.STEP_DETECTOR, 0, 0)
    bench.source.happen(SensorType.STEP_DETECTOR, 10, 1)
    bench.advance_ms(20)
    assert _section(_dump(bench), "Recent Sensor")[1].endswith(") [value masked]")


def test_the_fusion_tells_its_clients_orientation_and_bias(make_bench: MakeBench) -> None:
    bench = make_bench()
    bench.service.register_pose("a", 100_000, 5_000)
    bench.service.enable(bench.service.connect(_APP), SensorType.ROTATION_VECTOR, 20_000, 0)
    bench.advance_ms(100)
    assert _section(_dump(bench), "Fusion States") == [
        "9-axis fusion enabled (2 clients), gyro-rate= 200.00Hz, q=< 0, 0, 0, 1 > (1), b=< 1, 1, 1 >",
        "game fusion(no mag) disabled (0 clients), gyro-rate=   0.00Hz, q=< 0, 0, 0, 0 > (0), b=< 0, 0, 0 >",
        "geomag fusion (no gyro) disabled (0 clients), gyro-rate=   0.00Hz, q=< 0, 0, 0, 0 > (0), b=< 0, 0, 0 >",
    ]


def test_a_connection_tells_who_it_is_what_it_has_and_what_it_got(make_bench: MakeBench) -> None:
    bench = make_bench(fifo=100)
    connection = bench.service.connect(_APP)
    bench.service.enable(connection, GYRO, 20_000, 0)
    bench.service.enable(connection, ACC, 20_000, 0)
    bench.advance_ms(100)
    sent = len(connection.take(6))
    lines = _dump(bench, {connection: Traffic(sent, connection.events_cached)})
    assert [line for line in lines if line.startswith("GYROSCOPE (")] == [
        "GYROSCOPE (handle=0x00000004, connections=1)"
    ]
    start = lines.index("Connection Number: 0 ")
    assert lines[start - 1 : start + 6] == [
        "1 active connections",
        "Connection Number: 0 ",
        "\tOperating Mode: NORMAL",
        "\t com.example | WakeLockRefCount 0 | uid 10123 | cache size 4 | max cache size 100",
        "\t GYROSCOPE 0x00000004 | status: active | pending flush events 0 ",
        "\t ACCELEROMETER 0x00000001 | status: active | pending flush events 0 ",
        "\t events recvd: 10 | sent 6 | cache 4 | dropped 0 | total_acks_needed 0 | total_acks_recvd 0",
    ]


def test_previous_registrations_stand_the_newest_first(make_bench: MakeBench) -> None:
    bench = make_bench()
    connection = bench.service.connect(_APP)
    bench.service.enable(connection, GYRO, 20_000, 100_000)
    bench.advance_ms(2000)
    bench.service.disable(connection, GYRO)
    lines = _dump(bench)
    assert lines[lines.index("Previous Registrations:") + 1 :] == [
        "22:13:20 - 0x00000004 pid= 4321 uid=10123 package=com.example",
        "22:13:18 + 0x00000004 pid= 4321 uid=10123 package=com.example samplingPeriod=20000us batchingPeriod=100000us",
    ]
