"""The pages of the API, one for each room that has public names, written by the site's
builder from docstrings.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from api_examples import shown_example

import skyarm
from skyarm.log.metrics.metric_catalogue import GROUPS, measures
from skyarm.records.registry.registrations import KINDS, registrations

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "src" / "skyarm"

ROOMS = {
    "vehicle": "Vehicles",
    "dynamics": "Dynamics",
    "algebra": "Vectors, rotations and random numbers",
    "scenario": "Scenarios",
    "reference": "References",
    "world": "Air, contact, forces and faults",
    "sensing": "Sensors and estimators",
    "control": "Control laws",
    "plant": "Plants",
    "planning": "Planning",
    "simulate": "Flying",
    "log": "Logs and metrics",
    "flight_data": "Measured flights",
    "view": "Pictures",
    "identify": "Identification",
    "studies": "Sweeps, comparisons, gains and margins",
    "paper": "The paper",
    "records": "Adding to the library",
}
"""Room -> heading of its page."""


def homes() -> dict[str, tuple[str, ...]]:
    """Public names of each room by their full path."""
    found: dict[str, list[str]] = {}
    for name in skyarm.__all__:
        if name == "__version__":
            continue
        thing = getattr(skyarm, name)
        if inspect.ismodule(thing):
            # a room whose functions are named with it, as their names are taken
            found.setdefault(name, []).extend(
                f"{thing.__name__}.{each}" for each in thing.__all__
            )
            continue
        module, called = thing.__module__, getattr(thing, "__qualname__", name)
        if name == "register":
            module, called = "skyarm.records.registry.registrations", "register"
        found.setdefault(module.split(".")[1], []).append(f"{module}.{called}")
    return {
        room: tuple(sorted(set(paths), key=str.lower)) for room, paths in found.items()
    }


def reference_pages() -> dict[str, str]:
    """Markdown of each page by its name on the site."""
    rooms = homes()
    strangers = set(rooms) - set(ROOMS)
    if strangers:
        raise ValueError(
            "rooms without a heading in site_reference.ROOMS:"
            f" {', '.join(sorted(strangers))}"
        )
    pages = {}
    listed = [
        "# API",
        "",
        (
            "Every public name of `skyarm`, by room. Arrays in, arrays out; SI units"
            " and radians;"
        ),
        "",
    ]
    listed[2] += " quaternions wxyz, body to world."
    for room, title in ROOMS.items():
        if room not in rooms:
            continue
        names = ", ".join(
            f"[`{path.rpartition('.')[2]}`]({room}.md#{path})" for path in rooms[room]
        )
        listed.append(f"* [{title}]({room}.md): {names}")
        parts = [f"# {title}", shown_example(room)]
        for path in rooms[room]:
            # named with its room, and shown in the room's example
            of_room = path.count(".") == 2
            parts += [
                f"::: {path}",
                "" if of_room else shown_example(path.rpartition(".")[2]),
            ]
        pages[f"api/{room}.md"] = "\n\n".join(part for part in parts if part) + "\n"
    listed.append("* [Every name in a file](names.md): kinds, metrics, files that ship")
    pages["api/index.md"] = "\n".join(listed) + "\n"
    pages["api/names.md"] = names_page()
    return pages


def names_page() -> str:
    """Markdown of the page that lists what a file or a command may name."""
    groups = {f"`{kind}`": tuple(registrations(kind)) for kind in sorted(KINDS)}
    groups |= {
        "metric of an arm of two joints, or group": (*measures(2), *GROUPS),
        "file that ships": tuple(
            sorted({path.stem for path in LIBRARY.rglob("*.toml")})
        ),
        "target of `make`": tuple(
            re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text("utf-8"), re.M)
        ),
    }
    rows = [
        f"| {what} | {', '.join(f'`{name}`' for name in names)} |"
        for what, names in groups.items()
    ]
    return "\n".join(
        ["# Every name in a file", "", "| what | names |", "|-|-|", *rows, ""]
    )
