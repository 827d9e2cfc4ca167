"""The runtime directory and its sockets: made for this user alone, and nothing of anybody else's touched."""

import os
import re
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import zmq

from posed.binder import sockets
from posed.binder.connection import Connection
from posed.binder.runtime import (
    InstanceLock,
    bind_socket,
    control_path,
    endpoint,
    pose_path,
    runtime_directory,
    unlink_socket,
)
from posed.binder.server import Server
from posed.errors import AlreadyRunningError, RuntimeDirectoryError

needs_root = pytest.mark.skipif(os.getuid() != 0, reason="only root can give a file to another user")
NOBODY = 65534

HOLD_LOCK = """
import sys
from pathlib import Path
from posed.binder import sockets
from posed.binder.runtime import InstanceLock
from posed.binder.server import Server
directory = Path(sys.argv[1])
InstanceLock(directory).acquire()
server = Server(directory / "control.sock", sockets.context())
print("held", flush=True)
sys.stdin.readline()
"""


@pytest.fixture
def base(socket_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An XDG_RUNTIME_DIR."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(socket_path.parent))
    return socket_path.parent


@pytest.fixture
def holder(base: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that holds the lock of the runtime directory and has bound the control socket in it."""
    command = [sys.executable, "-c", HOLD_LOCK, str(runtime_directory())]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


@pytest.fixture
def xpub(context: sockets.Context) -> Iterator[sockets.Socket]:
    with sockets.xpub(context) as socket:
        yield socket


def test_directory_in_xdg_runtime_dir(base: Path) -> None:
    directory = runtime_directory()
    assert directory == base / "posed"
    assert stat.S_IMODE(directory.stat().st_mode) == 0o700
    assert runtime_directory() == directory
    assert control_path(directory) != pose_path(directory)


@pytest.mark.parametrize("value", [None, "", "relative/path"])
def test_directory_without_xdg_runtime_dir(base: Path, monkeypatch: pytest.MonkeyPatch, value: str | None) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(base))
    if value is None:
        monkeypatch.delenv("XDG_RUNTIME_DIR")
    else:
        monkeypatch.setenv("XDG_RUNTIME_DIR", value)
    directory = runtime_directory()
    assert directory == base / f"posed-{os.getuid()}"
    assert stat.S_IMODE(directory.stat().st_mode) == 0o700


def test_directory_is_private_under_any_umask(base: Path) -> None:
    umask = os.umask(0)
    try:
        assert stat.S_IMODE(runtime_directory().stat().st_mode) == 0o700
    finally:
        os.umask(umask)


def test_directory_not_made_when_only_asked_for(base: Path) -> None:
    assert runtime_directory(create=False) == base / "posed"
    assert not (base / "posed").exists()


@pytest.mark.parametrize("create", [True, False])
@pytest.mark.parametrize("mode", [0o777, 0o750, 0o701, 0o720])
def test_directory_open_to_others_is_refused(base: Path, mode: int, create: bool) -> None:
    (base / "posed").mkdir()
    (base / "posed").chmod(mode)
    with pytest.raises(RuntimeDirectoryError, match=f"mode {mode:04o}.*chmod 700"):
        runtime_directory(create)


@pytest.mark.parametrize("create", [True, False])
def test_directory_that_is_a_symlink_is_refused(base: Path, create: bool) -> None:
    (base / "elsewhere").mkdir(mode=0o700)
    (base / "posed").symlink_to(base / "elsewhere")
    with pytest.raises(RuntimeDirectoryError, match="not a directory"):
        runtime_directory(create)
    (base / "elsewhere").rmdir()
    with pytest.raises(RuntimeDirectoryError, match="not a directory"):
        runtime_directory(create)


def test_directory_that_is_a_file_is_refused(base: Path) -> None:
    (base / "posed").write_text("mine")
    with pytest.raises(RuntimeDirectoryError, match="not a directory"):
        runtime_directory()
    assert (base / "posed").read_text() == "mine"


@needs_root
def test_directory_of_another_user_is_refused(base: Path) -> None:
    (base / "posed").mkdir(mode=0o700)
    os.chown(base / "posed", NOBODY, NOBODY)
    with pytest.raises(RuntimeDirectoryError, match="belongs to user 65534"):
        runtime_directory()


def test_directory_that_cannot_be_made(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(base / "absent"))
    with pytest.raises(RuntimeDirectoryError, match=r"No such file.*XDG_RUNTIME_DIR"):
        runtime_directory()


def test_longest_path_binds_and_a_longer_one_is_refused(base: Path, xpub: sockets.Socket) -> None:
    longest = base / ("s" * (107 - len(str(base)) - 1))
    bind_socket(xpub, longest)
    assert stat.S_ISSOCK(longest.lstat().st_mode)
    with pytest.raises(RuntimeDirectoryError, match=r"108 bytes.*XDG_RUNTIME_DIR"):
        endpoint(longest.with_name(longest.name + "s"))


def test_path_that_is_not_utf8_is_refused() -> None:
    with pytest.raises(RuntimeDirectoryError, match="UTF-8"):
        endpoint(Path(os.fsdecode(b"/run/\xff")))


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_socket_is_private_under_any_umask_and_leaves_it(base: Path, xpub: sockets.Socket, umask: int) -> None:
    before = os.umask(umask)
    try:
        bind_socket(xpub, base / "pose.sock")
    finally:
        after = os.umask(before)
    assert after == umask
    assert stat.S_IMODE((base / "pose.sock").lstat().st_mode) & 0o077 == 0


def test_socket_does_not_replace_a_file(base: Path, xpub: sockets.Socket) -> None:
    path = base / "pose.sock"
    path.write_text("precious")
    with pytest.raises(RuntimeDirectoryError, match="not a socket"):
        bind_socket(xpub, path)
    assert path.read_text() == "precious"


@pytest.mark.parametrize("dangling", [True, False])
def test_socket_does_not_follow_a_symlink(base: Path, xpub: sockets.Socket, dangling: bool) -> None:
    if not dangling:
        (base / "precious").write_text("precious")
    path = base / "pose.sock"
    path.symlink_to(base / "precious")
    with pytest.raises(RuntimeDirectoryError, match="not a socket"):
        bind_socket(xpub, path)
    assert path.is_symlink()
    assert (base / "precious").exists() is not dangling


@needs_root
def test_socket_does_not_replace_another_users(base: Path, xpub: sockets.Socket) -> None:
    path = base / "pose.sock"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        os.chown(path, NOBODY, NOBODY)
        with pytest.raises(RuntimeDirectoryError, match="not a socket of yours"):
            bind_socket(xpub, path)


def test_socket_where_there_is_no_directory(base: Path, xpub: sockets.Socket) -> None:
    with pytest.raises(RuntimeDirectoryError, match="No such file"):
        bind_socket(xpub, base / "absent" / "pose.sock")


def test_server_that_cannot_bind_leaves_nothing_open(base: Path) -> None:
    (base / "control.sock").write_text("precious")
    context = sockets.context()
    with pytest.raises(RuntimeDirectoryError):
        Server(base / "control.sock", context)
    context.term()  # would wait for a socket left open
    assert (base / "control.sock").read_text() == "precious"


def test_unlink_removes_only_what_was_bound(base: Path, xpub: sockets.Socket) -> None:
    path = base / "pose.sock"
    bind_socket(xpub, path)
    unlink_socket(path)
    assert not path.exists()
    unlink_socket(path)
    bind_socket(xpub, path)
    path.rename(base / "kept")  # its inode lives on, so that no new socket can get the number
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        unlink_socket(path)
        assert path.exists()


def test_stale_socket_of_a_killed_daemon_is_taken_over(holder: subprocess.Popen[str], base: Path) -> None:
    directory = runtime_directory()
    holder.send_signal(signal.SIGKILL)
    holder.wait(20)
    assert stat.S_ISSOCK(control_path(directory).lstat().st_mode)
    lock = InstanceLock(directory)
    lock.acquire()
    context = sockets.context()
    server = Server(control_path(directory), context)
    server.close()
    context.term()
    lock.release()
    assert not control_path(directory).exists()


def test_second_daemon_is_refused_and_told_the_pid(holder: subprocess.Popen[str], context: sockets.Context) -> None:
    lock = InstanceLock(runtime_directory())
    with pytest.raises(AlreadyRunningError, match=re.escape(f"(process {holder.pid})")):
        lock.acquire()
    lock.release()
    assert (runtime_directory() / "daemon.lock").read_text() == f"{holder.pid}\n"
    connection = Connection(control_path(runtime_directory()), context)
    poller = zmq.Poller()
    for each in connection.sockets:
        poller.register(each, zmq.POLLIN)
    while not connection.connected:  # the first one still listens
        assert poller.poll(20_000)
        connection.process()
    connection.close()


def test_lock_can_be_taken_again_after_release(base: Path) -> None:
    first, second = InstanceLock(base), InstanceLock(base)
    first.acquire()
    with pytest.raises(AlreadyRunningError, match=str(os.getpid())):
        second.acquire()
    first.release()
    first.release()
    second.acquire()
    second.release()
    assert stat.S_IMODE((base / "daemon.lock").stat().st_mode) == 0o600


def test_lock_file_with_a_longer_pid_in_it_is_cut(base: Path) -> None:
    (base / "daemon.lock").write_text("1234567890123\n")
    lock = InstanceLock(base)
    lock.acquire()
    lock.release()
    assert (base / "daemon.lock").read_text() == f"{os.getpid()}\n"


def test_lock_held_by_a_process_that_has_not_said_its_name(base: Path) -> None:
    first = InstanceLock(base)
    first.acquire()
    (base / "daemon.lock").write_text("")
    with pytest.raises(AlreadyRunningError, match="process unknown"):
        InstanceLock(base).acquire()
    first.release()


def test_lock_file_that_is_no_plain_file_is_refused(base: Path) -> None:
    path = base / "daemon.lock"
    (base / "precious").write_text("precious")
    path.symlink_to(base / "precious")
    with pytest.raises(RuntimeDirectoryError, match=r"daemon\.lock"):
        InstanceLock(base).acquire()
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(RuntimeDirectoryError, match="not a plain file"):
        InstanceLock(base).acquire()
    path.unlink()
    path.mkdir()
    with pytest.raises(RuntimeDirectoryError, match=r"daemon\.lock"):
        InstanceLock(base).acquire()
    assert (base / "precious").read_text() == "precious"
