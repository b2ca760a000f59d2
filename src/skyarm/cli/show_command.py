"""Command ``skyarm show``: list what ships, a vehicle's parameters with units, or a
flight's measured quantities.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import (
    OptionalOut,
    name_completion,
    require_left_out,
    require_not_another,
    shipped_names,
)
from skyarm.cli.lines import say_unlikely
from skyarm.cli.output import bar, console, give, is_document_wanted, tell
from skyarm.control.catalogue import AUTOPILOTS, LAWS, PRESETS, tuned_factors
from skyarm.dynamics.actuators import AllocationError
from skyarm.plant.interface import require_gravity
from skyarm.plant.mujoco_reading import COLUMNS, beside_mujoco
from skyarm.records.files import errors_as, number, read_toml
from skyarm.records.registry.registrations import function_of_option
from skyarm.scenario.scenario_file import kind_of_file, list_scenarios, load_scenario
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
from skyarm.studies.assess.data_sheet import sheet, vehicle_facts
from skyarm.studies.sweep.study_file import LIBRARY as STUDIES
from skyarm.studies.sweep.study_file import list_studies
from skyarm.vehicle.vehicle_files import (
    FOREIGN,
    ROTORS_ALONE,
    list_vehicles,
    load_vehicle,
)
from skyarm.vehicle.vehicle_tables import RIGID
from skyarm.view.pages import Facts, table_of

OPTIONS = ("--gravity", "--out", "--vehicle", "--columns", "--compare")
"""Options of a vehicle or a flight, of which what ships, the grammar of a file and a
suite have none."""


def show(
    shown: Annotated[
        str | None, typer.Argument(autocompletion=name_completion("vehicle"))
    ] = None,
    gravity: float = 9.81,
    drawing: OptionalOut = None,
    vehicle: str | None = None,
    columns: str | None = None,
    compare: bool = False,
) -> None:
    """List what ships, or show a vehicle or a flight.

    Without a vehicle: names and titles of vehicles, scenarios, studies and controllers.
    Of a vehicle: mass, centre of mass, hover speed and thrust margin, arm reach, static
    joint torques of a level base; limits of the joints, inertias, motor constants;
    sources of the numbers.

    Of a measured flight: channels, rates, gaps and clock; with --vehicle its faults,
    and of each number of the vehicle whether the flight excites it. words: the grammar
    of a scenario file.

    Options:
        shown VEHICLE|FLIGHT|words: file or name of a vehicle, or a log; words: keys of
            a scenario file; left out: what ships
        gravity: m/s^2, for hover and static efforts
        drawing FILE: drawing (.png, .svg, .pdf) in place of numbers
        vehicle: with a flight: a vehicle; tells which of its numbers the flight excites
        columns FILE: with a flight: file that says what its columns mean
        compare: of a .urdf or .xml file: what MuJoCo reads in it, beside what is read
            here
    """
    if shown is None:
        require_left_out(
            OPTIONS,
            " without a vehicle or flight",
        )
        return _show_library()
    if shown == WORDS_OF_A_FILE:
        require_left_out(
            OPTIONS,
            " beside words",
        )
        return _show_words()
    if _is_flight(shown):
        require_left_out(["--gravity", "--compare"], " of a flight")
        if drawing is not None:
            require_left_out(
                ["--vehicle"],
                " beside --out, a drawing of the flight's channels alone",
            )
        function_of_option("show FLIGHT")(shown, columns, vehicle, drawing)
        return None
    if kind_of_file(shown) == "suite":
        require_left_out(
            OPTIONS,
            " of a suite",
        )
        return _show_suite(shown)
    require_left_out(["--vehicle", "--columns"], " of a vehicle")
    number(require_gravity(gravity, "--gravity"), "--gravity", low=0.0, strict=True)
    require_not_another(shown, "vehicle")
    if drawing is not None:
        require_left_out(
            ["--gravity", "--compare"],
            " beside --out, a drawing, which shows no numbers of it",
        )
        return _draw(shown, drawing)
    loaded = load_vehicle(shown)
    if compare:
        rows = beside_mujoco(loaded, shown)
        give(
            compare=[
                dict(zip(("quantity", *COLUMNS[1:]), row, strict=True)) for row in rows
            ]
        )
        tell(table_of(COLUMNS, rows, left=len(COLUMNS)))
        return None
    at = f"{shown}: rotors = "
    with (
        errors_as(ValueError, at, of=AllocationError),
        bar(f"{loaded.name}: reach and static efforts"),
    ):
        numbers = vehicle_facts(loaded, gravity)
    say_unlikely(loaded.name, unlikely_in_vehicle(loaded))
    give(numbers)
    # a document has the numbers; the tables would be drawn in vain
    for part in sheet(loaded, numbers) if not is_document_wanted() else ():
        tell(part, "")


def _show_suite(file: str) -> None:
    """Print the trials of a suite, with values and flights."""
    from skyarm.studies.compare.suite_file import load_suite

    suite = load_suite(file)
    head = ("trial", "title", "values", "flights at each", "scenario")
    rows = [
        (
            each.name,
            each.title,
            f"{', '.join(f'{value:g}' for value in each.values)} {each.unit}".rstrip(),
            str(each.flights),
            each.file or "hover",
        )
        for each in suite.trials
    ]
    give(
        title=suite.title,
        laws=list(suite.laws),
        trials=[dict(zip(head, row, strict=True)) for row in rows],
    )
    tell(
        f"{suite.title}; laws {', '.join(suite.laws)}",
        table_of(head, rows, left=len(head)),
    )


WORDS_OF_A_FILE = "words"
"""Argument in place of a vehicle for the grammar of a scenario file."""


def _show_words() -> None:
    """Print the keys of a scenario file with units, bounds and meanings."""
    from skyarm.scenario.grammar import grammar, without_links

    rows = [without_links(row) for row in grammar()]
    give(words=[row._asdict() for row in rows])
    columns = ("word", "of kind", "entry", "unit", "allowed", "varies", "meaning")
    lines = [
        (row.path, row.of, row.entry, row.unit, row.bounds, row.varies, row.meaning)
        for row in rows
    ]
    if is_document_wanted():
        return
    if console.is_terminal:
        tell(table_of(columns, lines, left=len(columns)))
    else:  # read by other programs: a line a word, bars between its columns
        tell(*map(" | ".join, (columns, *lines)))


def _is_flight(name: str) -> bool:
    """True for the path of a file or folder that is not a vehicle model."""
    path = Path(re.sub(r"#\d+$", "", name))  # of FILE#2, the second flight of a file
    if (
        not name
        or path.suffix in (".toml", *ROTORS_ALONE, *RIGID, *FOREIGN)
        or name in list_vehicles()
    ):
        return False
    return path.is_file() or path.is_dir()


def _draw(name: str, file: str) -> None:
    """Write the labelled drawing of a vehicle to a file."""
    from skyarm.records.files.names import picture_file
    from skyarm.view.figures.style import save_picture
    from skyarm.view.figures.vehicle_drawing import vehicle_drawing

    target, loaded = picture_file(file, "--out"), load_vehicle(name)
    save_picture(vehicle_drawing(loaded), target)
    give(drawing=target)
    tell(f"drawing: {target}", *loaded.missing_meshes)


def contents() -> Facts:
    """List the shipped vehicles, scenarios, studies and controllers as plain data."""
    from skyarm.planning.task import load_task

    vehicles = {name: load_vehicle(name) for name in list_vehicles()}
    # a study's title alone: reading the study would read its scenario, too
    studies = {
        name: read_toml((STUDIES / f"{name}.toml").read_bytes())
        for name in list_studies()
    }
    return {
        "schema": 1,
        "vehicles": [
            {
                "name": name,
                "mass_kg": float(v.mass),
                "rotors": len(v.rotors),
                "joints": v.n,
                "flies": not v.planar,
            }
            for name, v in vehicles.items()
        ],
        "scenarios": [
            {"name": name, "title": load_scenario(name).title}
            for name in list_scenarios()
        ],
        "studies": [
            {"name": name, "title": str(table.get("title", ""))}
            for name, table in studies.items()
        ],
        "tasks": [
            {"name": name, "vehicle": load_task(name).vehicle.name}
            for name in shipped_names("task")
        ],
        "presets": [
            {"name": name, "title": each.title, "law": each.law}
            for name, each in PRESETS.items()
        ],
        "laws": [
            {
                "name": name,
                "title": each.title,
                "options": list(each.options()),
                "tuned": name in tuned_factors(),
            }
            for name, each in LAWS.items()
        ],
        "autopilots": [
            {"name": name, "title": each.title, "options": list(each.options())}
            for name, each in AUTOPILOTS.items()
        ],
    }


def _show_library() -> None:
    library = contents()
    give(library)
    rows = []
    for each in library["vehicles"]:
        name = each["name"] if each["flies"] else f"{each['name']} (model only)"
        rows.append(
            (name, f"{each['mass_kg']:.3f}", str(each["rotors"]), str(each["joints"]))
        )
    tell(table_of(("vehicle", "mass, kg", "rotors", "joints"), rows))
    tell(
        "",
        table_of(
            ("task (skyarm plan NAME)", "vehicle"),
            [tuple(each.values()) for each in library["tasks"]],
            left=2,
        ),
    )
    for head, kind in (
        ("scenario", "scenarios"),
        ("study (skyarm sweep NAME)", "studies"),
        ("controller preset", "presets"),
        ("control law (+: LAW_tuned, too)", "laws"),
        ("autopilot (skyarm run --autopilot NAME)", "autopilots"),
    ):
        named = [
            (each["name"] + (" +" if each.get("tuned") else ""), each["title"])
            for each in library[kind]
        ]
        tell("", table_of((head, "what"), named, left=2))
