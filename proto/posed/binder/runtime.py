"""The runtime directory and what stands in it: the lock of the one daemon and its two sockets."""

import contextlib
import fcntl
import os
import stat
from pathlib import Path

import zmq

from posed.errors import AlreadyRunningError, RuntimeDirectoryError


def runtime_directory(create: bool = True) -> Path:
    """Return `$XDG_RUNTIME_DIR/posed`, or a directory of this user's in the temporary directory.

    It is made with mode 0700 if it is absent and `create` is set; without `create` an absent one is no error. Raises
    RuntimeDirectoryError if it cannot be made or could be changed by anybody else.
    """
    base = os.environ.get("XDG_RUNTIME_DIR", "")
    if os.path.isabs(base):
        directory = Path(base) / "posed"
    else:
        import tempfile  # not needed in a login session; it loads the archive formats with it

        directory = Path(tempfile.gettempdir()).absolute() / f"posed-{os.getuid()}"
    if create:
        try:
            with contextlib.suppress(FileExistsError):
                directory.mkdir(mode=0o700)
        except OSError as error:
            raise RuntimeDirectoryError(
                f"cannot make {directory}: {error.strerror}; set XDG_RUNTIME_DIR to a directory of your own"
            ) from error
    elif not os.path.lexists(directory):
        return directory
    _check_directory(directory)
    return directory


def control_path(directory: Path) -> Path:
    """Where the daemon takes calls."""
    return directory / "control.sock"


def pose_path(directory: Path) -> Path:
    """Where the daemon publishes poses."""
    return directory / "pose.sock"


def endpoint(path: Path) -> str:
    """Return the ZeroMQ address of a socket; raises RuntimeDirectoryError if the path does not fit into one."""
    path = path.absolute()
    length = len(os.fsencode(path))
    if length > _SOCKET_PATH_BYTES:
        raise RuntimeDirectoryError(
            f"{path} has {length} bytes, a socket path can have {_SOCKET_PATH_BYTES}; "
            "set XDG_RUNTIME_DIR to a shorter directory"
        )
    try:
        str(path).encode()
    except UnicodeEncodeError:
        raise RuntimeDirectoryError(f"{path!r} is not UTF-8; set XDG_RUNTIME_DIR to a directory that is") from None
    return f"ipc://{path}"


class InstanceLock:
    """The right to be this user's daemon: a lock on `daemon.lock` that the kernel drops with the process."""

    def __init__(self, directory: Path) -> None:
        self._path = directory / "daemon.lock"
        self._fd: int | None = None

    def acquire(self) -> None:
        """Take the lock and write our pid into its file.

        Raises AlreadyRunningError with the pid of the daemon that holds it, RuntimeDirectoryError if the file is not
        one of ours.
        """
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            fd = os.open(self._path, flags, 0o600)
        except OSError as error:
            raise RuntimeDirectoryError(f"cannot open {self._path}: {error.strerror}; remove it") from error
        try:
            found = os.fstat(fd)
            if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid():
                raise RuntimeDirectoryError(f"{self._path} is not a plain file of yours; remove it")
            try:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                holder = os.pread(fd, 32, 0).decode("ascii", "replace").strip() or "unknown"
                raise AlreadyRunningError(
                    f"a daemon is running already in {self._path.parent} (process {holder}); use it or stop it first"
                ) from None
            os.ftruncate(fd, 0)
            os.pwrite(fd, f"{os.getpid()}\n".encode(), 0)
        except BaseException:
            os.close(fd)
            raise
        self._fd = fd

    def release(self) -> None:
        """Give the lock back; its file stays, as removing it would let two daemons lock two files of one name."""
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None


def bind_socket(socket: zmq.Socket[bytes], path: Path) -> None:
    """Bind a socket at a path, for this user alone; the caller holds the InstanceLock.

    libzmq removes whatever stands at the path, live sockets and plain files alike. So: raises RuntimeDirectoryError
    unless there is nothing or a socket of ours, which under the lock is a dead daemon's.
    """
    address = endpoint(path)
    with contextlib.suppress(FileNotFoundError):
        found = os.lstat(path)
        if not stat.S_ISSOCK(found.st_mode) or found.st_uid != os.getuid():
            raise RuntimeDirectoryError(f"{path} is not a socket of yours and would be lost; move it away")
    umask = os.umask(0o077)
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        raise RuntimeDirectoryError(f"cannot make the socket {path}: {error.strerror}") from error
    finally:
        os.umask(umask)
    made = os.lstat(path)
    _bound_inodes[path] = (made.st_dev, made.st_ino)


def unlink_socket(path: Path) -> None:
    """Remove the socket that this process bound at a path; anything else that stands there now is left alone."""
    inode = _bound_inodes.pop(path, None)
    with contextlib.suppress(FileNotFoundError):
        found = os.lstat(path)
        if (found.st_dev, found.st_ino) == inode:
            os.unlink(path)


# sockaddr_un.sun_path has 108 bytes, one of them the closing zero.
_SOCKET_PATH_BYTES = 107
_bound_inodes: dict[Path, tuple[int, int]] = {}


def _check_directory(directory: Path) -> None:
    found = os.lstat(directory)
    if not stat.S_ISDIR(found.st_mode):
        raise RuntimeDirectoryError(f"{directory} is not a directory; remove it")
    if found.st_uid != os.getuid():
        raise RuntimeDirectoryError(
            f"{directory} belongs to user {found.st_uid}, not to {os.getuid()}; "
            "set XDG_RUNTIME_DIR to a directory of your own"
        )
    if found.st_mode & 0o077:
        raise RuntimeDirectoryError(
            f"{directory} has mode {stat.S_IMODE(found.st_mode):04o}, others can enter it; "
            f"look at what is in it, then chmod 700 {directory}"
        )
