"""The object "poseservice": who wants poses, how often, and from how fast sensors."""

from dataclasses import dataclass
from typing import cast

from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.binder.stub import Caller, Stub
from posed.daemon import encoding
from posed.daemon.listeners import RETRY_S
from posed.events import RateMode
from posed.hal.profile import DeviceProfile
from posed.proto import binder_pb2, pose_pb2
from posed.sensors import SensorService


@dataclass(slots=True)
class _PoseListener:
    """A callback object, the filter that it gets its poses from, and the sampling period it was last told of, us."""

    proxy: Proxy
    filter_name: str
    told_us: int | None = None


class PoseServiceStub(Stub):
    """IPoseService over the sensor service."""

    descriptor = pose_pb2.DESCRIPTOR.services_by_name["IPoseService"]

    def __init__(self, service: SensorService, profile: DeviceProfile) -> None:
        self._service = service
        self._device = pose_pb2.Device(
            profile=profile.name,
            camera_fov_deg=profile.camera_fov_deg,
            screen_rotation_deg=profile.screen_rotation_deg,
        )
        self._listeners: dict[tuple[Peer, str], _PoseListener] = {}
        self.retry_s: float | None = None
        """When to `tell` again: seconds from now; None if everybody knows."""

    def tell(self) -> None:
        """Tell the listeners who do not know it yet how fast the sensors run now."""
        self.retry_s = None
        sampling_us = self._service.pose_sampling_period_us
        for listener in self._listeners.values():
            if listener.told_us != sampling_us:
                if listener.proxy.onPoseConfiguration(self._configuration(listener.filter_name)):
                    listener.told_us = sampling_us
                else:
                    self.retry_s = RETRY_S

    def registerPose(self, request: pose_pb2.PoseRequest, caller: Caller) -> pose_pb2.PoseRegistration:
        key = (caller.peer, request.listener)
        filter_name = request.filter or self._service.filter_names[0]
        listener = _PoseListener(caller.peer.proxy(_LISTENER, request.listener), filter_name)
        self._service.register_pose(key, request.pose_period_us, request.sampling_period_us, filter_name)
        caller.peer.link_to_death(self._peer_died)
        # The reply tells this one.
        listener.told_us = self._service.pose_sampling_period_us
        self._listeners[key] = listener
        self.tell()
        return pose_pb2.PoseRegistration(
            pose_topic=encoding.pose_topic(request.pose_period_us, filter_name),
            truth_topic=encoding.truth_topic(request.pose_period_us, filter_name),
            configuration=self._configuration(filter_name),
            device=self._device,
        )

    def unregisterPose(self, request: pose_pb2.UnregisterPoseRequest, caller: Caller) -> binder_pb2.Empty:
        self._forget((caller.peer, request.listener))
        return binder_pb2.Empty()

    def _forget(self, key: tuple[Peer, str]) -> None:
        self._service.unregister_pose(key)
        self._listeners.pop(key, None)
        self.tell()

    def _peer_died(self, peer: Peer) -> None:
        for key in [key for key in self._listeners if key[0] is peer]:
            self._forget(key)

    def _configuration(self, filter_name: str) -> pose_pb2.PoseConfiguration:
        sampling_us = self._service.pose_sampling_period_us or 0
        return pose_pb2.PoseConfiguration(
            rate_mode=cast("pose_pb2.RateMode", RateMode.of_period(sampling_us)),
            sampling_period_us=sampling_us,
            filter=filter_name,
        )


_LISTENER = pose_pb2.DESCRIPTOR.services_by_name["IPoseListener"]
