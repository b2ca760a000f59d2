"""Transcripts of the bytes exchanged with another program: recording and playback.

A transcript is a gzip file: ``MAGIC``, then for each message its time (s, 64-bit
float), direction (``s`` for sent, ``r`` for received), length of the channel's name
(one byte), length of the message (four bytes), little endian, and then name and
message.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import itertools
import os
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from skyarm.records.files import shown

MAGIC = b"skyarm transcript 1\n"

HEAD = struct.Struct("<dcBI")

LONGEST = 1 << 20
"""Largest length (bytes) of a message, more than any socket returns at once."""

SENT, RECEIVED = b"s", b"r"

WORDS = {SENT: "sent", RECEIVED: "received"}

AUTOPILOT = "autopilot"
"""Name of the channel of the autopilot's name."""

Row = tuple[bytes, str, bytes]


class TranscriptError(ValueError):
    """Error if a transcript cannot be read or written, or if the exchange differs from
    it.
    """


class Tape:
    """Recorder or player of the messages exchanged with a program, in order, with their
    connection's name and time.

    Without a file nothing is kept; a file begins with the first message, and replaces a
    transcript only. Played back, a tape answers in the program's place: what is sent
    must be, byte for byte, what was sent then.

    Args:
        file: path to write to.
        played: transcript to play back.
        name: name of the autopilot.

    Attributes:
        time: time of the messages that follow, s.
        plays: True for a tape that is played back.

    Raises:
        TranscriptError: a file that cannot be written, that is no transcript or that of
            another autopilot, or both a file and one to play back.
    """

    def __init__(self, file: str = "", played: str = "", name: str = "") -> None:
        self.time, self._name = 0.0, name
        self.plays = bool(played)
        self._rows = rows_of(Path(played)) if played else None
        self._file: gzip.GzipFile | None = None
        self._path = Path(file).expanduser() if file else None
        if self._rows is not None:
            # the beginning is read here, so that a file that is no transcript is
            # refused early
            next(self._rows)
            self._rows = _rows_for(name, self._rows, played)
        if self._path is not None:
            if played:
                raise TranscriptError(
                    "controller.transcript: must be left out beside controller.replayed"
                )
            _require_writable(self._path)

    def send(self, channel: str, data: bytes, send: Callable[[bytes], object]) -> None:
        """Send bytes over a channel and record them; in playback, compare them with the
        recorded bytes.

        Raises:
            TranscriptError: other bytes than those of the transcript.
        """
        if self._rows is not None:
            expected = self._next(SENT, channel)
            if expected != data:
                raise TranscriptError(
                    f"transcript: at {self.time:g} s: {len(data)} bytes sent over"
                    f" {channel} differ from the {len(expected)} recorded"
                )
            return
        # sent first: what could not be sent is not recorded
        send(data)
        self._write(SENT, channel, data)

    def receive(self, channel: str, receive: Callable[[], bytes]) -> bytes:
        """Receive bytes over a channel and record them; in playback, return the
        recorded bytes.

        Raises:
            TranscriptError: the transcript has something else at this place.
        """
        if self._rows is not None:
            return self._next(RECEIVED, channel)
        data = receive()
        self._write(RECEIVED, channel, data)
        return data

    def close(self) -> None:
        """Complete the transcript file; a second call has no effect.

        Raises:
            TranscriptError: it cannot be written, as on a full disk.
        """
        file, path, self._file, self._path = self._file, self._path, None, None
        if file is not None and path is not None:
            with _writing(path):
                file.close()

    def _write(self, what: bytes, channel: str, data: bytes) -> None:
        if self._path is None:
            return
        try:
            with _writing(self._path):
                if self._file is None:
                    self._file = _begin(self._path)
                    if self._name:
                        self._file.write(
                            _pack(0.0, SENT, AUTOPILOT, self._name.encode())
                        )
                self._file.write(_pack(self.time, what, channel, data))
        except TranscriptError:
            # a second error of the same disk tells less than the first
            with contextlib.suppress(TranscriptError):
                self.close()
            raise

    def _next(self, what: bytes, channel: str) -> bytes:
        """Next message of a played-back transcript, after a check of its direction and
        connection.
        """
        assert self._rows is not None
        row = next(self._rows, None)
        if row is None:
            raise TranscriptError(
                f"transcript: ends at {self.time:g} s, before the flight does"
            )
        if row[0] != what or row[1] != channel:
            raise TranscriptError(
                f"transcript: at {self.time:g} s: {WORDS[what]} over {channel}, but"
                f" {WORDS[row[0]]} over {row[1]} is recorded"
            )
        return row[2]


