"""Command ``skyarm show``: the library, a vehicle's numbers with their units, or the channels of a flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import RenderableType

from skyarm.cli.arguments import name_completion, out_option, require_left_out, require_not_another
from skyarm.cli.lines import say_unlikely
from skyarm.cli.output import Facts, Lines, bar, console, give, is_document_wanted, table_of, tell
from skyarm.control.catalogue import AUTOPILOTS, LAWS, PRESETS, tuned_factors
from skyarm.dynamics.actuators import AllocationError
from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.dynamics.array_front import center_of_mass
from skyarm.dynamics.workspace import MANY, reach, samples_of, static_torques
from skyarm.plant.interface import require_gravity
from skyarm.records.files import errors_as, number, read_toml
from skyarm.records.leaves import field_names, walk
from skyarm.records.text_tables import NOTHING, shown_number
from skyarm.records.units import units
from skyarm.scenario.scenario_file import list_scenarios, load_scenario
from skyarm.scenario.unlikely_numbers import unlikely_in_vehicle
from skyarm.studies.sweep.study_file import LIBRARY as STUDIES
from skyarm.studies.sweep.study_file import list_studies
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_files import RIGID, list_vehicles, load_vehicle
from skyarm.vehicle.vehicle_records import Vehicle


def show(
    context: typer.Context,
    shown: Annotated[
        str | None,
        typer.Argument(
            metavar="[VEHICLE|FLIGHT|words]",
            help="a vehicle's file or name, or a log; words: of a scenario file; the library if left out",
            autocompletion=name_completion("vehicle"),
        ),
    ] = None,
    gravity: Annotated[float, typer.Option(help="m/s^2")] = 9.81,
    drawing: Annotated[
        str | None, out_option("draw it there (.png, .svg, .pdf) instead, all labelled", "--drawing", metavar="FILE")
    ] = None,
    vehicle: Annotated[
        str | None, typer.Option(help="of a flight: the start of an identification, whose numbers it may excite")
    ] = None,
    columns: Annotated[str | None, typer.Option(metavar="FILE", help="of a flight: what its columns mean")] = None,
) -> None:
    """List what ships, or show a vehicle or a flight.

    Without a vehicle: names and titles of vehicles, scenarios, studies and controllers. Of a vehicle: mass, centre of
    mass, hover speed and thrust margin, arm reach, static joint torques of a level base; limits of the joints,
    inertias, motor constants; sources of the numbers. With --out a picture with frames, senses and lengths.

    Of a measured flight: channels, rates, gaps and clock; with --vehicle its faults, and of each number of the vehicle
    whether the flight excites it. words: the grammar of a scenario file.
    """
    if shown is None:
        require_left_out(context, ["--gravity", "--out", "--vehicle", "--columns"], " without a vehicle or flight")
        return _show_library()
    if shown == WORDS_OF_A_FILE:
        require_left_out(context, ["--gravity", "--out", "--vehicle", "--columns"], " beside words")
        return _show_words()
    if _is_flight(shown):
        from skyarm.cli.flight_page import show_flight

        require_left_out(context, ["--gravity", "--out"], " of a flight")
        return show_flight(shown, columns, vehicle)
    require_left_out(context, ["--vehicle", "--columns"], " of a vehicle")
    number(require_gravity(gravity, "--gravity"), "--gravity", low=0.0, strict=True)
    require_not_another(shown, "vehicle")
    if drawing is not None:
        require_left_out(context, ["--gravity"], " beside --out, a drawing, which shows no numbers of it")
        return _draw(shown, drawing)
    loaded = load_vehicle(shown)
    at = f"{shown}: rotors = "
    with errors_as(ValueError, at, of=AllocationError), bar(f"{loaded.name}: reach and static efforts"):
        known = vehicle_facts(loaded, gravity)
    say_unlikely(loaded.name, unlikely_in_vehicle(loaded))
    give(known)
    for part in sheet(loaded, known) if not is_document_wanted() else ():
        tell(part, "")


WORDS_OF_A_FILE = "words"
"""In the place of a vehicle: the grammar of a scenario file."""


def _show_words() -> None:
    """Print the grammar of a scenario file."""
    from skyarm.scenario.grammar import grammar

    rows = grammar()
    give(words=[row._asdict() for row in rows])
    columns = ("word", "of kind", "entry", "unit", "allowed", "varies", "meaning")
    lines = [(row.path, row.of, row.entry, row.unit, row.bounds, row.varies, row.meaning) for row in rows]
    if is_document_wanted():
        return
    if console.is_terminal:
        tell(table_of(columns, lines, left=len(columns)))
    else:  # read by other programs: a line a word, bars between its columns
        tell(*map(" | ".join, (columns, *lines)))


def _is_flight(name: str) -> bool:
    """True for the path of a file or folder that is no model of a vehicle."""
    path = Path(name)
    if not name or path.suffix in (".toml", ".xacro", *RIGID) or name in list_vehicles():
        return False
    return path.is_file() or path.is_dir()


def _draw(name: str, file: str) -> None:
    """Write the labelled drawing of a vehicle to a file."""
    from skyarm.records.files.names import picture_file
    from skyarm.view.figures.style import save_picture
    from skyarm.view.figures.vehicle_drawing import vehicle_drawing

    target = picture_file(file, "--out")
    save_picture(vehicle_drawing(load_vehicle(name)), target)
    give(drawing=target)
    tell(f"drawing: {target}")


def contents() -> Facts:
    """List the shipped vehicles, scenarios, studies and controllers as plain data."""
    vehicles = {name: load_vehicle(name) for name in list_vehicles()}
    # a study's title alone: reading the study would read its scenario, too
    studies = {name: read_toml((STUDIES / f"{name}.toml").read_bytes()) for name in list_studies()}
    return {
        "schema": 1,
        "vehicles": [
            {"name": name, "mass_kg": float(v.mass), "rotors": len(v.rotors), "joints": v.n, "flies": not v.planar}
            for name, v in vehicles.items()
        ],
        "scenarios": [{"name": name, "title": load_scenario(name).title} for name in list_scenarios()],
        "studies": [{"name": name, "title": str(table.get("title", ""))} for name, table in studies.items()],
        "presets": [{"name": name, "title": each.title, "law": each.law} for name, each in PRESETS.items()],
        "laws": [
            {"name": name, "title": each.title, "options": list(each.options()), "tuned": name in tuned_factors()}
            for name, each in LAWS.items()
        ],
        "autopilots": [
            {"name": name, "title": each.title, "options": list(each.options())} for name, each in AUTOPILOTS.items()
        ],
    }


def _show_library() -> None:
    found = contents()
    give(found)
    rows = []
    for each in found["vehicles"]:
        name = each["name"] if each["flies"] else f"{each['name']} (model only)"
        rows.append((name, f"{each['mass_kg']:.3f}", str(each["rotors"]), str(each["joints"])))
    tell(table_of(("vehicle", "mass, kg", "rotors", "joints"), rows))
    for head, kind in (
        ("scenario", "scenarios"),
        ("study (skyarm sweep NAME)", "studies"),
        ("controller preset", "presets"),
        ("control law (+: LAW_tuned, too)", "laws"),
        ("autopilot (skyarm run --autopilot NAME)", "autopilots"),
    ):
        named = [(each["name"] + (" +" if each.get("tuned") else ""), each["title"]) for each in found[kind]]
        tell("", table_of((head, "what"), named, left=2))


def vehicle_facts(vehicle: Vehicle, gravity: float) -> Facts:
    """Facts of a vehicle as plain data: mass, hover, reach, static efforts, joints, bodies and sources.

    Raises:
        AllocationError: the rotors cannot be mixed.
    """
    zero = tuple(0.0 for _ in vehicle.links)
    com = center_of_mass(vehicle, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], zero)
    found: Facts = {
        "vehicle": vehicle.name,
        "gravity_m_s2": gravity,
        "mass_kg": float(vehicle.mass),
        "centre_of_mass_m": [float(each) for each in com],
        "flies": not vehicle.planar,
        "frames": [frame.name for frame in vehicle.frames],
        "tip": vehicle.end_effector or None,
        "rotors": [rotor.name for rotor in vehicle.rotors],
        "tilts": {rotor.name: record_facts(rotor.tilt) for rotor in vehicle.rotors if rotor.tilt is not None},
        "joints": [record_facts(link.joint) for link in vehicle.links],
        "drives": [
            {"joint": each.name, "drive": type(each.drive).__name__, **record_facts(each.drive)}
            for each in vehicle.drives
        ],
        "battery": None if vehicle.battery is None else record_facts(vehicle.battery),
        "bodies": [
            {
                "name": name,
                "mass_kg": float(body.mass),
                "centre_of_mass_m": _plain(body.com),
                "inertia_kg_m2": record_facts(body.inertia),
            }
            for name, body in zip(_bodies(vehicle), vehicle.bodies, strict=True)
        ],
        "hover": _hover(vehicle, gravity) if vehicle.rotors else None,
        "reach_m": None,
        "static_efforts": {},
        "sources": dict(vehicle.sources),
        "notes": list(vehicle.notes),
    }
    if vehicle.links:
        names = [link.joint.name for link in vehicle.links]
        efforts = map(float, static_torques(vehicle, gravity))
        found["static_efforts"] = dict(zip(names, efforts, strict=True))
        found["static_efforts_over_all_joint_values"] = vehicle.n <= MANY
        if vehicle.end_effector and vehicle.frame().link != BASE:
            found["reach_m"] = float(reach(vehicle))
    return found


def record_facts(record: Any) -> Facts:
    """Convert a dataclass with numbers to a dictionary for JSON."""
    return {name: _plain(getattr(record, name)) for name in field_names(record) or ()}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple) or hasattr(value, "dot"):
        return [float(each) for each in value]
    if field_names(value):
        return record_facts(value)
    return value if isinstance(value, str | int | float) else float(value)


def _hover(vehicle: Vehicle, gravity: float) -> Facts:
    trim = hover_trim(vehicle, tuple(0.0 for _ in vehicle.links), gravity)
    level = all(float(square) >= 0.0 for square in trim.squared)
    return {
        "possible": level and all(w <= r.max_speed for w, r in zip(trim.speeds, vehicle.rotors, strict=True)),
        "rotor_speeds_rad_s": [float(speed) for speed in trim.speeds] if level else None,
        "thrust_N": float(trim.thrust),
        "highest_thrust_N": float(highest_thrust(vehicle)),
    }


def sheet(vehicle: Vehicle, known: Mapping[str, Any]) -> Lines:
    """Make the data sheet of a vehicle as tables: totals, joints, bodies, rotors, battery and sources."""
    sections: dict[str, dict[str, Any]] = {
        "joints": {link.joint.name: link.joint for link in vehicle.links},
        "drives: what the joints take in place of a torque": {each.name: each.drive for each in vehicle.drives},
        "bodies, inertia about the centre of mass": dict(zip(_bodies(vehicle), vehicle.bodies, strict=True)),
        "rotors": {rotor.name: rotor for rotor in vehicle.rotors},
        "servos that turn rotors, at rest at 0 rad": {r.name: r.tilt for r in vehicle.rotors if r.tilt is not None},
        "battery": {} if vehicle.battery is None else {"": vehicle.battery},
    }
    title = f"{vehicle.name}, g = {known['gravity_m_s2']:g} m/s^2, arm at zero"
    tables: Lines = [table_of(("", ""), _whole(vehicle, known), left=2, title=title)]
    for title, records in sections.items():
        kinds = dict.fromkeys(map(type, records.values()))
        for kind in kinds:
            heading = f"{title}: {kind.__name__}" if len(kinds) > 1 else title
            tables += _tables(heading, {name: each for name, each in records.items() if type(each) is kind})
    notes = "notes: what its file says that was left out, or taken in another way"
    tables += [table_of(("",), zip(vehicle.notes, strict=True), title=notes)] if vehicle.notes else []
    return tables + ([table_of(("", ""), vehicle.sources, left=2, title="sources")] if vehicle.sources else [])


APART = ("name", "tilt")
"""Fields that head a row, or have a table of their own."""


def _tables(title: str, records: Mapping[str, Any]) -> Iterator[RenderableType]:
    """Make tables of dataclasses of one class: a column for each field that differs, then the equal fields."""
    kind = type(next(iter(records.values())))
    differ: dict[str, list[str]] = {}
    shared: dict[str, str] = {}
    for field in field_names(kind) or ():
        cells = [_cell(getattr(each, field)) for each in records.values()]
        if field in APART or not any(cells):
            continue
        unit = units(kind)[field].unit if field in units(kind) else ""
        words = f"{field.replace('_', ' ')}, {unit}".removesuffix(", ")
        if len(records) > 1 and len(set(cells)) == 1:
            shared[words] = cells[0]
        else:
            differ[words] = cells
    yield table_of(("", *differ), zip(records, *differ.values(), strict=True), title=title)
    if shared:
        yield table_of(("", ""), shared.items(), left=2, title="all of them")


def _cell(value: Any) -> str:
    """Format the numbers of a field for a table cell; an infinite limit becomes "none"."""
    if isinstance(value, str):
        return value
    numbers = [float(each) for _, each in walk(value) if each is not None and not isinstance(each, str)]
    return " ".join("none" if math.isinf(each) else shown_number(each, 6) for each in numbers)


def _whole(vehicle: Vehicle, known: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield (name, text) of a vehicle's totals: mass, frames, hover, reach and static efforts."""
    yield "mass", f"{shown_number(known['mass_kg'], 5)} kg"
    yield "centre of mass from base origin", ", ".join(shown_number(1e3 * c) for c in known["centre_of_mass_m"]) + " mm"
    if vehicle.planar:
        yield "inertia", "planar model: may be the model of a controller, not flown"
    frames = [f"{name} (end effector)" if name == vehicle.end_effector else name for name in known["frames"]]
    yield "frames", ", ".join(frames) or "none"
    yield "rotors", ", ".join(known["rotors"]) or "none"
    hover = known["hover"]
    if hover and hover["rotor_speeds_rad_s"] is None:
        yield "hover", "not possible level: a rotor would have to pull down"
    elif hover:
        speeds = sorted({round(w, 2) for w in hover["rotor_speeds_rad_s"]})
        shown = " ... ".join(f"{w:g}" for w in dict.fromkeys((speeds[0], speeds[-1])))
        beyond = "" if hover["possible"] else ": not possible, a rotor would have to turn faster than its limit"
        yield "hover rotor speed", f"{shown} rad/s{beyond}"
        top = hover["highest_thrust_N"]
        if top < math.inf:
            ratio = shown_number(top / hover["thrust_N"])
            yield "thrust margin", f"{ratio} times its weight ({shown_number(top, 4)} N)"
    if not vehicle.links:
        return
    reached, tip = known["reach_m"], vehicle.end_effector
    none = "none: the end effector is fixed to the base" if tip else "unknown: no end effector"
    searched = "all joint values" if vehicle.n <= MANY else f"{samples_of(vehicle.n)} random joint values"
    yield (
        "arm reach from its first joint",
        none if reached is None else f"{shown_number(reached, 4)} m, over {searched}",
    )
    for each in known["joints"]:
        torque, limit = known["static_efforts"][each["name"]], each["effort_limit"]
        unit = "N m" if each["kind"] == "revolute" else "N"
        margin = f", limit {limit:g} {unit}" if limit < math.inf else ""
        margin += f", margin {limit / torque:.3g}" if margin and torque > NOTHING else ""
        yield f"largest static effort of {each['name']}", f"{shown_number(torque)} {unit}{margin}"
    yield "static efforts", f"for a level base, over {searched}"


def _bodies(vehicle: Vehicle) -> tuple[str, ...]:
    """List the names of a vehicle's bodies, base first."""
    return "base", *(link.name for link in vehicle.moving)
