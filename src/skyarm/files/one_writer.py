"""One process at a time writes into a folder: a lock that ends with the process that holds it, however it ends."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from skyarm.files.one_line import shown

LOCK = ".writing"
"""Name of the lock's file, which is there while someone writes; one that a killed process left holds nobody up."""

TAKEN = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
"""What systems answer of a file that another process has locked; any other answer is that they have no locks there."""

_OPEN = os.O_RDWR | os.O_CREAT | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_NONBLOCK"))


class TakenError(ValueError):
    """Another process writes there."""


@contextmanager
def one_writer(folder: Path) -> Iterator[None]:
    """Hold a folder while files are written into it.

    The lock is the system's (flock, on Windows a locked byte), not the file's being there: it goes when the process
    ends, so a kill leaves nothing to clear away. On a file system without locks everyone may write, as before.

    Args:
        folder: that is there.

    Raises:
        TakenError: another process holds it; one line that names the folder and the process.
        OSError: the lock's file cannot be made, or is something else.
    """
    path = folder / LOCK
    handle = _opened(path)
    while not _held(handle, path, folder):
        # who held it has removed the file meanwhile
        os.close(handle)
        handle = _opened(path)
    try:
        with contextlib.suppress(OSError):  # on a full disk the process stays unnamed
            os.ftruncate(handle, 0)
            os.write(handle, str(os.getpid()).encode())
        yield
    finally:
        # removed while it is held: nobody takes a file that is about to go; Windows removes closed files only
        if os.name != "nt":
            _forget(path)
        os.close(handle)
        if os.name == "nt":
            _forget(path)


def _opened(path: Path) -> int:
    """The lock's file, made if it is not there.

    Raises:
        OSError: one line that names it.
    """
    try:
        handle = os.open(path, _OPEN, 0o666)
    except OSError as error:
        raise OSError(f"file = {shown(str(path))}: must be writable ({error.strerror})") from None
    if stat.S_ISREG(os.fstat(handle).st_mode):
        return handle
    os.close(handle)
    raise OSError(f"file = {shown(str(path))}: must be writable (there is something else of this name)")


def _held(handle: int, path: Path, folder: Path) -> bool:
    """Lock the file; False if it is not the one at the path any more.

    Raises:
        TakenError: another process has locked it.
    """
    try:
        _lock(handle)
    except OSError as error:
        if error.errno in TAKEN:
            words = _process(handle)
            os.close(handle)
            raise TakenError(
                f"folder = {shown(str(folder))}: must be written by one process at a time; another one{words} does; "
                f"wait for its end, or choose another folder"
            ) from None
        return True  # no locks here
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False


def _lock(handle: int) -> None:
    """Lock an open file against every other process, without waiting."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(handle, FAR, os.SEEK_SET)  # beyond what is written, which others may read
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


FAR = 4096
"""The byte that is locked on Windows, where nobody reads a locked one."""


def _process(handle: int) -> str:
    """Who holds a lock, as its file says."""
    with contextlib.suppress(OSError):
        os.lseek(handle, 0, os.SEEK_SET)
        number = os.read(handle, 20).decode("ascii", "replace")
        if number.isdecimal():
            return f" (process {number})"
    return ""


def _forget(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
