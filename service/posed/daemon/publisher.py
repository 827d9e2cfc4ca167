"""The socket on which poses and truth go out, one topic a filter and pose period."""

import logging
from pathlib import Path

import zmq

from posed.binder.runtime import bind_socket, unlink_socket
from posed.binder.sockets import xpub
from posed.clock import Clock
from posed.daemon import encoding
from posed.daemon.statistics import PublicationStatistics
from posed.errors import PosedError
from posed.events import Pose
from posed.hal.source import SensorSource
from posed.proto import pose_pb2

_log = logging.getLogger(__name__)


class PosePublisher:
    """Sends the newest pose of each filter and period to whoever subscribed; encodes nothing that nobody wants."""

    def __init__(
        self,
        path: Path,
        context: "zmq.Context[zmq.Socket[bytes]]",
        boot_id: bytes,
        clock: Clock,
        source: SensorSource,
        statistics: PublicationStatistics,
    ) -> None:
        self._path = path
        self._boot_id = boot_id
        self._clock = clock
        self._source = source
        self._statistics = statistics
        self._encoder = encoding.PoseEncoder(boot_id)
        self._topics: set[bytes] = set()
        self.socket = xpub(context)
        try:
            bind_socket(self.socket, path)
        except BaseException:
            self.socket.close()
            raise

    def read_subscriptions(self) -> None:
        """Take in who subscribed to what since the last call."""
        while True:
            try:
                message = self.socket.recv(zmq.NOBLOCK)
            except zmq.Again:
                return
            if message[:1] == b"\x01":
                self._topics.add(message[1:])
            elif message[:1] == b"\x00":
                self._topics.discard(message[1:])

    def publish(self, poses: list[Pose]) -> None:
        """Send each filter's newest pose of each period; older ones came too late and are counted as skipped."""
        newest = {(pose.period_us, pose.filter_name): pose for pose in poses}
        self._statistics.skipped += len(poses) - len(newest)
        for stream, pose in newest.items():
            mapping = self._source.time_map
            now_ns = self._clock.now_ns()
            topic = encoding.pose_topic(*stream)
            if topic in self._topics:
                self.socket.send(topic + self._encoder.encode(pose, now_ns, mapping))
                self._statistics.add(now_ns - mapping.to_boot(pose.instant_ns))
            topic = encoding.truth_topic(*stream)
            if topic in self._topics:
                self._publish_truth(topic, pose)

    def close(self) -> None:
        """Close the socket and remove its file."""
        self.socket.close()
        unlink_socket(self._path)

    def _publish_truth(self, topic: bytes, pose: Pose) -> None:
        try:
            truth = self._source.truth(pose.orientation.timestamp_ns)
            at_instant = self._source.truth(pose.instant_ns)
        except PosedError as error:
            # Asked for by a subscriber that cannot be answered: say so once, go on with the poses.
            _log.warning("no truth stream: %s", error)
            self._topics.discard(topic)
            return
        if truth is not None:
            header = encoding.delivery_header(self._boot_id, pose.sequence, self._clock.now_ns(), self._source.time_map)
            message = pose_pb2.TruthMessage(header=header, truth=encoding.truth(truth, pose.instant_ns, at_instant))
            self.socket.send(topic + message.SerializeToString())
