"""Files that the running command has read, and that it must not write over."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from skyarm.records.files.messages import shown

_read: ContextVar[set[tuple[int, int]] | None] = ContextVar("read", default=None)
"""Device and number of each file that was read; None outside commands, where everything may be written."""


@contextmanager
def inputs_kept() -> Iterator[None]:
    """Context of one command, in which no file is written over that was read before."""
    before = _read.set(set())
    try:
        yield
    finally:
        _read.reset(before)


def note_input(found: os.stat_result) -> None:
    """Note a file as input of the running command, by its place on the disk: it may have several names."""
    files = _read.get()
    if files is not None:
        files.add((found.st_dev, found.st_ino))


def require_no_input(path: str | os.PathLike[str], field: str = "file") -> None:
    """Raise an error if an output file is one that the running command has read, under whatever name.

    Raises:
        ValueError: with one line that names the file.
    """
    files = _read.get()
    if files:
        try:
            found = os.stat(path)
        except (OSError, ValueError):  # not there yet, or never
            return
        if (found.st_dev, found.st_ino) in files:
            raise ValueError(f"{field} = {shown(os.fspath(path))}: must be another file than those that are read")
