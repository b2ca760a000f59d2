"""``skyarm export``: the log of a flight in another format, and layouts for programs that show it."""

from __future__ import annotations

import os
from pathlib import Path

from skyarm.files import must_be_one_of, output_file, require_writable, shown, unreadable
from skyarm.log.formats import load_log, require_format, save_log
from skyarm.registry import names

OTHER_NAMES = {"ros1": "bag"}
"""What a format is called beside its suffix."""


def export(flight: str, to: str | None, file: str | None, layouts: str | None) -> tuple[Path | None, list[Path]]:
    """Write a log in another format.

    Args:
        flight: file of a log that can be read back.
        to: name of a format; that of ``file``'s suffix if left out.
        file: to write; beside the flight, with the format's suffix, if left out.
        layouts: folder for layouts of Foxglove and PlotJuggler.

    Returns:
        the files that were written: that of the log, if one was asked for, and those of the layouts.

    Raises:
        ValueError, OSError: one line.
    """
    if to is None and file is None and layouts is None:
        raise ValueError(f"--to: is missing; {must_be_one_of(_formats(), None)}")
    require_format(flight, "flight")
    reason = unreadable(Path(flight))
    if reason:
        raise ValueError(f"flight = {shown(flight)}: {reason}")
    target = None if to is None and file is None else _target(flight, to, file)
    if layouts is not None:
        require_writable(layouts)
    log = load_log(flight)
    if target is not None:
        save_log(log, target)
    if layouts is None:
        return target, []
    from skyarm.log.viewer_layouts import write_layouts

    return target, write_layouts(log, layouts)


def _formats() -> dict[str, str]:
    """Every name of a format -> suffix."""
    return {name: name for name in names("log_format")} | OTHER_NAMES


def _target(flight: str, to: str | None, file: str | None) -> Path:
    """Path of the file to write.

    Raises:
        ValueError: no such format, a suffix of another one, or the flight's own file.
    """
    if to is not None and to not in _formats():
        raise ValueError(f"--to = {shown(to)}: {must_be_one_of(_formats(), to)}")
    suffix = None if to is None else _formats()[to]
    if file is None:
        place = Path(flight).with_suffix(f".{suffix}")
    else:
        require_format(file, "--out")
        if suffix is not None and Path(file).suffix != f".{suffix}":
            raise ValueError(f"--out = {shown(file)}: must end in .{suffix}, as --to = {shown(to)} is written")
        place = output_file(file, "--out")
    if os.path.realpath(place) == os.path.realpath(flight):
        raise ValueError(f"--out = {shown(str(place))}: must be another file than the flight")
    return place
