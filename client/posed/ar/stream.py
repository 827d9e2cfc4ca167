"""What the page is fed: the poses of the running service, and the truth where a page asks for it."""

import datetime
import math
from collections.abc import Callable
from typing import Any, Protocol

import posed.client as sdk
from posed.ar.declination import wmm_declination_deg
from posed.client import Pose, PoseClient, Position, Truth

RATE_MODES = ("NORMAL", "UI", "GAME", "FASTEST")
# What the drawn world is moved by: between two of them the page goes on at the rate of the last two.
_TRUTH_HZ = 50.0

Publish = Callable[[str, Any], None]
"""Takes a key and a value of the page's protocol (see `ServiceFeed`), from any thread."""


class Feed(Protocol):
    """Where a page's values come from."""

    def start(self, publish: Publish) -> None:
        """Begin."""

    def set_rate_mode(self, mode: str) -> None:
        """Ask for one of RATE_MODES."""

    def want_truth(self, wanted: bool) -> None:
        """Begin or end the truth."""

    def close(self) -> None:
        """End; may take a second."""


class ServiceFeed:
    """The feed from a daemon. Times on CLOCK_BOOTTIME in ms, angles in degrees, quaternions (x, y, z, w).

    p: a pose, against magnetic north: n its sequence, t the time of its sample, b that of its publication, q
    orientation, w angular rate (rad/s, device axes), a heading accuracy, s status bits, m rate mode in force, f events
    fused, x poses missed before it.
    t: the truth at a grid instant, against true north: t, q, d declination, e position east, north, up from the start
    (m) or null. o: the observer, null where the daemon knows no position. s: state of the binding, and the reason.
    v: the phone. In s and o, n counts the connections: what came with another n is another daemon's.
    """

    def __init__(self, rate_mode: str, *, auto_create: bool) -> None:
        """auto_create: start a daemon when there is none, at first and whenever it has died."""
        self._rate_mode = rate_mode
        self._auto_create = auto_create
        self._publish: Publish = lambda key, value: None
        self._poses: PoseClient | None = None
        self._truths: PoseClient | None = None
        self._position: Position | None = None
        self._connections = 0

    def start(self, publish: Publish) -> None:
        self._publish = publish
        self._tell_state("CONNECTING", "no daemon has answered yet")
        self._poses = PoseClient(
            _delay(self._rate_mode),
            auto_create=self._auto_create,
            on_pose=self._take_pose,
            on_service_connected=self._connected,
            on_service_disconnected=lambda: self._tell_state("DISCONNECTED", "the daemon died or hangs"),
            on_binding_died=lambda reason: self._tell_state("BINDING_DIED", reason),
        )

    def set_rate_mode(self, mode: str) -> None:
        self._rate_mode = mode
        if self._poses is not None:
            self._poses.set_rate_mode(_delay(mode))

    def want_truth(self, wanted: bool) -> None:
        if wanted and self._truths is None:
            # At the slowest rate of the sensors: the truth is none of their business.
            self._truths = PoseClient(sdk.SENSOR_DELAY_NORMAL, pose_rate_hz=_TRUTH_HZ, on_truth=self._take_truth)
        elif not wanted and self._truths is not None:
            self._truths.close()
            self._truths = None

    def close(self) -> None:
        self.want_truth(False)
        if self._poses is not None:
            self._poses.close()

    def _connected(self) -> None:
        self._connections += 1
        self._position = None
        self._publish("o", None)
        self._tell_state("CONNECTED", "")
        device = self._poses.device if self._poses is not None else None
        if device is not None:
            self._publish(
                "v", {"name": device.profile, "fov_deg": device.camera_fov_deg, "rotation": device.screen_rotation_deg}
            )

    def _tell_state(self, state: str, reason: str) -> None:
        self._publish("s", {"state": state, "reason": reason, "n": self._connections})

    def _take_pose(self, pose: Pose) -> None:
        self._publish("p", pose_message(pose))
        if pose.position != self._position:
            self._position = pose.position
            self._publish("o", pose.position and {**observer_message(pose.position), "n": self._connections})

    def _take_truth(self, truth: Truth) -> None:
        if truth.instant_quaternion is not None:
            self._publish("t", truth_message(truth))


def pose_message(pose: Pose) -> dict[str, Any]:
    """Return what `p` holds."""
    return {
        "n": pose.sequence,
        "t": _ms(pose.delivery.to_boot_ns(pose.timestamp_ns + pose.predicted_ns)),
        "b": _ms(pose.delivery.published_ns),
        "q": [round(q, 6) for q in pose.quaternion],
        "w": [round(w, 4) for w in pose.angular_rate],
        "a": round(math.degrees(pose.heading_accuracy), 2),
        "s": int(pose.status),
        "m": pose.rate_mode,
        "f": pose.events_fused,
        "x": pose.missed,
    }


def truth_message(truth: Truth) -> dict[str, Any]:
    """Return what `t` holds."""
    enu = truth.instant_position_enu
    return {
        "t": _ms(truth.delivery.to_boot_ns(truth.instant_ns)),
        "q": [round(q, 6) for q in truth.instant_quaternion or ()],
        "d": round(math.degrees(truth.declination), 3),
        "e": None if enu is None else [round(metres, 2) for metres in enu],
    }


def observer_message(position: Position) -> dict[str, Any]:
    """Return what `o` holds."""
    return {
        "latitude": position.latitude_deg,
        "longitude": position.longitude_deg,
        "height": position.ellipsoidal_height_m,
        "source": position.source,
        "wmm_declination_deg": wmm_declination_deg(
            position.latitude_deg, position.longitude_deg, datetime.date.today()
        ),
    }


def _delay(mode: str) -> int:
    return int(getattr(sdk, f"SENSOR_DELAY_{mode}"))


def _ms(boot_ns: int) -> float:
    return round(boot_ns / 1e6, 3)
