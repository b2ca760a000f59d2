"""Journal of a flight: a file that grows while it flies, from which a run that was killed is read back.

The file is a line, a description as JSON and rows of all columns of the log, each block behind its length and checksum.
"""

from __future__ import annotations

import json
import os
import struct
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import perf_counter
from typing import IO, Any

import numpy as np

from skyarm.log.contents import arrays_of, as_cut, columns_in, log_info, log_of
from skyarm.log.flight_log import Log
from skyarm.log.log_columns import columns
from skyarm.records.files import shown

PAUSE = 0.25
"""s between two writes at least, and before the first: most flights are over by then and are written once."""

SHARE = 0.2
"""Largest part of a flight's time that is spent on this."""

ENDING = ".partial"

MAGIC = b"skyarm journal 1\n"

_HEAD = struct.Struct("<QI")
"""Before each block: its bytes, and their CRC-32."""

Between = Callable[[int, int], Log]
"""(first, stop) -> log of these control instants."""


class Journal:
    """Journal file of a running flight; called as ``keep`` of :func:`skyarm.run`.

    Args:
        file: to write; one of before is replaced, once there is something to write.

    Attributes:
        kept: control instants in the file. until: time of the last of them, s.
    """

    def __init__(self, file: Path) -> None:
        self.file, self.kept, self.until = file, 0, 0.0
        self._due = perf_counter() + PAUSE
        self._stream: IO[bytes] | None = None
        self._next = (0, 0, 0.0)

    def __call__(self, done: int, between: Between) -> None:
        """Write the new control instants, if that is due.

        Args:
            done: control instants flown.
            between: gives the log of some of them.
        """
        begun = perf_counter()
        if begun < self._due or done <= self.kept:
            return
        try:
            self._extend(between(self.kept, done))
        except OSError as error:
            self._due = float("inf")
            warnings.warn(f"file = {shown(str(self.file))}: is not kept up ({error.strerror})", stacklevel=2)
            return
        now = perf_counter()
        self._due = now + max(PAUSE, (now - begun) / SHARE)

    def _extend(self, log: Log) -> None:
        if self._stream is None:
            self._stream = self.file.open("wb")
            self._stream.write(MAGIC + _block(json.dumps(log_info(log)).encode()))
        rows = np.column_stack([each.of(log) for each in columns(log)])
        block = _block(rows.astype("<f8").tobytes())
        self._next = (self._stream.tell() + len(block), self.kept + log.time.size, float(log.time[-1]))
        self._stream.write(block)
        self._stream.flush()
        _, self.kept, self.until = self._next

    def close(self) -> None:
        """Write no more, and count what a signal left uncounted: it may come right behind the writing."""
        self._due = float("inf")
        if self._stream is not None:
            with suppress(OSError):
                self._stream.close()
            end, kept, until = self._next
            with suppress(OSError):
                if self.file.stat().st_size >= end:
                    self.kept, self.until = kept, until

    def remove(self) -> None:
        """Remove the file, if there is one of this flight."""
        self.close()
        if self._stream is not None:
            self.file.unlink(missing_ok=True)


def partial_file(log_file: str | os.PathLike[str]) -> Path:
    """Journal of a flight whose log is to be at ``log_file``: ``case3.partial``."""
    file = Path(log_file)
    return file.with_name(f"{file.stem}{ENDING}")


@contextmanager
def journal_beside(log_file: str | os.PathLike[str], say: Callable[[str], object]) -> Iterator[Journal]:
    """A journal for a flight and the writing of its log, after which it is removed.

    Where an error of wrong input ends the work it is removed too; after a signal, or where the log cannot be written,
    it stays, and ``say`` gets a line about it.
    """
    journal = Journal(partial_file(log_file))
    try:
        yield journal
    except BaseException as error:
        journal.close()
        if isinstance(error, Exception) and not isinstance(error, (OSError, MemoryError)):
            journal.remove()
        elif journal.kept:
            say(f"what was flown until t = {journal.until:g} s is kept: {journal.file}")
        raise
    journal.remove()


def write_journal(log: Log, path: Path) -> Path:
    """Write a whole log as a journal."""
    journal = Journal(path)
    journal._extend(log)
    journal.close()
    return path


def read_journal(path: Path) -> Log:
    """Read a journal as far as it is whole, with the status ``cut`` and a warning.

    Raises:
        OSError: the file cannot be read. ValueError: one line: it is no journal.
    """
    name, content = f"log = {shown(os.fspath(path))}", path.read_bytes()
    if not content.startswith(MAGIC):
        raise ValueError(f"{name}: must be the journal of a flight")
    try:
        head, *rows = _blocks(content) or [b"null"]
        info: Any = json.loads(head)
        names = columns_in(info)
        table = np.frombuffer(b"".join(rows), "<f8").astype(float).reshape(-1, len(names))
        return as_cut(log_of(arrays_of(table, names, info), info), name)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{name}: {error if 'must' in str(error) else 'must be the journal of a flight'}") from None


def _block(content: bytes) -> bytes:
    return _HEAD.pack(len(content), zlib.crc32(content)) + content


def _blocks(content: bytes) -> list[bytes]:
    """Blocks up to the first that is cut off or damaged."""
    found, at = [], len(MAGIC)
    while at + _HEAD.size <= len(content):
        length, checksum = _HEAD.unpack_from(content, at)
        at += _HEAD.size
        block = content[at : at + length]
        if len(block) < length or zlib.crc32(block) != checksum:
            break
        found.append(block)
        at += length
    return found
