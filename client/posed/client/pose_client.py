"""PoseClient: the fused pose of a running posed, as an iterator, a callback or the latest value."""

import dataclasses
import numbers
import threading
from collections import deque
from collections.abc import Callable, Iterator
from types import TracebackType

import zmq

from posed.binder.proxy import Proxy
from posed.binder.runtime import endpoint, pose_path
from posed.binder.sockets import Socket, sub
from posed.binder.stub import Caller, Stub
from posed.client.binding import ServiceState, call_back
from posed.client.pose import Device, Pose, Truth, boot_time_ns
from posed.client.sensor import SENSOR_DELAY_GAME, period_of_delay_us
from posed.client.service import Service
from posed.errors import InvalidArgumentError, ServiceUnavailableError
from posed.proto import pose_pb2

_LISTENER = "pose"
STALE_AFTER_NS = 500_000_000
"""Without a pose for longer, what is known is stale."""
# What an iterator that takes every pose may fall behind before the oldest are dropped: 5 s at 200 Hz.
_BACKLOG = 1000


class PoseClient:
    """Poses at `pose_rate_hz` (1 to 200), from sensors at `rate_mode` (a SENSOR_DELAY code or a period in us).

    filter names one of the daemon's filters (`posed serve --filter NAME,NAME`); None is its first.

    Iterating gives the newest pose each time; with every=True each pose in turn. Either way `Pose.missed` counts what
    was passed over. A daemon that is absent, dies or returns shows in `state`, never as an exception in the loop.
    Callbacks run on a thread of the client's own: on_pose(pose), on_truth(truth) (asks for the truth stream),
    on_service_connected(), on_service_disconnected(), on_binding_died(reason).
    """

    def __init__(
        self,
        rate_mode: int = SENSOR_DELAY_GAME,
        *,
        pose_rate_hz: float = 10.0,
        filter: str | None = None,
        every: bool = False,
        auto_create: bool = False,
        on_pose: Callable[[Pose], None] | None = None,
        on_truth: Callable[[Truth], None] | None = None,
        on_service_connected: Callable[[], None] | None = None,
        on_service_disconnected: Callable[[], None] | None = None,
        on_binding_died: Callable[[str], None] | None = None,
    ) -> None:
        self._sampling_period_us = _sampling_period_us(rate_mode)
        self._pose_period_us = _pose_period_us(pose_rate_hz)
        self._filter = _filter_name(filter)
        self._every = every
        self._on_pose = on_pose
        self._on_truth = on_truth
        self._arrived = threading.Condition()
        self._waiting: deque[Pose] = deque(maxlen=_BACKLOG if every else 1)
        self._latest: Pose | None = None
        self._seen: tuple[bytes, int] | None = None
        self._handed_out = 0
        self._missed = 0
        self._poses: Proxy | None = None
        self._sockets: list[Socket] = []
        self._topic = b""
        self._rate_mode: str | None = None
        self._device: Device | None = None
        self._service = Service(
            self,
            auto_create=auto_create,
            on_service_connected=on_service_connected,
            on_service_disconnected=on_service_disconnected,
            on_binding_died=on_binding_died,
        )
        self._service.start()

    def __enter__(self) -> "PoseClient":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[Pose]:
        while True:
            pose = self.next_pose()
            if pose is None:
                return
            yield pose

    @property
    def state(self) -> ServiceState:
        """Where the binding to the daemon stands."""
        return self._service.state

    @property
    def reason(self) -> str:
        """Why the binding is not connected, for people; empty when it is."""
        return self._service.reason

    @property
    def rate_mode(self) -> str | None:
        """The rate mode in force in the daemon, the fastest that any client asks for; None before the first bind."""
        return self._rate_mode

    @property
    def device(self) -> Device | None:
        """The phone that the daemon acts as; None before the first bind."""
        return self._device

    @property
    def poses_received(self) -> int:
        """Poses handed out by iteration or to on_pose."""
        return self._handed_out

    @property
    def poses_missed(self) -> int:
        """Poses of the stream passed over between those handed out."""
        return self._missed

    @property
    def stale(self) -> bool:
        """True if no pose was published within the last 0.5 s."""
        latest = self._latest
        return latest is None or boot_time_ns() - latest.delivery.published_ns > STALE_AFTER_NS

    def latest(self) -> Pose | None:
        """Return the newest pose received, None before the first."""
        return self._latest

    def next_pose(self, timeout_s: float | None = None) -> Pose | None:
        """Return the next pose; None when `timeout_s` passes without one, or once closed and what had come is taken."""
        with self._arrived:
            self._arrived.wait_for(lambda: self._waiting or self._service.has_ended, timeout_s)
            if not self._waiting:
                return None
            return self._hand_out(self._waiting.popleft())

    def wait_connected(self, timeout_s: float = 5.0) -> None:
        """Wait until a daemon is connected.

        Raises ServiceUnavailableError with the reason after `timeout_s`, at once if the binding died or was closed.
        """
        self._service.wait_connected(timeout_s)

    def set_rate_mode(self, rate_mode: int) -> None:
        """Change the sensors' rate mode (a SENSOR_DELAY code or a period in us), now or at the next connection."""
        self._sampling_period_us = _sampling_period_us(rate_mode)
        self._register_again()

    def set_pose_rate(self, pose_rate_hz: float) -> None:
        """Change the rate of the poses (1 to 200 Hz), now or at the next connection."""
        self._pose_period_us = _pose_period_us(pose_rate_hz)
        self._register_again()

    def close(self) -> None:
        """Unbind; ends every iteration. Never takes longer than a second."""
        self._service.close()
        with self._arrived:
            self._arrived.notify_all()

    # Binding, on the service thread

    def bind(self, service: Service) -> None:
        """Register for poses and subscribe to their topic."""
        poses, _ = service.get_service("poseservice", _POSE_SERVICE)
        self.release(service)
        service.connection.remove_callback(_LISTENER)
        service.connection.add_callback(_LISTENER, _PoseListener(self._configured))
        self._register(poses)
        self._poses = poses

    def unbind(self, service: Service) -> None:
        """Undo `bind` towards the daemon."""
        if self._poses is not None:
            self._poses.unregisterPose(pose_pb2.UnregisterPoseRequest(listener=_LISTENER), timeout_s=0.3)

    def release(self, service: Service) -> None:
        """Close the pose sockets."""
        self._poses = None
        self._topic = b""
        self._close_sockets()
        with self._arrived:
            self._arrived.notify_all()  # it may be the end

    def _register(self, poses: Proxy) -> None:
        registration = poses.registerPose(
            pose_pb2.PoseRequest(
                listener=_LISTENER,
                pose_period_us=self._pose_period_us,
                sampling_period_us=self._sampling_period_us,
                filter=self._filter,
            )
        )
        self._configured(registration.configuration)
        device = registration.device
        self._device = Device(device.profile, device.camera_fov_deg, device.screen_rotation_deg)
        if registration.pose_topic == self._topic:
            return
        self._close_sockets()
        self._topic = registration.pose_topic
        # Sequences of another period count something else, and poses of another filter are no successors.
        with self._arrived:
            self._waiting.clear()
            self._seen = None
        self._subscribe(registration.pose_topic, self._take_pose)
        if self._on_truth is not None:
            self._subscribe(registration.truth_topic, self._take_truth)

    def _register_again(self) -> None:
        if self.state is not ServiceState.CONNECTED:
            return  # the next connection registers with the new values

        def register() -> None:
            if self._poses is not None:
                self._register(self._poses)

        try:
            self._service.run(register)
        except ServiceUnavailableError:
            if self.state is ServiceState.CONNECTED:
                raise

    def _close_sockets(self) -> None:
        while self._sockets:
            self._service.unwatch(self._sockets.pop())

    def _subscribe(self, topic: bytes, take: Callable[[bytes], None]) -> None:
        # Conflation keeps one message a socket, whatever its topic: hence a socket a topic.
        socket = sub(self._service.context, conflate=not self._every)
        socket.subscribe(topic)
        socket.connect(endpoint(pose_path(self._service.directory)))
        self._sockets.append(socket)

        def read() -> None:
            # One a turn: with more, a callback slower than the poses would keep calls and `close` waiting.
            try:
                frame = socket.recv(zmq.NOBLOCK)
            except zmq.Again:
                return
            take(frame[len(topic) :])

        self._service.watch(socket, read)

    def _take_pose(self, payload: bytes) -> None:
        pose = Pose.of_message(pose_pb2.PoseMessage.FromString(payload))
        self._latest = pose
        if self._on_pose is not None:
            call_back(self._on_pose, self._hand_out(pose))
            return
        with self._arrived:
            self._waiting.append(pose)
            self._arrived.notify_all()

    def _take_truth(self, payload: bytes) -> None:
        if self._on_truth is not None:
            call_back(self._on_truth, Truth.of_message(pose_pb2.TruthMessage.FromString(payload)))

    def _hand_out(self, pose: Pose) -> Pose:
        missed = 0
        if self._seen is not None and self._seen[0] == pose.delivery.boot_id:
            missed = max(0, pose.sequence - self._seen[1] - 1)
        self._seen = (pose.delivery.boot_id, pose.sequence)
        self._handed_out += 1
        self._missed += missed
        return dataclasses.replace(pose, missed=missed) if missed else pose

    def _configured(self, configuration: pose_pb2.PoseConfiguration) -> None:
        self._rate_mode = pose_pb2.RateMode.Name(configuration.rate_mode).removeprefix("RATE_MODE_")


