"""The object "poseservice": who wants poses, how often, and from how fast sensors."""

from typing import cast

from posed.binder.peer import Peer
from posed.binder.proxy import Proxy
from posed.binder.stub import Caller, Stub
from posed.daemon import encoding
from posed.errors import InvalidArgumentError
from posed.events import RateMode
from posed.hal.profile import DeviceProfile
from posed.proto import binder_pb2, pose_pb2
from posed.sensors import SensorService


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
        self._listeners: dict[tuple[Peer, str], tuple[Proxy, str]] = {}
        """Callback objects, and the filter that each gets its poses from."""
        self._watched: set[Peer] = set()

    def registerPose(self, request: pose_pb2.PoseRequest, caller: Caller) -> pose_pb2.PoseRegistration:
        if not request.listener:
            raise InvalidArgumentError("the request names no listener; give the name of its callback object")
        key = (caller.peer, request.listener)
        before_us = self._service.pose_sampling_period_us
        filter_name = request.filter or self._service.filter_names[0]
        self._service.register_pose(key, request.pose_period_us, request.sampling_period_us, filter_name)
        self._tell_if_changed(before_us, besides=key)
        if caller.peer not in self._watched:
            self._watched.add(caller.peer)
            caller.peer.link_to_death(lambda: self._peer_died(caller.peer))
        self._listeners[key] = caller.peer.proxy(_LISTENER, request.listener), filter_name
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
        before_us = self._service.pose_sampling_period_us
        self._service.unregister_pose(key)
        if self._listeners.pop(key, None) is not None:
            self._tell_if_changed(before_us, besides=key)

    def _peer_died(self, peer: Peer) -> None:
        self._watched.discard(peer)
        for key in [key for key in self._listeners if key[0] is peer]:
            self._forget(key)

    def _tell_if_changed(self, before_us: int | None, besides: tuple[Peer, str]) -> None:
        if self._service.pose_sampling_period_us in (before_us, None):
            return
        for key, (proxy, filter_name) in self._listeners.items():
            if key != besides:
                proxy.onPoseConfiguration(self._configuration(filter_name))

    def _configuration(self, filter_name: str) -> pose_pb2.PoseConfiguration:
        sampling_us = self._service.pose_sampling_period_us or 0
        return pose_pb2.PoseConfiguration(
            rate_mode=cast("pose_pb2.RateMode", RateMode.of_period(sampling_us)),
            sampling_period_us=sampling_us,
            filter=filter_name,
        )


_LISTENER = pose_pb2.DESCRIPTOR.services_by_name["IPoseListener"]
