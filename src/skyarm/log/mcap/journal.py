"""What has been flown so far, on disk while a flight goes on: a run that is killed leaves a log that can be read."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import perf_counter
from typing import IO, Any

from skyarm.files import shown
from skyarm.log.flight_log import Log, rows_of

PAUSE = 0.25
"""s between two writes at least, and before the first: most flights are over by then and are written once."""

SHARE = 0.2
"""Largest part of a flight's time that is spent on this."""

ENDING = ".partial.mcap"

Between = Callable[[int, int], Log]
"""(first, stop) -> log of these control instants."""


class Journal:
    """An MCAP file without its end, which grows by whole seconds of flight.

    It is called while a flight goes on, as ``keep`` of :func:`skyarm.run`.

    Args:
        file: to write; one of before is replaced, once there is something to write.

    Attributes:
        kept: control instants in the file. until: time of the last of them, s.
    """

    def __init__(self, file: Path) -> None:
        self.file, self.kept, self.until = file, 0, 0.0
        self._due = perf_counter() + PAUSE
        self._stream: IO[bytes] | None = None
        self._writer: Any = None

    def __call__(self, done: int, between: Between) -> None:
        """Write what is new, if that is due.

        Args:
            done: control instants flown.
            between: gives the log of some of them.
        """
        begun = perf_counter()
        if begun < self._due:
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
        """Write the whole chunks of what is new."""
        # most flights are over before this, and need not wait for it to load
        from skyarm.log.mcap.flight_file import FlightWriter, chunk_of

        chunk = chunk_of(log)
        if self._stream is None and log.time.size >= chunk:
            self._stream = self.file.open("wb")
            self._writer = FlightWriter(self._stream.write, log)
        for begin in range(0, log.time.size - chunk + 1, chunk):
            self._writer.part(rows_of(log, slice(begin, begin + chunk)), self.kept)
            self.kept, self.until = self.kept + chunk, float(log.time[begin + chunk - 1])
        if self._stream is not None:
            self._stream.flush()

    def close(self) -> None:
        """Write no more."""
        self._due = float("inf")
        if self._stream is not None:
            with suppress(OSError):
                self._stream.close()

    def remove(self) -> None:
        """Remove the file, if there is one of this flight."""
        self.close()
        if self._stream is not None:
            self.file.unlink(missing_ok=True)


def partial_file(log_file: str | os.PathLike[str]) -> Path:
    """Where a flight is kept while it goes on, whose log is to be at ``log_file``: ``case3.partial.mcap``."""
    file = Path(log_file)
    return file.with_name(f"{file.stem}{ENDING}")


@contextmanager
def journal_beside(log_file: str | os.PathLike[str], say: Callable[[str], object]) -> Iterator[Journal]:
    """A journal for a flight and the writing of its log, after which it is removed.

    Where an error of wrong input ends the work it is removed too; where a signal does, or the log cannot be written,
    it stays, and ``say`` is told so.
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
