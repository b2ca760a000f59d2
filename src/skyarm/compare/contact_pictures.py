"""One flight of each task of the contact suite, in its first wrong world: its log, its picture, and its film."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from skyarm.compare.contact_flights import ContactFlights
from skyarm.compare.fly_comparison import Progress
from skyarm.compare.one_by_one import numbers_of, one_episode
from skyarm.figures.path_views import task_figure
from skyarm.figures.style import image_bytes
from skyarm.files import write_atomically
from skyarm.film.film_settings import FilmSettings
from skyarm.film.make_film import make_film
from skyarm.film.offscreen import offscreen
from skyarm.log.flight_log import Log
from skyarm.simulate.loop import run

DPI = 160.0

FILM: Mapping[str, Any] = {"camera": "fixed", "width": 640, "height": 400, "fps": 12, "speed": 2.0, "ghost": False}
"""Settings of a film that is small enough to stand beside a report."""


def shown_flights(todo: Sequence[ContactFlights]) -> dict[str, ContactFlights]:
    """By task the flights of which the first is shown: those of the first law, noisy where there are such."""
    found: dict[str, ContactFlights] = {}
    for each in todo:
        known = found.get(each.case.name)
        if known is None or (each.entrant.name == known.entrant.name and each.condition.noisy):
            found[each.case.name] = each
    return found


def first_flight(flights: ContactFlights) -> Log:
    """The flight in the first of the wrong worlds."""
    scenario = flights.scenario()
    return run(dataclasses.replace(one_episode(scenario, numbers_of(flights.values(scenario), 0)), episode=0))


def write_pictures(
    todo: Sequence[ContactFlights], folder: Path, *, films: bool = False, progress: Progress | None = None
) -> dict[str, dict[str, str]]:
    """Fly, draw and film one world of each task into ``flights``, ``pictures`` and ``films``.

    Args:
        todo: flights of the suite.
        folder: of the suite.
        films: whether each is filmed, too.
        progress: called after each task.

    Returns:
        by task: law, condition and ending of the flight, and files below the folder.

    Raises:
        ValueError, OSError: one line: nothing can be drawn here, or a file cannot be written.
    """
    shown, found = shown_flights(todo), dict[str, dict[str, str]]()
    for k, (name, flights) in enumerate(shown.items()):
        log = first_flight(flights)
        files = {"flight": f"flights/{name}.npz", "picture": f"pictures/{name}.png"}
        log.save_npz(folder / files["flight"])
        write_atomically(folder / files["picture"], image_bytes(task_figure(log), dpi=DPI))
        if films:
            files["film"] = f"films/{name}.webp"
            make_film(log, folder / files["film"], FilmSettings(**FILM, title=flights.task.title))
        told = {"law": flights.entrant.name, "condition": flights.condition.name, "status": str(log.status)}
        found[name] = told | files
        if progress is not None:
            progress(k + 1, len(shown), f"picture of {name}")
    return found


def require_films() -> None:
    """Say before anything flies that nothing can be drawn on this machine.

    Raises:
        NoDisplayError: one line.
    """
    with offscreen():
        pass


def caption_of(title: str, told: Mapping[str, str]) -> str:
    """What a picture shows, in words."""
    ending = "" if told["status"] == "completed" else f", {told['status']}"
    return f"{title}: {told['law']}, first world, {told['condition']}{ending}"
