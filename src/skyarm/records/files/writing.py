"""Atomic writing of files, folders with a single writer, and the clean-up after a
failed run.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from skyarm.records.files.messages import shown
from skyarm.records.files.own_inputs import require_no_input
from skyarm.records.files.paths import PathLike

CANNOT_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)
"""Error numbers of file systems that cannot flush a file to disk."""


def write_atomically(path: PathLike, content: bytes, *, entry: bool = True) -> Path:
    """Write a file atomically: to a temporary file next to the target, then rename.

    Args:
        path: path of the file.
        content: complete content.
        entry: True if the name is forced to disk as well; who writes many files calls
            :func:`sync_folder` once instead.

    Raises:
        OSError: with one line that names the file.
    """
    with writing_atomically(path, entry=entry) as stream:
        stream.write(content)
    return Path(path)


@contextmanager
def writing_atomically(path: PathLike, *, entry: bool = True) -> Iterator[IO[bytes]]:
    """Context that writes a file atomically, piece by piece: yields a temporary file
    and renames it at the end.

    The content is on disk before the file has its name, so that no power failure leaves
    an empty file under it. A link is followed. A device or a pipe, such as /dev/stdout,
    is written into, never replaced. If what is done inside fails, no file appears.

    Args:
        path: path of the file.
        entry: True if the name is forced to disk as well.

    Raises:
        OSError: with one line that names the file.
        ValueError: the running command has read this file.
    """
    # a command may not destroy what it has just read, under whatever name
    require_no_input(path)
    target = Path(os.path.realpath(path))
    # which say no of a name that is too long
    if os.path.isdir(target) or os.path.islink(target):
        reason = os.strerror(errno.EISDIR if os.path.isdir(target) else errno.ELOOP)
        raise OSError(f"file = {shown(path)}: must be writable ({reason})")
    temporary: Path | None = None
    try:
        # a device cannot be renamed over
        if target.exists() and not target.is_file():
            with target.open("wb") as device:
                yield device
            return
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary, stream = _new_part(target)
        with stream:
            yield stream
            stream.flush()
            _sync(stream.fileno())
            if os.name != "nt":  # under its lock, or it would be taken for a dead one's
                temporary.replace(target)
        if os.name == "nt":  # where no open file is renamed
            temporary.replace(target)
        if entry:
            sync_folder(target.parent)
    except OSError as error:
        _forget(temporary)
        raise OSError(
            f"file = {shown(path)}: must be writable ({error.strerror})"
        ) from error
    except BaseException:
        _forget(temporary)
        raise


PART = re.compile(r"\..+\.[0-9a-f]{12}\.part", re.DOTALL)
"""Pattern of the names of temporary files next to their targets; a running writer holds
a lock on its file."""

_cleared: set[Path] = set()
"""Folders from which this process has removed temporary files of killed processes."""


def _new_part(target: Path) -> tuple[Path, IO[bytes]]:
    """Create and lock the temporary file of a target, after removing those that killed
    processes left next to it.
    """
    # once a process: listing a large folder at each file would cost more than writing
    if target.parent not in _cleared:
        _cleared.add(target.parent)
        for path in target.parent.glob(".*.part"):
            if PART.fullmatch(path.name):
                with suppress(OSError):
                    _remove_unlocked(path)
    while True:
        # a name of its own for every writer; opened as an ordinary new file, so that
        # the usual rights apply
        path = target.with_name(f".{target.name}.{os.urandom(6).hex()}.part")
        stream = path.open("xb")
        try:
            if os.name != "nt":
                _lock(stream.fileno())
        except OSError as error:
            if error.errno not in TAKEN:
                return path, stream  # no locks here
        else:
            # the file may have been removed between its making and its lock
            if path.exists():
                return path, stream
        stream.close()  # another process removed it before the lock


def _remove_unlocked(path: Path) -> None:
    """Remove a temporary file unless a process holds its lock or, on Windows, has it
    open.
    """
    if os.name == "nt":
        path.unlink()
        return
    # a link there is not followed, and a pipe there is not waited for
    handle = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        _lock(handle)
        path.unlink()
    finally:
        os.close(handle)


def sync_folder(folder: Path) -> None:
    """Flush the entries of a folder to disk, where the system supports it.

    Raises:
        OSError: the disk failed.
    """
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        # Windows opens no folders; one may also be allowed to write into a folder but
        # not to read it
        return
    try:
        _sync(handle)
    finally:
        os.close(handle)


def _sync(handle: int) -> None:
    """Flush an open file to disk; a file system without this operation is no error."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in CANNOT_SYNC:
            raise


