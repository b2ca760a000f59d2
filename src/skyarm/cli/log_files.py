"""Files of a flight that the command line names: its logs, each in the format of its suffix, and its picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from skyarm.files import output_file, shown
from skyarm.log.flight_log import Log
from skyarm.log.formats import require_format
from skyarm.log.mcap.journal import partial_file


def log_files(names: Sequence[str] | None, usual: Sequence[Path]) -> list[Path]:
    """Paths of the log's files, checked before the flight; the usual ones where none are named.

    Raises:
        ValueError: a suffix that no log format is registered for, with those there are; or a file that is named twice.
        OSError: one of them cannot be written.
    """
    if not names:
        return list(usual)
    for name in names:
        require_format(name, "--log")
    found: dict[Path, str] = {}
    for name in names:
        file = output_file(name, "--log")
        place = file.resolve()
        if place in found:
            raise ValueError(f"--log = {shown(name)}: must be another file than --log = {shown(found[place])}")
        found[place] = name
    return [Path(name) for name in names]


def require_kept_apart(logs: Sequence[Path], scenario: str) -> None:
    """Refuse what would be lost: a file in which the flight stands while it goes on is removed behind it.

    Args:
        logs: files of the flight's logs.
        scenario: as the command was given it; perhaps the log of a flight that was cut off.

    Raises:
        ValueError: one of them is that file.
    """
    partial = partial_file(logs[0])
    words = f"must be another file than {partial.name}, in which the flight stands while it goes on"
    for option, file in (("scenario", Path(scenario)), *(("--log", file) for file in logs)):
        if file.resolve() == partial.resolve():
            raise ValueError(f"{option} = {shown(str(file))}: {words}")


def draw(log: Log, file: Path) -> Path:
    """Write a flight's picture in the format of its suffix. Matplotlib loads here: most flights are not drawn."""
    from skyarm.figures.flight_plot import plot

    plot(log, file)
    return file
