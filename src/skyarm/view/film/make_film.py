"""A film of one flight or of several: what moves, drawn frame by frame, written into one file."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from skyarm.log.flight_log import Log
from skyarm.view.film.camera_paths import CAMERAS, CameraPath
from skyarm.view.film.captions import Captions, FrameLayout, frame_layout
from skyarm.view.film.film_settings import FilmSettings
from skyarm.view.film.filmed_flight import FilmedFlight, film_flights, frame_times
from skyarm.view.film.marks import ghost_solids, marks_of, vehicle_solids
from skyarm.view.film.stage import Panel, open_stage
from skyarm.view.film.video_files import require_film_format
from skyarm.view.scene.shapes import Solid
from skyarm.view.scene.vehicle_shapes import longest_boom

Pixels = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float64]

Progress = Callable[[int, int], None]
"""(frames drawn, frames in all)."""


def make_film(
    flights: Log | Sequence[Log],
    file: str | os.PathLike[str],
    settings: FilmSettings | None = None,
    *,
    labels: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Film flights into an MP4, an animated WebP or a GIF, by the file's suffix.

    Args:
        flights: one log or several, at most MOST_FLIGHTS.
        file: appears whole or not at all.
        settings: size, speed, camera, layout.
        labels: name of each flight; its law, or its scenario where the laws are the same.
        progress: called after each frame.

    Raises:
        ValueError: one line: settings, a log that cannot be filmed, or what is missing on this machine.
        OSError: the file cannot be written.
    """
    chosen = settings or FilmSettings()
    path = Path(file)
    write = require_film_format(path)
    if write is None:
        raise TypeError("a film without a writer")
    logs = [flights] if isinstance(flights, Log) else list(flights)
    times = frame_times(logs, chosen)
    filmed = film_flights(logs, times, labels)
    frames = film_frames(filmed, times, _titled(chosen, logs), progress)
    return write(path, frames, (chosen.width, chosen.height), chosen.fps, len(times))


def film_frames(
    flights: Sequence[FilmedFlight], times: Array, settings: FilmSettings, progress: Progress | None = None
) -> Iterator[Pixels]:
    """Draw the frames of a film, one after the other, as (height, width, 3) bytes.

    Raises:
        NoDisplayError: nothing can be drawn on this machine.
    """
    width, height = settings.width, settings.height
    layout = frame_layout(width, height, len(flights), settings.layout, plot=settings.plot)
    captions = Captions(flights, times, layout, settings.title or "")
    with open_stage(film_panels(flights, times, settings, layout), width, height, fine=settings.fine) as stage:
        for k in range(len(times)):
            yield captions.frame(stage.draw(k), k)
            if progress is not None:
                progress(k + 1, len(times))


def film_panels(
    flights: Sequence[FilmedFlight], times: Array, settings: FilmSettings, layout: FrameLayout
) -> list[Panel]:
    """Pictures of a frame: who is in each, and where its camera stands."""
    together = [list(flights)] if settings.layout == "over" else [[flight] for flight in flights]
    paths = _cameras(together, times, settings, layout)
    panels = []
    for box, inside, path in zip(layout.panels, together, paths, strict=True):
        solids: list[Solid] = [solid for flight in inside for solid in vehicle_solids(flight)]
        if settings.ghost:
            solids += ghost_solids(inside[0])
        booms = max(longest_boom(flight.vehicle) for flight in inside)
        marks = marks_of(inside, times, booms, layout.scale)
        panels.append(Panel(box.left, box.top, box.width, box.height, path, solids, marks, inside[0].ground))
    return panels


def _cameras(
    together: Sequence[Sequence[FilmedFlight]], times: Array, settings: FilmSettings, layout: FrameLayout
) -> list[CameraPath]:
    """A camera for each panel: the same where the flights have one desired path, and from the same distance always."""
    seconds = (times - times[0]) / settings.speed
    every = [flight for inside in together for flight in inside]
    path = CAMERAS[settings.camera]
    aspect = min(box.width / box.height for box in layout.panels)
    if all(np.allclose(flight.desired_position, every[0].desired_position, atol=1e-3) for flight in every):
        return [path(every, seconds, aspect)] * len(together)
    paths = [path(inside, seconds, aspect) for inside in together]
    distance = np.max([each.distance for each in paths], axis=0)
    return [replace(each, distance=distance) for each in paths]


def _titled(settings: FilmSettings, logs: Sequence[Log]) -> FilmSettings:
    """With a title: the scenarios', where none is given."""
    if settings.title is not None:
        return settings
    scenarios = dict.fromkeys(str(log.scenario.title or log.info["scenario"]) for log in logs)
    return replace(settings, title=", ".join(scenarios))