def _forget(temporary: Path | None) -> None:
    """Delete a temporary file if it exists, ignoring errors."""
    if temporary is not None:
        with suppress(OSError):
            temporary.unlink()


def require_writable(folder: PathLike) -> Path:
    """Create an output folder and check that a file can be written there, before any
    computation.

    Raises:
        ValueError: no name at all.
        OSError: with one line that names the folder.
    """
    if not isinstance(folder, (str, os.PathLike)) or not os.fspath(folder):
        raise ValueError(f"output folder = {folder!r}: must be the path of a folder")
    target = Path(folder)
    try:
        # made and removed at once: rights, quotas and read-only disks show only when a
        # file is made
        target.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=target):
            pass
    except (OSError, ValueError) as error:  # a NUL in its name is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise OSError(
            f"output folder = {shown(target)}: must be writable ({reason})"
        ) from None
    return target


def output_file(name: str, field: str, *suffixes: str, force: bool = False) -> Path:
    """Path of an output file, checked before any computation.

    A TOML file, which people edit, is not replaced unless they say so; what a command
    makes again is.

    Args:
        name: path as the user typed it.
        field: option or argument with the path, for the message.
        suffixes: suffixes of the files that are written there; none for any. A device
            or a pipe may have another.
        force: True if a TOML file that is there may be replaced.

    Raises:
        ValueError: no name at all, another suffix, a file that the running command has
            read, or a TOML file that is there.
        OSError: it is a folder, or its own folder cannot be written.
    """
    if not name:
        raise ValueError(f"{field} = '': must be the path of a file")
    file = Path(name)
    if (
        suffixes
        and file.suffix not in suffixes
        and (os.path.isfile(file) or not os.path.exists(file))
    ):
        raise ValueError(
            f"{field} = {shown(name)}: must end in {' or '.join(suffixes)}"
        )
    require_no_input(file, field)
    if file.suffix == EDITED and not force:
        require_new(file, field)
    require_replaceable(file)
    require_writable(file.parent)
    return file


EDITED = ".toml"
"""Suffix of files that people edit."""


def require_new(file: Path, field: str = "file") -> None:
    """Raise an error if there is a file of this name, for what people edit.

    Raises:
        ValueError: one line.
    """
    # a dangling link is something that stands there, too
    if os.path.isfile(file) or os.path.islink(file):
        raise ValueError(
            f"{field} = {shown(file)}: must not be there yet; --force replaces it"
        )


def require_replaceable(*files: Path, renames: bool = False) -> None:
    """Raise an error if an output file has the name of a folder, or is an input of the
    running command.

    Args:
        files: files that are written.
        renames: an earlier file gets another name, so that an input may have that of an
            output.

    Raises:
        OSError: with one line that names the first of them.
        ValueError: the running command has read it; the same.
    """
    for file in files:
        if not renames:
            require_no_input(file)
        if os.path.isdir(file):
            raise OSError(
                f"file = {shown(file)}: must be writable (there is a folder of"
                " this name)"
            )


LONGEST_NAME = 80
"""Largest number of characters of a label that are kept in its file name."""


def file_names(labels: Iterable[str], before: str, after: str) -> dict[str, str]:
    """Make unique, portable file names for labels; letters, digits, ``.``, ``_`` and
    ``-`` are kept.

    Args:
        labels: any texts, each once.
        before: beginning of every name.
        after: its end.

    Returns:
        Label -> name; names differ also where a file system takes capitals and small
        letters for the same.
    """
    names: dict[str, str] = {}
    taken: set[str] = set()
    for label in labels:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "_", label)[:LONGEST_NAME]
        name, count = f"{before}{plain}{after}", 1
        while name.lower() in taken:
            count += 1
            name = f"{before}{plain}_{count}{after}"
        taken.add(name.lower())
        names[label] = name
    return names


def require_no_link(path: Path) -> Path:
    """Raise an error if an output file or folder is a symbolic link, which may lead
    anywhere.

    Raises:
        OSError: with one line that names it.
    """
    if path.is_symlink():
        raise OSError(f"file = {shown(path)}: must not be a link")
    return path


def write_inside(path: Path, content: bytes, *, entry: bool = True) -> Path:
    """Write a file atomically, like :func:`write_atomically`, but never through a link,
    pipe or device.

    Raises:
        OSError: with one line that names the file.
    """
    require_no_link(path)
    if path.exists() and not path.is_file():
        raise OSError(
            f"file = {shown(path)}: must be writable (there is something else of"
            " this name)"
        )
    return write_atomically(path, content, entry=entry)


