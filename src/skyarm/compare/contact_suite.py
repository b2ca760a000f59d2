"""Tasks in contact by many laws into a folder: cells, contact.json, contact.csv, tables.md, report.html, pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from skyarm.compare.cells import Cell
from skyarm.compare.contact_flights import CONDITIONS, ContactFlights, contact_flights
from skyarm.compare.contact_laws import LAWS
from skyarm.compare.contact_page import contact_page
from skyarm.compare.contact_pictures import require_films, write_pictures
from skyarm.compare.contact_record import cell_record
from skyarm.compare.contact_tables import contact_csv, contact_report
from skyarm.compare.contact_tasks import TASKS
from skyarm.compare.contact_worlds import about
from skyarm.compare.fly_comparison import Progress, fly_all
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.control.controller import ControllerError
from skyarm.files import require_writable, write_atomically
from skyarm.registry.plugins import identities

CONTACT = "contact-suite"

WORLDS, QUICK = 200, 16
"""Wrong worlds of each task; where it is to be quick."""


@dataclass(frozen=True, kw_only=True)
class ContactSuite:
    """What flies.

    Attributes:
        laws: names, in order. tasks: names, in order. worlds: of each task. seed: of worlds and noise. plant: that
            flies. one_by_one: worlds that a law meets whose flights fly one by one.
    """

    laws: tuple[str, ...] = LAWS
    tasks: tuple[str, ...] = tuple(TASKS)
    worlds: int = WORLDS
    seed: int = 0
    plant: str = "rigid_body"
    one_by_one: int = 8

    def flights(self) -> tuple[list[ContactFlights], dict[str, str]]:
        """Every cell, and why a law does not fly a task."""
        flown, refused = list[ContactFlights](), dict[str, str]()
        options: dict[str, Any] = {"seed": self.seed, "plant": self.plant, "one_by_one": self.one_by_one}
        for each in contact_flights(self.laws, self.tasks, self.worlds, **options):
            try:
                each.scenario()
                flown.append(each)
            except ControllerError as error:
                refused[f"{each.entrant.name} in {each.case.name}"] = str(error)
        return flown, refused


def fly_contact(
    suite: ContactSuite, folder: Path, *, threads: int = 1, films: bool = False, progress: Progress | None = None
) -> dict[str, Any]:
    """Fly what is missing of a suite, write the folder's files, and return the content of ``contact.json``.

    Of each task one world is flown once more for its picture, and with ``films`` for a film.

    Raises:
        ValueError: no law flies any task.
        OSError: a file cannot be written.
    """
    require_machine_code()
    if films:
        require_films()
    todo, refused = suite.flights()
    if not todo:
        raise ValueError("; ".join(f"--laws: {law}: {why}" for law, why in refused.items()))
    for name in ("flights", "pictures", *(["films"] if films else [])):
        require_writable(folder / name)
    cells = fly_all(todo, folder / "cells", threads=threads, progress=progress)
    found = contact_record(suite, todo, cells, refused)
    found["shown"] = write_pictures(todo, folder, films=films, progress=progress)
    write_contact(found, folder)
    return found


def contact_record(
    suite: ContactSuite,
    todo: Sequence[ContactFlights],
    cells: Mapping[tuple[str, str, str], Cell],
    refused: Mapping[str, str],
) -> dict[str, Any]:
    """All of a suite as plain data."""
    tasks: dict[str, Any] = {}
    for flights in todo:
        task, condition, law = flights.task, flights.condition.name, flights.entrant.name
        if task.name not in tasks:
            empty: dict[str, Any] = {name: {} for name in CONDITIONS}
            tasks[task.name] = {"title": task.title, **about(flights.worlds()), "conditions": empty}
        scenario = flights.scenario()
        weight = float(scenario.world.vehicle.mass) * float(scenario.world.gravity)
        cell = cells[condition, task.name, law]
        phases = len(scenario.trajectory.phases)
        tasks[task.name]["conditions"][condition][law] = cell_record(
            task, cell, weight, phases, flights.values(scenario)["delays.command"]
        )
    found: dict[str, Any] = {"schema": 1, "suite": CONTACT, "seed": suite.seed, "plant": suite.plant}
    found |= {"worlds": suite.worlds, "laws": list(suite.laws)}
    if identities():
        found["plugins"] = identities()
    return found | {"not_flown": dict(refused), "tasks": tasks}


def write_contact(found: Mapping[str, Any], folder: Path) -> None:
    """Write every file of the folder but its cells."""
    write_atomically(folder / "contact.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_atomically(folder / "contact.csv", contact_csv(found).encode())
    write_atomically(folder / "tables.md", contact_report(found).encode())
    write_atomically(folder / "report.html", contact_page(found, _pictures(found, folder)).encode())


def _pictures(found: Mapping[str, Any], folder: Path) -> dict[str, bytes]:
    """PNG of each task that has one."""
    return {name: (folder / told["picture"]).read_bytes() for name, told in found.get("shown", {}).items()}


SAID = ("worlds", "seed", "plant")
"""What a suite and its record have in common."""
