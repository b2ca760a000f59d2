"""Transcripts of an exchange with another program: recording of the bytes both ways, and playing them back."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from skyarm.records.files import shown

SENT, RECEIVED = "sent", "received"


class TranscriptError(ValueError):
    """A transcript cannot be read, or the exchange differs from it."""


class Tape:
    """Record of an exchange: every message in order, with channel and time.

    Without a file nothing is kept. Played back, a tape answers in the program's place: what is sent must be, byte for
    byte, what was sent then.

    Args:
        file: to write to.
        played: transcript to play back.
    """

    def __init__(self, file: str = "", played: str = "") -> None:
        self.time = 0.0
        self._file = gzip.open(file, "wt", 6, "ascii") if file else None  # noqa: SIM115, stays open
        self._rows = _rows_of(Path(played)) if played else None
        self.plays = bool(played)

    def send(self, channel: str, data: bytes, send: Callable[[bytes], Any]) -> None:
        """Send bytes over a channel, or compare them with those of the transcript that is played.

        Raises:
            TranscriptError: other bytes than those of the transcript.
        """
        if self._rows is not None:
            expected = self._next(SENT, channel)
            if expected != data:
                raise TranscriptError(
                    f"transcript: at {self.time:g} s: sent {len(data)} bytes differ from the {len(expected)} recorded"
                )
            return
        send(data)
        self._write(SENT, channel, data)

    def receive(self, channel: str, receive: Callable[[], bytes]) -> bytes:
        """Bytes that arrived over a channel, empty if none, or those of the transcript that is played.

        Raises:
            TranscriptError: the transcript has something else at this place.
        """
        if self._rows is not None:
            return self._next(RECEIVED, channel)
        data = receive()
        self._write(RECEIVED, channel, data)
        return data

    def close(self) -> None:
        """Complete the transcript's file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _write(self, what: str, channel: str, data: bytes) -> None:
        if self._file is not None:
            row = [round(self.time, 6), what, channel, base64.b64encode(data).decode("ascii")]
            self._file.write(json.dumps(row, separators=(",", ":")) + "\n")

    def _next(self, what: str, channel: str) -> bytes:
        assert self._rows is not None
        row = next(self._rows, None)
        if row is None:
            raise TranscriptError(f"transcript: ends at {self.time:g} s, before the flight does")
        if row[1:3] != [what, channel]:
            raise TranscriptError(
                f"transcript: at {self.time:g} s: {what} over {channel}, but {row[1]} over {row[2]} is recorded"
            )
        return base64.b64decode(row[3])


def _rows_of(path: Path) -> Iterator[list[Any]]:
    """Rows of a transcript: time, direction, channel, bytes in base 64."""
    try:
        with gzip.open(path, "rt", encoding="ascii") as file:
            for line in file:
                row = json.loads(line)
                if not (isinstance(row, list) and len(row) == 4 and all(isinstance(each, str) for each in row[1:])):
                    raise ValueError("a row must be time, direction, channel, bytes")
                yield row
    except (OSError, EOFError, ValueError) as error:
        raise TranscriptError(
            f"transcript = {shown(str(path))}: must be a transcript that was recorded ({error})"
        ) from None
