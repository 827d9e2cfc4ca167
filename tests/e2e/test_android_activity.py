"""An Android activity's sensor code, line by line in Python, finds where the phone's camera looks."""

import math
from typing import Any

from posed.client import SENSOR_DELAY_FASTEST, PoseClient, Sensor, SensorEvent, SensorManager, Truth


class CompassActivity:
    def __init__(self, sensor_manager: SensorManager) -> None:
        self.sensor_manager = sensor_manager
        self.rotation_vector = sensor_manager.get_default_sensor(Sensor.TYPE_ROTATION_VECTOR)
        self.azimuths: dict[int, float] = {}

    def on_resume(self) -> None:
        self.sensor_manager.register_listener(self, self.rotation_vector, SENSOR_DELAY_FASTEST)

    def on_pause(self) -> None:
        self.sensor_manager.unregister_listener(self)

    def on_sensor_changed(self, event: SensorEvent) -> None:
        self.azimuths[event.timestamp] = _camera_azimuth(event.values)


def _camera_azimuth(rotation_vector: tuple[float, ...]) -> float:
    rotation = SensorManager.get_rotation_matrix_from_vector(rotation_vector)
    camera = SensorManager.remap_coordinate_system(rotation, SensorManager.AXIS_X, SensorManager.AXIS_Z)
    assert camera is not None
    return SensorManager.get_orientation(camera)[0]


def test_the_azimuth_through_remap_coordinate_system_is_true_within_two_degrees(desk: Any) -> None:
    desk.serve("--source", "sim:compass")
    truths: list[Truth] = []
    with SensorManager() as manager, PoseClient(every=True, on_truth=truths.append) as client:
        activity = CompassActivity(manager)
        activity.on_resume()
        poses = [client.next_pose(timeout_s=5) for _ in range(60)]
        activity.on_pause()
    assert None not in poses
    # The filter has three seconds to find north.
    settled = [truth for truth in truths[30:] if truth.timestamp_ns < max(activity.azimuths)]
    assert len(settled) > 10
    for truth in settled:
        at = min(activity.azimuths, key=lambda timestamp: abs(timestamp - truth.timestamp_ns))
        assert abs(at - truth.timestamp_ns) <= 10_000_000
        error = activity.azimuths[at] + truth.declination - _camera_azimuth(truth.quaternion)
        assert abs(math.degrees(math.remainder(error, 2 * math.pi))) < 2