class _PoseListener(Stub):
    descriptor = pose_pb2.DESCRIPTOR.services_by_name["IPoseListener"]

    def __init__(self, configured: Callable[[pose_pb2.PoseConfiguration], None]) -> None:
        self._configured = configured

    def onPoseConfiguration(self, request: pose_pb2.PoseConfiguration, caller: Caller) -> None:
        self._configured(request)


_POSE_SERVICE = pose_pb2.DESCRIPTOR.services_by_name["IPoseService"]


def _sampling_period_us(rate_mode: int) -> int:
    period_us = period_of_delay_us(rate_mode)
    if period_us < 0:
        raise InvalidArgumentError(f"rate mode {rate_mode} is negative; give a SENSOR_DELAY code or a period in us")
    return period_us


def _filter_name(filter: str | None) -> str:
    if filter is not None and not isinstance(filter, str):
        raise InvalidArgumentError(f"filter {filter!r} is no name; give a str, or None for the daemon's first")
    return filter or ""


def _pose_period_us(pose_rate_hz: float) -> int:
    if not isinstance(pose_rate_hz, numbers.Real) or not 1 <= pose_rate_hz <= 200:
        raise InvalidArgumentError(f"pose rate {pose_rate_hz!r} is no rate; give a number of Hz, 1 to 200")
    return round(1e6 / pose_rate_hz)
