"""The pose service's listeners: told how fast the sensors run, again and again until they have it."""

import pytest

from posed.binder.peer import Peer
from posed.binder.stub import Caller
from posed.clock import VirtualClock
from posed.daemon.pose_stub import PoseServiceStub
from posed.errors import InvalidArgumentError
from posed.hal import open_source
from posed.hal.profile import load_profile
from posed.proto import pose_pb2
from posed.proto.binder_pb2 import Parcel
from posed.sensors import SensorService, make_device_filter


class Listener:
    """A client's end that takes messages or does not."""

    def __init__(self, stub: PoseServiceStub) -> None:
        self.reads = True
        self.told_us: list[int] = []
        self.peer = Peer(b"p", 0, 77, self._send)
        self._stub = stub

    def register(self, sampling_period_us: int, name: str = "pose") -> pose_pb2.PoseRegistration:
        request = pose_pb2.PoseRequest(listener=name, pose_period_us=100_000, sampling_period_us=sampling_period_us)
        return self._stub.registerPose(request, Caller(self.peer))

    def _send(self, parcel: bytes) -> bool:
        if self.reads:
            payload = Parcel.FromString(parcel).transaction.payload
            self.told_us.append(pose_pb2.PoseConfiguration.FromString(payload).sampling_period_us)
        return self.reads


@pytest.fixture
def service() -> SensorService:
    clock, profile = VirtualClock(10**10), load_profile("modern")
    source = open_source("sim:still", profile, clock)
    return SensorService(source, make_device_filter("dcm", profile), clock)


def test_who_could_not_be_told_of_a_rate_is_told_later(service: SensorService) -> None:
    stub = PoseServiceStub(service, load_profile("modern"))
    slow, other, fast = (Listener(stub) for _ in range(3))
    assert slow.register(200_000).configuration.sampling_period_us == 200_000
    other.register(200_000)
    slow.reads = False
    assert fast.register(20_000).configuration.sampling_period_us == 20_000
    assert (slow.told_us, other.told_us, fast.told_us) == ([], [20_000], [])
    assert stub.retry_s is not None
    slow.reads = True
    stub.tell()
    assert (slow.told_us, other.told_us, fast.told_us) == ([20_000], [20_000], [])
    assert stub.retry_s is None
    fast.peer.die()
    assert (slow.told_us, other.told_us) == ([20_000, 200_000], [20_000, 200_000])


@pytest.mark.parametrize("name", ["", "x" * 256])
def test_a_listener_without_a_fit_name_asks_for_nothing(service: SensorService, name: str) -> None:
    stub = PoseServiceStub(service, load_profile("modern"))
    with pytest.raises(InvalidArgumentError, match="callback object"):
        Listener(stub).register(200_000, name)
    assert service.pose_sampling_period_us is None
