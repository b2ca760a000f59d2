"""What was flown by hand, written as a scenario that flies it again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from skyarm.files import require_writable, write_atomically
from skyarm.files.toml import toml_text
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.studio.documents import flown_document
from skyarm.studio.fleet import Fleet
from skyarm.studio.flight import Flight, as_changes


def saved_document(fleet: Fleet, flight: Flight, folder: Path) -> dict[str, Any]:
    """Tables of a scenario that 'skyarm run' flies to the bits of a flight, up to where it is now.

    Args:
        fleet: of the flight.
        flight: one of its.
        folder: where the file will lie.

    Raises:
        ScenarioError: nothing has been flown yet.
    """
    if not flight.tick:
        raise ScenarioError("time = 0 s: must be above 0; nothing has been flown yet that could be saved")
    # a vehicle that is lost is lost again in the period after its last one
    ticks = flight.tick + (1 if flight.lost else 0)
    moved = [each for each in flight.moved if each.tick < flight.tick]
    paths = {each.path for each in moved}
    document = flown_document(fleet.prepared, flight.law, ticks / fleet.rate, paths, folder)
    document["name"] = f"{fleet.prepared.scenario.name}_{flight.title}"
    document["title"] = f"{fleet.prepared.scenario.title or fleet.prepared.scenario.name}, flown by hand"
    # those of the file first: of one period they take hold before a hand moves anything
    changes = [*(each for each in document.pop("changes", ()) if each["at"] < document["duration"])]
    changes += as_changes(moved, fleet.rate)
    return {**document, "changes": changes} if changes else document


def save_flights(fleet: Fleet, folder: Path) -> str:
    """Write a scenario for each flight beside those that are there; returns how to fly them, in words.

    Raises:
        ScenarioError: nothing has been flown yet. OSError: a file cannot be written.
    """
    require_writable(str(folder))
    written = []
    for flight in fleet.flights:
        document = saved_document(fleet, flight, folder)
        file = _free(folder, document["name"])
        write_atomically(file, toml_text(document).encode())
        written.append(f"skyarm run {file}")
    return "saved; fly it again: " + ", ".join(written)


def _free(folder: Path, name: str) -> Path:
    """A name that no file has yet."""
    found, number = folder / f"{name}.toml", 0
    while found.exists():
        number += 1
        found = folder / f"{name}_{number}.toml"
    return found
