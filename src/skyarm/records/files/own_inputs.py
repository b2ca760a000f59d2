"""Files that the running command has read, and that it must not write over."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

from skyarm.records.files.messages import shown
from skyarm.records.files.paths import PathLike

_read: ContextVar[dict[tuple[int, int], Path] | None] = ContextVar("read", default=None)
"""Device and number of each file that was read -> its path; None outside commands, where all may be written."""


@contextmanager
def inputs_kept() -> Iterator[None]:
    """Context of one command, in which no file is written over that was read before."""
    before = _read.set({})
    try:
        yield
    finally:
        _read.reset(before)


def note_input(path: Path, found: os.stat_result) -> None:
    """Note a file as input of the running command, by its place on the disk: it may have several names."""
    files = _read.get()
    if files is not None:
        files[found.st_dev, found.st_ino] = path.absolute()


def is_input(path: str | os.PathLike[str]) -> bool:
    """True if a file is one that the running command has read, under whatever name."""
    files = _read.get()
    try:
        found = os.stat(path) if files else None
    except (OSError, ValueError):  # not there yet, or never
        return False
    source = files.get((found.st_dev, found.st_ino)) if files and found else None
    # a number goes to another file once its own is gone
    return source is not None and found is not None and source.exists() and os.path.samestat(found, source.stat())


def require_no_input(path: PathLike, field: str = "file") -> None:
    """Raise an error if an output file is one that the running command has read, under whatever name.

    Raises:
        ValueError: with one line that names the file.
    """
    if is_input(path):
        raise ValueError(f"{field} = {shown(os.fspath(path))}: must be another file than those that are read")
