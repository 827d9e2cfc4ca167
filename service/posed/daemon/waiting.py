"""Sleeping until a socket has something or an instant of CLOCK_BOOTTIME has come."""

import ctypes
import os
import select
import sys
import time
from collections.abc import Sequence

import zmq

from posed.binder.sockets import Socket

_TFD_TIMER_ABSTIME = 1


class Waiter:
    """Waits on ZeroMQ sockets, other file descriptors and one timer.

    zmq.Poller cuts time-outs to milliseconds, which makes every pose half a millisecond late, and waiting by it costs
    twice as much a wake-up. A timer of the kernel's is exact, and one on CLOCK_BOOTTIME is due at once after a suspend.
    """

    def __init__(self, sockets: Sequence[Socket]) -> None:
        self._sockets = zmq.Poller()
        self._timer = _timerfd_create()
        self._armed_ns: int | None = None
        self._interval_ns = 0
        """After which the timer goes off again by itself; 0: never."""
        self._passed_ns = 0
        """The last deadline that came."""
        self._epoll = select.epoll()
        self._epoll.register(self._timer, select.EPOLLIN | select.EPOLLET)
        for each in sockets:
            self._sockets.register(each, zmq.POLLIN)
            self.watch(each.fileno())

    def watch(self, fd: int) -> None:
        """Wake up for a file descriptor as well; whoever owns it empties it."""
        self._epoll.register(fd, select.EPOLLIN | select.EPOLLET)

    def readable(self) -> list[Socket]:
        """Return the sockets that have a message.

        A socket's descriptor only tells that its state has changed since it was asked or sent on: so the sockets are
        to be asked before every wait.
        """
        return [each for each, _ in self._sockets.poll(0)]

    def wait(self, deadline_ns: int | None) -> bool:
        """Sleep until something happens or `deadline_ns` (CLOCK_BOOTTIME) has come; None is no deadline.

        Returns False if it was the deadline alone.
        """
        if deadline_ns != self._armed_ns:
            # Poses are due at equal intervals: once set to them the timer is only read, for a third of what setting it
            # costs.
            self._interval_ns = max(0, deadline_ns - self._passed_ns) if deadline_ns and self._passed_ns else 0
            _timerfd_settime(self._timer, deadline_ns, self._interval_ns)
            self._armed_ns = deadline_ns
        happened = False
        for fd, _ in self._epoll.poll():
            if fd == self._timer:
                self._pass_deadline(int.from_bytes(os.read(fd, 8), sys.byteorder))
            else:
                happened = True
        return happened

    def _pass_deadline(self, times: int) -> None:
        assert self._armed_ns is not None
        self._passed_ns = self._armed_ns + (times - 1) * self._interval_ns
        self._armed_ns = self._passed_ns + self._interval_ns if self._interval_ns else None

    def close(self) -> None:
        """Give the descriptors back; the sockets are their owners' to close."""
        self._epoll.close()
        os.close(self._timer)


class _TimeSpec(ctypes.Structure):
    _fields_ = [("tv_sec", ctypes.c_long), ("tv_nsec", ctypes.c_long)]


class _TimerSpec(ctypes.Structure):
    _fields_ = [("it_interval", _TimeSpec), ("it_value", _TimeSpec)]


_libc = ctypes.CDLL(None, use_errno=True)
_settime = _libc.timerfd_settime
# Made once: the timer is set at every wake-up.
_spec = _TimerSpec()
_spec_pointer = ctypes.byref(_spec)


def _timerfd_create() -> int:
    fd = int(_libc.timerfd_create(time.CLOCK_BOOTTIME, os.O_CLOEXEC | os.O_NONBLOCK))
    if fd < 0:
        raise OSError(ctypes.get_errno(), "timerfd_create failed")
    return fd


def _timerfd_settime(fd: int, deadline_ns: int | None, interval_ns: int) -> None:
    """Arm the timer; a value of zero disarms it, so a deadline that early is one nanosecond."""
    value_ns = 0 if deadline_ns is None else max(1, deadline_ns)
    for time_spec, ns in ((_spec.it_value, value_ns), (_spec.it_interval, interval_ns)):
        time_spec.tv_sec, time_spec.tv_nsec = divmod(ns, 1_000_000_000)
    if _settime(fd, _TFD_TIMER_ABSTIME, _spec_pointer, None) < 0:
        raise OSError(ctypes.get_errno(), "timerfd_settime failed")