@contextmanager
def taken_back(*paths: PathLike | None) -> Iterator[None]:
    """Context manager that removes new output files if the work inside fails before it
    has a result.

    Args:
        paths: folders that the work makes, outermost first (with those above them), and
            files that mean nothing without what the folders behind them hold. Those
            that were there before stay as they are. None is no path.
    """
    made = [path for path in _with_parents(paths) if not os.path.lexists(path)]
    try:
        yield
    except OSError:  # of the disk, which holds who knows what
        raise
    except Exception:
        # the first that holds a result ends it, and nothing above it is empty
        with suppress(OSError, ValueError):
            # innermost first, because only empty folders can be removed
            for path in reversed(made):
                if path.is_dir():
                    path.rmdir()
                else:
                    path.unlink(missing_ok=True)
        raise


def _with_parents(paths: tuple[PathLike | None, ...]) -> list[Path]:
    """Each path and all its parent folders, parents first, without duplicates."""
    every = list[Path]()
    for path in paths:
        if path is not None:
            every += [*reversed(Path(path).parents), Path(path)]
    return list(dict.fromkeys(every))


LOCK = ".writing"
"""Name of the lock file; one that a killed process left blocks nobody."""

POLL = 0.02
"""Time (s) between two attempts to take a lock."""

TAKEN = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
"""Error numbers of a file that another process has locked; any other number means that
locks are not supported."""

_OPEN = (
    os.O_RDWR
    | os.O_CREAT
    | sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_NONBLOCK"))
)


class TakenError(ValueError):
    """Error: another process is writing to the same output folder."""


@contextmanager
def one_writer(
    folder: Path, *, name: str = LOCK, patience: float = 0.0
) -> Iterator[None]:
    """Context manager that locks a folder, so that only one process at a time writes
    there.

    The lock is the system's (flock, on Windows a locked byte), not the file's being
    there: it goes when the process ends, so a kill leaves nothing to clear away. On a
    file system without locks everyone may write, as before.

    Args:
        folder: folder that is there.
        name: name of the lock's file: who holds one name does not keep others from
            another.
        patience: s to wait for another process's end.

    Raises:
        TakenError: another process holds it; one line that names the folder and the
            process.
        OSError: the lock's file cannot be made, or is something else.
    """
    path, handle, last = folder / name, None, time.monotonic() + patience
    while handle is None:  # a holder removes the file when it ends
        try:
            handle = _lock_file(path, folder)
        except TakenError:
            if time.monotonic() >= last:
                raise
            time.sleep(POLL)
    try:
        with suppress(OSError):  # on a full disk the process stays unnamed
            os.ftruncate(handle, 0)
            os.write(handle, str(os.getpid()).encode())
        yield
    finally:
        # removed while it is held: nobody takes a file that is about to go; Windows
        # removes closed files only
        if os.name != "nt":
            _forget(path)
        os.close(handle)
        if os.name == "nt":
            _forget(path)


def _lock_file(path: Path, folder: Path) -> int | None:
    """Open and lock a folder's lock file; None if another file has replaced it at the
    path.
    """
    try:
        try:
            # for all users, but for what the umask takes away
            handle = os.open(path, _OPEN, 0o666)
        except PermissionError:
            # what another user's process left can be locked without being written
            handle = os.open(path, _OPEN & ~(os.O_RDWR | os.O_CREAT))
    except OSError as error:
        raise OSError(
            f"file = {shown(path)}: must be writable ({error.strerror})"
        ) from None
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError(
            f"file = {shown(path)}: must be writable (there is something else of"
            " this name)"
        )
    try:
        _lock(handle)
    except OSError as error:
        if error.errno not in TAKEN:
            return handle  # no locks here
        words = _process(handle)
        os.close(handle)
        raise TakenError(
            f"folder = {shown(folder)}: must be written by one process at a time;"
            f" another one{words} does; wait for its end, or choose another folder"
        ) from None
    # another process may have removed the file and made a new one between open and lock
    with suppress(FileNotFoundError):
        if os.path.samestat(os.fstat(handle), os.stat(path)):
            return handle
    os.close(handle)
    return None


def _lock(handle: int) -> None:
    """Lock an open file against other processes, without waiting."""
    if sys.platform == "win32":
        import msvcrt

        # beyond what is written, which others may read
        os.lseek(handle, FAR, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


FAR = 4096
"""Offset of the locked byte on Windows, where a locked byte cannot be read."""


def _process(handle: int) -> str:
    """Text with the number of the process that holds a lock, from the lock file; empty
    if unknown.
    """
    with suppress(OSError):
        os.lseek(handle, 0, os.SEEK_SET)
        # no process has a number of more than 20 digits
        number = os.read(handle, 20).decode("ascii", "replace")
        if number.isdecimal():
            return f" (process {number})"
    return ""
