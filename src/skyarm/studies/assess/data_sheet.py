"""Data sheet of a vehicle as plain data and as tables: mass, hover, reach, static
efforts, joints, rotors, battery.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from skyarm.dynamics.actuators.hover import highest_thrust, hover_trim
from skyarm.dynamics.array_front import center_of_mass
from skyarm.dynamics.workspace import MANY, reach, samples_of, static_torques
from skyarm.records.leaves import Dataclass, Tree, field_names, walk
from skyarm.records.plain import Plain
from skyarm.records.text_tables import NOTHING, shown_number
from skyarm.records.units import units
from skyarm.vehicle import BASE, Vehicle
from skyarm.view.pages import Facts, Table, table_of


def vehicle_facts(vehicle: Vehicle, gravity: float) -> Facts:
    """Facts of a vehicle as plain data: mass, hover, reach, static efforts, joints,
    bodies and sources.

    Raises:
        AllocationError: the rotors cannot be mixed.
    """
    level = [1.0, 0.0, 0.0, 0.0]
    com = center_of_mass(vehicle, [0.0, 0.0, 0.0], level, vehicle.zeros)
    facts: Facts = {
        "vehicle": vehicle.name,
        "gravity_m_s2": gravity,
        "mass_kg": float(vehicle.mass),
        "centre_of_mass_m": [float(each) for each in com],
        "flies": not vehicle.planar,
        "frames": [frame.name for frame in vehicle.frames],
        "tip": vehicle.end_effector or None,
        "rotors": [rotor.name for rotor in vehicle.rotors],
        "tilts": {
            rotor.name: record_facts(rotor.tilt)
            for rotor in vehicle.rotors
            if rotor.tilt is not None
        },
        "joints": [record_facts(joint) for joint in vehicle.joints],
        "drives": [
            {
                "joint": each.name,
                "drive": type(each.drive).__name__,
                **record_facts(each.drive),
            }
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
        "shapes": [
            {
                "name": each.name,
                # links are numbered from BASE, which is -1: the base is the first of
                # the bodies
                "body": _bodies(vehicle)[each.link - BASE],
                "shape": each.shape,
                "size_m": [float(length) for length in each.size],
                "corners": len(each.vertices),
            }
            for each in vehicle.shapes
        ],
        "hover": _hover(vehicle, gravity) if vehicle.rotors else None,
        "reach_m": None,
        "static_efforts": {},
        "sources": dict(vehicle.sources),
        "notes": list(vehicle.notes),
        "gaps": list(vehicle.gaps),
    }
    if vehicle.links:
        efforts = map(float, static_torques(vehicle, gravity))
        facts["static_efforts"] = dict(zip(vehicle.joint_names, efforts, strict=True))
        facts["static_efforts_over_all_joint_values"] = vehicle.n <= MANY
        if vehicle.end_effector and vehicle.frame().link != BASE:
            facts["reach_m"] = float(reach(vehicle))
    return facts


def record_facts(record: Dataclass) -> Facts:
    """Convert a dataclass with numbers to a dictionary for JSON."""
    return {
        name: _plain(getattr(record, name)) for name in field_names(type(record)) or ()
    }


def _plain(value: Any) -> Plain:
    # vectors first: they are records of x, y and z, too, and become lists
    if isinstance(value, tuple) or hasattr(value, "dot"):
        return [float(each) for each in value]
    if field_names(type(value)):
        return record_facts(value)
    return value if isinstance(value, str | int | float) else float(value)


def _hover(vehicle: Vehicle, gravity: float) -> Facts:
    trim = hover_trim(vehicle, vehicle.zeros, gravity)
    level = trim.needs_no_pull
    return {
        "possible": (
            level
            and all(
                w <= r.max_speed
                for w, r in zip(trim.speeds, vehicle.rotors, strict=True)
            )
        ),
        "rotor_speeds_rad_s": (
            [float(speed) for speed in trim.speeds] if level else None
        ),
        "thrust_N": float(trim.thrust),
        "highest_thrust_N": float(highest_thrust(vehicle)),
    }


def sheet(vehicle: Vehicle, known: Facts) -> list[Table]:
    """Make the data sheet of a vehicle as tables: totals, joints, bodies, rotors,
    battery and sources.
    """
    sections: dict[str, Mapping[str, Dataclass]] = {
        "joints": {joint.name: joint for joint in vehicle.joints},
        "drives: what the joints take in place of a torque": {
            each.name: each.drive for each in vehicle.drives
        },
        "bodies, inertia about the centre of mass": dict(
            zip(_bodies(vehicle), vehicle.bodies, strict=True)
        ),
        "rotors": {rotor.name: rotor for rotor in vehicle.rotors},
        "servos that turn rotors, at rest at 0 rad": {
            r.name: r.tilt for r in vehicle.rotors if r.tilt is not None
        },
        "battery": {} if vehicle.battery is None else {"": vehicle.battery},
    }
    title = f"{vehicle.name}, g = {known['gravity_m_s2']:g} m/s^2, arm at zero"
    tables = [table_of(("", ""), _whole(vehicle, known), left=2, title=title)]
    for title, records in sections.items():
        kinds = dict.fromkeys(map(type, records.values()))
        # drives of different kinds have different fields, so each kind has a table
        for kind in kinds:
            heading = f"{title}: {kind.__name__}" if len(kinds) > 1 else title
            tables += _tables(
                heading,
                {name: each for name, each in records.items() if type(each) is kind},
            )
    if known["shapes"]:
        rows = [
            (
                each["name"],
                each["body"],
                each["shape"],
                " ".join(shown_number(size, 6) for size in each["size_m"])
                or f"{each['corners']} corners",
            )
            for each in known["shapes"]
        ]
        heads = "", "body", "shape", "size, m"
        tables.append(table_of(heads, rows, left=4, title="shapes that touch"))
    for title, lines in (
        ("gaps: what its rotors lack to fly", vehicle.gaps),
        (
            "notes: what its file says that was left out, or taken in another way",
            vehicle.notes,
        ),
    ):
        if lines:
            tables.append(table_of(("",), zip(lines, strict=True), title=title))
    if vehicle.sources:
        tables.append(table_of(("", ""), vehicle.sources, left=2, title="sources"))
    return tables


APART = ("name", "tilt")
"""Fields that head a row, or have a table of their own."""


def _tables(title: str, records: Mapping[str, Dataclass]) -> Iterator[Table]:
    """Make tables of similar vehicle parts, such as rotors: a column per differing
    field, then the equal fields.
    """
    kind = type(next(iter(records.values())))
    differ: dict[str, list[str]] = {}
    shared: dict[str, str] = {}
    for field in field_names(kind) or ():
        cells = [_cell(getattr(each, field)) for each in records.values()]
        if field in APART or not any(cells):
            continue
        unit = units(kind)[field].unit if field in units(kind) else ""
        label = f"{field.replace('_', ' ')}, {unit}".removesuffix(", ")
        if len(records) > 1 and len(set(cells)) == 1:
            shared[label] = cells[0]
        else:
            differ[label] = cells
    yield table_of(
        ("", *differ), zip(records, *differ.values(), strict=True), title=title
    )
    if shared:
        yield table_of(("", ""), shared.items(), left=2, title="all of them")


def _cell(value: Tree) -> str:
    """Format the numbers of a field for a table cell; an infinite limit becomes
    "none".
    """
    if isinstance(value, str):
        return value
    numbers = [
        float(each)
        for _, each in walk(value)
        if each is not None and not isinstance(each, str)
    ]
    # six digits, chosen
    return " ".join(
        "none" if math.isinf(each) else shown_number(each, 6) for each in numbers
    )


def _whole(vehicle: Vehicle, facts: Facts) -> Iterator[tuple[str, str]]:
    """Yield name and text of each property of a whole vehicle: mass, frames, hover,
    reach and static efforts.
    """
    yield "mass", f"{shown_number(facts['mass_kg'], 5)} kg"
    yield (
        "centre of mass from base origin",
        ", ".join(shown_number(1e3 * c) for c in facts["centre_of_mass_m"]) + " mm",
    )
    if vehicle.planar:
        yield "inertia", "planar model: may be the model of a controller, not flown"
    frames = [
        f"{name} (end effector)" if name == vehicle.end_effector else name
        for name in facts["frames"]
    ]
    yield "frames", ", ".join(frames) or "none"
    yield "rotors", ", ".join(facts["rotors"]) or "none"
    hover = facts["hover"]
    if hover and hover["rotor_speeds_rad_s"] is None:
        yield "hover", "not possible level: a rotor would have to pull down"
    elif hover:
        # two decimals: speeds of equal rotors differ by rounding
        speeds = sorted({round(w, 2) for w in hover["rotor_speeds_rad_s"]})
        shown = " ... ".join(f"{w:g}" for w in dict.fromkeys((speeds[0], speeds[-1])))
        beyond = (
            ""
            if hover["possible"]
            else ": not possible, a rotor would have to turn faster than its limit"
        )
        yield "hover rotor speed", f"{shown} rad/s{beyond}"
        top = hover["highest_thrust_N"]
        if top < math.inf:
            ratio = shown_number(top / hover["thrust_N"])
            yield (
                "thrust margin",
                f"{ratio} times its weight ({shown_number(top, 4)} N)",
            )
    if not vehicle.links:
        return
    reached = facts["reach_m"]
    tip = vehicle.end_effector
    none = (
        "none: the end effector is fixed to the base"
        if tip
        else "unknown: no end effector"
    )
    searched = (
        "all joint values"
        if vehicle.n <= MANY
        else f"{samples_of(vehicle.n)} random joint values"
    )
    yield (
        "arm reach from its first joint",
        none if reached is None else f"{shown_number(reached, 4)} m, over {searched}",
    )
    for each in facts["joints"]:
        torque = facts["static_efforts"][each["name"]]
        limit = each["effort_limit"]
        unit = "N m" if each["kind"] == "revolute" else "N"
        margin = f", limit {limit:g} {unit}" if limit < math.inf else ""
        margin += (
            f", margin {limit / torque:.3g}" if margin and torque > NOTHING else ""
        )
        yield (
            f"largest static effort of {each['name']}",
            f"{shown_number(torque)} {unit}{margin}",
        )
    yield "static efforts", f"for a level base, over {searched}"


def _bodies(vehicle: Vehicle) -> tuple[str, ...]:
    """List the names of a vehicle's bodies, base first."""
    return "base", *(link.name for link in vehicle.moving)
