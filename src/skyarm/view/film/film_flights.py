"""Films and 3D recordings of flights by a Python function, which simulates scenarios
first.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from skyarm.log.flight_log import Log
from skyarm.log.formats import as_log
from skyarm.records.files import PathLike, output_file
from skyarm.records.registry import names
from skyarm.scenario.scenario_record import Scenario
from skyarm.simulate.loop import run
from skyarm.view.film.make_film import FilmSettings, Progress, make_film
from skyarm.view.film.recording import SUFFIXES, record, save_recording
from skyarm.view.film.video_files import require_film_format, usual_size_and_rate

Flight = Log | Scenario | PathLike
"""Log or scenario, or the path or name of one."""


def film(
    flights: Flight | Sequence[Flight],
    file: PathLike,
    *,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
    **settings: Any,
) -> Path:
    """Film flights as MP4 or WebP, or record them for a browser (.viser, .html), as
    ``skyarm film`` does.

    Args:
        flights: a log or a scenario, the path or name of one, or several; scenarios are
            flown first.
        file: appears whole or not at all.
        labels: name of each flight.
        progress: called with (frames drawn, frames in all).
        settings: fields of :class:`skyarm.view.film.make_film.FilmSettings`: layout,
            camera, inset, width, height, fps, speed, start, stop, ghost, plot, fine,
            title.

    Returns:
        the file.

    Raises:
        ValueError: one line: a flight, a suffix, a setting, or what is missing on this
            machine.
        OSError: the file cannot be written.
    """
    path = output_file(os.fspath(file), "file")
    require_film_format(path, SUFFIXES)
    usual = dict(
        zip(("width", "height", "fps"), usual_size_and_rate(path), strict=True)
    )
    chosen = FilmSettings(**usual | settings)
    listed = (
        flights
        if isinstance(flights, Sequence) and not isinstance(flights, str)
        else [flights]
    )
    if not listed:
        raise ValueError("flights = []: must name at least one")
    logs = [_log(each) for each in listed]
    return write_film(logs, path, chosen, labels=labels, progress=progress)


def write_film(
    logs: Sequence[Log],
    path: Path,
    settings: FilmSettings,
    *,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write logs to a film, or to a 3D recording if the file's suffix is that of a
    recording.
    """
    if require_film_format(path, SUFFIXES) in SUFFIXES:
        return save_recording(
            record(logs, settings, labels=labels, progress=progress), path
        )
    return make_film(logs, path, settings, labels=labels, progress=progress)


def _log(flight: Flight) -> Log:
    """Log of a flight; a scenario is simulated first."""
    if isinstance(flight, (str, os.PathLike)) and Path(flight).suffix[1:] in names(
        "log_format"
    ):
        return as_log(flight)
    return flight if isinstance(flight, Log) else run(flight)
