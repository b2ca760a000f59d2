"""Files that the running command has read, and that it must not write over."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from skyarm.records.files.messages import shown
from skyarm.records.files.paths import PathLike

_read: ContextVar[set[tuple[Path, tuple[int, ...]]] | None] = ContextVar(
    "read", default=None
)
"""Path and stamp of each file read by the running command; None outside commands, where
any file may be overwritten."""


@contextmanager
def inputs_kept() -> Iterator[None]:
    """Context manager of a command, during which files that the command has read cannot
    be overwritten.
    """
    before = _read.set(set())
    try:
        yield
    finally:
        _read.reset(before)


def note_input(path: Path) -> None:
    """Record a file as input of the running command, with its identity on the disk,
    since it may have several names.
    """
    files = _read.get()
    if files is not None:
        files.add((path.absolute(), stamp_of(path)))


def stamp_of(path: PathLike) -> tuple[int, ...]:
    """Device, inode number, modification time (ns) and size of a file; empty if there
    is none.
    """
    try:
        status = os.stat(path)
    # a NUL in a path is a ValueError
    except (OSError, ValueError):  # not there yet, or never
        return ()
    return status.st_dev, status.st_ino, status.st_mtime_ns, status.st_size


def is_input(path: PathLike) -> bool:
    """True if a file is one that the running command has read, under whatever name."""
    now = stamp_of(path)
    # a number goes to another file once its own is gone: the time tells, or a path that
    # leads to it still
    return now != () and any(
        now == then or now[:2] == then[:2] == stamp_of(source)[:2]
        for source, then in _read.get() or ()
    )


def require_no_input(path: PathLike, field: str = "file") -> None:
    """Raise an error if an output file is one that the running command has read, under
    whatever name.

    Raises:
        ValueError: with one line that names the file.
    """
    if is_input(path):
        raise ValueError(
            f"{field} = {shown(path)}: must be another file than those that are read"
        )