def _pack(time: float, what: bytes, channel: str, data: bytes) -> bytes:
    name = channel.encode("ascii")
    return HEAD.pack(time, what, len(name), len(data)) + name + data


def _rows_for(name: str, rows: Iterator[Row], file: str) -> Iterator[Row]:
    """Messages of a transcript without its first one, the autopilot's name, which is
    checked.

    Raises:
        TranscriptError: it is that of another autopilot.
    """
    first = next(rows, None)
    # one that was recorded without a name begins with the exchange
    if first is None or first[1] != AUTOPILOT:
        return rows if first is None else itertools.chain([first], rows)
    if name and first[2] != name.encode():
        theirs = first[2].decode("ascii", "replace")
        raise TranscriptError(
            f"controller.replayed = {shown(file)}: must be a transcript of {name}, is"
            f" of {theirs}"
        )
    return rows


def _require_writable(path: Path) -> None:
    """Check that a transcript file can be written, without touching it."""
    where = f"controller.transcript = {shown(path)}: must be a file that can be written"
    try:
        if not path.parent.is_dir():
            raise TranscriptError(f"{where} (its folder is missing)")
        if path.is_dir() or not os.access(
            path if path.exists() else path.parent, os.W_OK
        ):
            raise TranscriptError(f"{where} (it is a folder, or not ours)")
        if path.is_file() and path.stat().st_size and not _is_transcript(path):
            raise TranscriptError(
                f"controller.transcript = {shown(path)}: must not be a file of"
                " another kind"
            )
    except OSError as error:
        raise TranscriptError(f"{where} ({error.strerror})") from None


def _is_transcript(path: Path) -> bool:
    """True if a file starts like a transcript."""
    try:
        with gzip.open(path, "rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except (OSError, EOFError, zlib.error):
        return False


def _begin(path: Path) -> gzip.GzipFile:
    """Open a transcript file and write its header, so that even an interrupted
    recording is readable.
    """
    # no time of writing in the header: equal exchanges give equal files
    file = gzip.GzipFile(path, "wb", compresslevel=6, mtime=0)
    file.write(MAGIC)
    file.flush()
    return file


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Context manager that converts a failed write to a TranscriptError with the file's
    name.
    """
    try:
        yield
    except OSError as error:
        raise TranscriptError(
            f"controller.transcript = {shown(path)}: must be a file that can be"
            f" written ({error.strerror})"
        ) from None


def rows_of(path: Path) -> Iterator[Row]:
    """Yield direction, channel and bytes of each message of a transcript; an
    interrupted recording ends early.

    Raises:
        TranscriptError: no transcript.
    """
    where, begun = f"controller.replayed = {shown(path)}", False
    try:
        # a quarter of a MiB at a time, since messages are small
        with io.BufferedReader(gzip.open(path.expanduser(), "rb"), 1 << 18) as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise TranscriptError(
                    f"{where}: must be a transcript that was recorded"
                )
            begun = True
            # a first row before any message: who asks for it knows that the file is a
            # transcript
            yield SENT, "", MAGIC
            while len(head := file.read(HEAD.size)) == HEAD.size:
                _, what, name, size = HEAD.unpack(head)
                # a damaged length must not fill the memory
                if what not in WORDS or size > LONGEST:
                    raise TranscriptError(
                        f"{where}: must be a transcript that was recorded; it is"
                        " damaged"
                    )
                channel, data = file.read(name), file.read(size)
                # a recording that was interrupted is played as far as it is whole
                if len(channel) + len(data) < name + size:
                    return
                yield what, channel.decode("ascii", "replace"), data
    except EOFError as error:
        if not begun:
            raise TranscriptError(
                f"{where}: must be a transcript that was recorded ({error})"
            ) from None
    except (OSError, zlib.error) as error:
        raise TranscriptError(
            f"{where}: must be a transcript that was recorded ({error})"
        ) from None
