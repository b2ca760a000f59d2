"""A flight as an MCAP file that Foxglove, Lichtblick, PlotJuggler and every reader of ROS 2 bags open, and back."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from skyarm.files import shown, versions
from skyarm.files.atomic import writing_atomically
from skyarm.log.contents import LAYOUT, arrays_of, columns_in, log_of
from skyarm.log.flight_log import Log, rows_of
from skyarm.log.log_columns import layout
from skyarm.log.mcap.container import McapWriter, Messages
from skyarm.log.mcap.scan import McapError, numbers, scan
from skyarm.log.ros.message_types import definition, full_name
from skyarm.log.ros.topics import FLIGHT_TOPIC, FlightTopics, control_rate, period_of

CHUNK = 1.0
"""s of flight in a chunk, about: what is lost at most where a file is cut off."""

INFO, SCENARIO = "info.json", "scenario.json"
"""Attachments: what the log says of itself, and in a file of its own the scenario as plain data."""

CUT = "cut"
"""Status of a log whose file was cut off."""


class CutLogWarning(UserWarning):
    """A log's file was cut off; what came before is read."""


class FlightWriter:
    """Writes a flight part by part.

    Args:
        write: takes bytes, in the order of the file.
        log: of the flight or of its first part: its names, its structure, what it says of itself.
    """

    def __init__(self, write: Callable[[bytes], object], log: Log) -> None:
        self._topics = FlightTopics(log)
        self._chunk = chunk_of(log)
        self._file = McapWriter(write, f"skyarm {versions()['skyarm']}")
        known = self._topics.definitions
        self._channels = [
            self._file.channel(topic.name, full_name(topic.kind), definition(topic.kind, known))
            for topic in self._topics.topics
        ]
        info = {name: value for name, value in log.info.items() if name != "scenario_record"}
        self._attach(INFO, info | {LAYOUT: layout(log)})
        if "scenario_record" in log.info:
            self._attach(SCENARIO, log.info["scenario_record"])
        told = {name: value for name, value in info.items() if isinstance(value, (str, int, float))}
        self._file.describe("skyarm", {name: str(value) for name, value in told.items()})

    def _attach(self, name: str, data: Any) -> None:
        self._file.attach(name, "application/json", json.dumps(data).encode())

    def part(self, log: Log, first: int) -> None:
        """Write a part of the flight.

        Args:
            log: the part; of whole chunks (:func:`chunk_of`), but for the last.
            first: number of its first instant.
        """
        for begin in range(0, log.time.size, self._chunk):
            piece, instant = rows_of(log, slice(begin, begin + self._chunk)), first + begin
            messages = []
            for channel, topic in zip(self._channels, self._topics.topics, strict=True):
                if topic.every or not instant:
                    stamps, data = self._topics.encoded(topic, piece)
                    before = instant // topic.every if topic.every else 0
                    messages.append(Messages(channel, before, topic.every, stamps, data, topic.offset))
            self._file.chunk(messages, self._topics.period)

    def end(self) -> None:
        """Write the index."""
        self._file.end()


def chunk_of(log: Log) -> int:
    """Control instants of a chunk."""
    rate, period = control_rate(log), period_of(log)
    return period * max(1, round(CHUNK * rate / period))


def write_mcap(log: Log, path: Path) -> Path:
    """Write a log as an MCAP file, which appears whole or not at all."""
    with writing_atomically(path) as stream:
        writer = FlightWriter(stream.write, log)
        writer.part(log, 0)
        writer.end()
    return path


def read_mcap(path: Path) -> Log:
    """Read a log from an MCAP file, to the bit; from one that was cut off what came before.

    The log of such a file has the status ``cut``, and a warning says at what time.

    Raises:
        OSError: the file cannot be read. ValueError: one line: it is no such file, or it is damaged.
    """
    name = f"log = {shown(os.fspath(path))}"
    content = path.read_bytes()
    try:
        found = scan(content, FLIGHT_TOPIC)
        log = _log(found.attachments, found.messages)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if found.whole:
        return log
    time = f"{log.time[-1]:g}" if log.time.size else "0"
    cause = f"the log is cut at t = {time} s of {log.info.get('duration', 'unknown')} s"
    warnings.warn(f"{name}: cut at t = {time} s; what came before is read", CutLogWarning, stacklevel=2)
    log.info.update(status=CUT, cause=cause, end_time=float(log.time[-1]) if log.time.size else 0.0)
    return log


def _log(attachments: dict[str, bytes], messages: list[bytes]) -> Log:
    """The log of what a file holds."""
    if INFO not in attachments:
        raise McapError(f"must be a log that skyarm wrote, with the attachment {INFO}")
    try:
        info = json.loads(attachments[INFO])
        if SCENARIO in attachments:
            info["scenario_record"] = json.loads(attachments[SCENARIO])
        elif "digest" in info:
            raise McapError(f"must hold the attachment {SCENARIO}, before which it was cut off")
    except McapError:
        raise
    except (ValueError, TypeError, RecursionError):
        raise McapError(f"{INFO}: must be what skyarm writes of a flight") from None
    names = columns_in(info)
    return log_of(arrays_of(numbers(messages, len(names)), names, info), info)
