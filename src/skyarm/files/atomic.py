"""Files that appear whole or not at all, also after a power failure."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from skyarm.files.one_line import shown

CANNOT_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
"""What file systems answer that cannot force a file to their disk."""


def write_atomically(path: str | os.PathLike[str], content: bytes, *, entry: bool = True) -> Path:
    """Write to a temporary file beside the target, then rename; a cut-off run leaves no half file.

    Args:
        path: of the file.
        content: all of it.
        entry: whether the name is forced to disk as well; who writes many files calls :func:`sync_folder` once instead.

    Raises:
        OSError: with one line that names the file.
    """
    with writing_atomically(path, entry=entry) as stream:
        stream.write(content)
    return Path(path)


@contextmanager
def writing_atomically(path: str | os.PathLike[str], *, entry: bool = True) -> Iterator[IO[bytes]]:
    """Open a temporary file beside the target, to be written piece by piece, and rename it at the end.

    The content is on disk before the file has its name, so that no power failure leaves an empty file under it.
    A link is followed. A device or a pipe, such as /dev/stdout, is written into, never replaced. If what is done
    inside fails, no file appears.

    Args:
        path: of the file.
        entry: whether the name is forced to disk as well.

    Raises:
        OSError: with one line that names the file.
    """
    target = Path(os.path.realpath(path))
    if target.is_dir() or target.is_symlink():
        reason = os.strerror(errno.EISDIR if target.is_dir() else errno.ELOOP)
        raise OSError(f"file = {str(path)!r}: must be writable ({reason})")
    # a name of its own for every writer; opened as an ordinary new file, so that the usual rights apply
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(6)}.part")
    try:
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:
                yield stream
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as stream:
            yield stream
            stream.flush()
            _sync(stream.fileno())
        temporary.replace(target)
        if entry:
            sync_folder(target.parent)
    except OSError as error:
        _forget(temporary)
        raise OSError(f"file = {str(path)!r}: must be writable ({error.strerror})") from error
    except BaseException:
        _forget(temporary)
        raise


def sync_folder(folder: Path) -> None:
    """Force the names in a folder to disk, where the system can.

    Raises:
        OSError: the disk failed.
    """
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no folders; one may also be allowed to write into a folder but not to read it
        return
    try:
        _sync(handle)
    finally:
        os.close(handle)


def _sync(handle: int) -> None:
    """Force an open file to disk; a file system that has no such thing is no error."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in CANNOT_SYNC:
            raise


def _forget(temporary: Path) -> None:
    """Remove a temporary file if it is there; the error that led here is the one to report."""
    with contextlib.suppress(OSError):
        temporary.unlink()


def require_writable(folder: str | os.PathLike[str]) -> Path:
    """Make an output folder and prove that a file can be written there, before any work is done.

    Raises:
        ValueError: no name at all.
        OSError: with one line that names the folder.
    """
    if not isinstance(folder, (str, os.PathLike)) or not os.fspath(folder):
        raise ValueError(f"output folder = {folder!r}: must be the path of a folder")
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=target):
            pass
    except (OSError, ValueError) as error:  # a NUL in its name is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise OSError(f"output folder = {shown(str(target))}: must be writable ({reason})") from None
    return target


def output_file(name: str, field: str) -> Path:
    """Path of a file to come, checked before any work is done.

    Args:
        name: as it was given.
        field: what it was given to, for the message.

    Raises:
        ValueError: no name at all.
        OSError: it is a folder, or its own folder cannot be written.
    """
    if not name:
        raise ValueError(f"{field} = '': must be the path of a file")
    file = Path(name)
    require_replaceable(file)
    require_writable(file.parent)
    return file


def require_replaceable(*files: Path) -> None:
    """Refuse names of files to come that are taken by folders, before any work is done.

    Raises:
        OSError: with one line that names the first of them.
    """
    for file in files:
        if file.is_dir():
            raise OSError(f"file = {shown(str(file))}: must be writable (there is a folder of this name)")
