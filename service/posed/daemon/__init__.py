"""The daemon: wires source, sensor service and filter to the sockets, and owns the loop and the life cycle."""

from posed.daemon.config import DaemonConfig
from posed.daemon.loop import run

__all__ = ["DaemonConfig", "run"]
