"""Rotors of a vehicle file: its own ``[[rotors]]``, and those of the file it names,
which ``[[rotors]]`` complete.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from itertools import chain
from typing import Any, get_args

from skyarm.algebra import Vec3
from skyarm.records.files import Fields, errors_as
from skyarm.records.immutable import positional
from skyarm.records.read_table import numbers_from, record_from
from skyarm.vehicle import description
from skyarm.vehicle.attach import RigidBodies, place_in
from skyarm.vehicle.check import VehicleError, refuse, unique
from skyarm.vehicle.held_joints import hold_joints
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.stated_rotors import (
    LAGS,
    MAX_THRUST,
    NEEDED_OF_TILTS,
    StatedRotor,
    gaps_of,
    whole_values,
)
from skyarm.vehicle.thrust_table import ThrustTable
from skyarm.vehicle.tilt import Tilt, arm_direction
from skyarm.vehicle.vehicle_records import Rolling, Rotor

COEFFICIENTS = ("thrust_coefficient", "moment_coefficient")

SENSES = {"ccw": 1, "cw": -1}
"""Word of a vehicle file -> direction of a rotor, seen against its thrust."""


def coefficients_of(table: ThrustTable) -> tuple[str, ...]:
    """Names of the coefficients that follow from a thrust table."""
    # without torque data the drag torque needs a stated coefficient
    return COEFFICIENTS if table.torque else COEFFICIENTS[:1]


ROUNDED = 0.01
"""Relative difference below which a largest thrust agrees with coefficient and speed:
data sheets round."""

Values = Mapping[str, Any]


@positional
class RotorTables:
    """``[rotor_defaults]`` and ``[[rotors]]`` of a vehicle file, as read.

    Attributes:
        whole: every rotor states all that a real one has; a number that it leaves out
            is a gap, without a default.
        usual: values of rotors that state none.
        own: values by name: fields of a rotor, ``max_thrust``, ``link`` and ``tilt``.
        tables: the tables themselves by name, for messages.
    """

    whole: bool = False
    usual: Values = field(default_factory=dict)
    own: Mapping[str, Values] = field(default_factory=dict)
    tables: Mapping[str, Fields] = field(default_factory=dict)


@positional
class MountedRotors:
    """Rotors on the base of a vehicle, with the bodies whose joints the rotors' own are
    no part of.

    Attributes:
        bodies: bodies without the joints that only spin rotors.
        rotors: whole rotors. gaps: a line for each group of rotors that a file states
            and that lack numbers.
        sources: (field, where it stood) pairs. notes: what was left out.
    """

    bodies: RigidBodies
    rotors: tuple[Rotor, ...] = ()
    gaps: tuple[str, ...] = ()
    sources: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()


def read_rotor_tables(top: Fields, tilting: bool = False) -> RotorTables:
    """Read ``[rotor_defaults]`` and ``[[rotors]]`` of a vehicle file; ``tilting``: they
    may complete a file's tilts.
    """
    inner = top.inner("rotor_defaults")
    usual = _values(inner, tilting)
    whole = inner.flag("all_stated", False)
    inner.done()
    own = {}
    tables = top.tables("rotors")
    unique("rotors.name", [each.text("name") for each in tables])
    for fields in tables:
        values = _values(fields, tilting)
        if fields.states("position"):
            values["position"] = description.vector(fields.vector("position"))
        if fields.states("direction"):
            values["direction"] = SENSES[fields.choice("direction", tuple(SENSES))]
        if fields.states("link"):
            values["link"] = fields.text("link")
        fields.done()
        own[fields.text("name")] = values
    return RotorTables(whole, usual, own, {each.text("name"): each for each in tables})


def _with_shields(
    rotors: Sequence[Rotor], tables: RotorTables, stated: Sequence[StatedRotor]
) -> tuple[tuple[Rotor, ...], RotorTables]:
    """Rotors of an airframe with the shields of ``[[rotors]]`` of their names, and the
    other tables.

    Raises:
        VehicleError: such a table changes more than the shield, or defaults complete
            neither another table nor a rotor that a file states.
    """
    own = dict(tables.own)
    shields = {each.name: own.pop(each.name) for each in rotors if each.name in own}
    for name, values in shields.items():
        if [*values] != ["shield"]:
            allowed = "must be shield alone, for the airframe states the rest"
            refuse(f"rotors[{name}]", sorted(values), allowed)
    if rotors and tables.usual and not (own or stated):
        allowed = "must be left out: the rotors of the airframe are whole"
        refuse("rotor_defaults", ", ".join(tables.usual), allowed)
    fitted = [replace(each, **shields.get(each.name, {})) for each in rotors]
    left = {name: each for name, each in tables.tables.items() if name in own}
    return tuple(fitted), replace(tables, own=own, tables=left)


def _values(fields: Fields, tilting: bool) -> dict[str, Any]:
    """Read the stated fields of one rotor, or those of [rotor_defaults]."""
    values: dict[str, Any] = dict(numbers_from(Rotor, fields, partial=True))
    values |= _axis(fields)
    for name, read in (
        ("reversible", fields.flag),
        ("rolling", partial(fields.choice, options=get_args(Rolling))),
        ("shield", fields.numbers),
    ):
        if fields.states(name):
            values[name] = read(name)
    if fields.take(MAX_THRUST, None) is not None:
        values[MAX_THRUST] = fields.number(MAX_THRUST, low=0.0, strict=True)
    if fields.states("thrust_table"):
        values["table"] = record_from(ThrustTable, fields.inner("thrust_table"))
    if fields.states("tilt"):
        inner = fields.inner("tilt")
        values["tilt"] = {**numbers_from(Tilt, inner, partial=tilting), **_axis(inner)}
        inner.done()
    return values


def _axis(fields: Fields) -> dict[str, Vec3]:
    """Read the axis of a rotor or tilt; empty if the table states none."""
    if not fields.states("axis"):
        return {}
    return {"axis": description.unit_axis(fields.at("axis"), fields.vector("axis"))}


def mount_rotors(
    bodies: RigidBodies, tables: RotorTables, carried: Sequence[Rotor] = ()
) -> MountedRotors:
    """Rotors of a vehicle: those of the file that describes the bodies, completed by
    the vehicle file's own tables.

    ``[[rotors]]`` that name rotors of the file complete these; if none of them does,
    they stand in place of all.

    Args:
        bodies: bodies, with the rotors that their file states.
        tables: tables of the vehicle file.
        carried: rotors of the airframe, which come first.

    Raises:
        VehicleError: a number is missing where the tables speak of rotors, or a rotor
            rides on a link that moves.
    """
    carried, tables = _with_shields(carried, tables, bodies.rotors)
    stated = {each.name: _at_mass(bodies, each) for each in bodies.rotors}
    # a mistyped name must not silently turn completed rotors into a whole set of new
    # ones
    strange = [name for name in tables.own if name not in stated]
    if strange and len(strange) < len(tables.own):
        refuse(
            "rotors.name",
            strange[0],
            f"must be one of {', '.join(stated)}, or none of the entries may name one",
        )
    notes = list[str]()
    if strange and stated:
        notes.append(
            f"rotors {', '.join(stated)} of the file: left out; [[rotors]] states"
            " all of the vehicle's"
        )
    whole = {} if strange else stated
    origins = whole or {
        name: StatedRotor(name=name, link=each.get("link", "base"))
        for name, each in tables.own.items()
    }
    values = {
        # the vehicle file's own number wins over the robot's, and that over
        # [rotor_defaults]
        name: _merge(
            tables.usual,
            {**_spin(bodies, origin), **origin.values},
            tables.own.get(name, {}),
        )
        for name, origin in origins.items()
    }
    for name, origin in whole.items():
        _require_numbers(origin, values[name])
    notes += _notes(whole, lambda name: _default_words(whole[name]))
    notes += _notes(origins, lambda name: _other_thrust(origins[name], values[name]))
    still = _without_spin(bodies, (*stated.values(), *origins.values()))
    # a joint with limits that moves a rotor's link may be meant as a tilt, so its
    # holding is noted
    of_arm = {each.joint or _joint_of(bodies, each.link) for each in origins.values()}
    for joint in (each.joint for each in bodies.links if each.joint.name in of_arm):
        if any(map(math.isfinite, joint.ends)):
            notes.append(
                f"joint {joint.name}: held although it has limits, for it moves the"
                " link of a rotor"
            )
    gaps = tuple(_gaps(still, origins if tables.whole else whole, values))
    # without tables the file is only looked at, so gaps stay a property of the vehicle
    if gaps and (tables.own or tables.usual):
        raise VehicleError(gaps[0])
    # taken once more, so that what is missing is refused with the field's name
    for name, fields in tables.tables.items() if not whole else ():
        for needed in (
            "direction",
            *(() if "link" in tables.own[name] else ("position",)),
        ):
            fields.take(needed)
        for needed in NEEDED_OF_TILTS if "tilt" in values[name] else ():
            if needed not in values[name]["tilt"]:
                fields.inner("tilt").take(needed)
    made = [] if gaps else [_rotor(still, origins[n], values[n]) for n in origins]
    sources = dict.fromkeys(
        (f"rotors.{word}", text)
        for each in whole.values()
        for word, text in each.where.items()
    )
    for lag in LAGS if made else ():
        # a default of the library for a lag is named among the sources, so nobody takes
        # it for measured
        if not any(lag in each for each in values.values()):
            sources[f"rotors.{lag}", "assumed: the file states none"] = None
    every = (*carried, *made)
    return MountedRotors(still, every, gaps, tuple(sources), tuple(notes))


def without_rotors(bodies: RigidBodies) -> RigidBodies:
    """Bodies of an arm whose file states rotors, without these: their joints are held,
    with a note.
    """
    if not bodies.rotors:
        return bodies
    note = (
        f"rotors {', '.join(each.name for each in bodies.rotors)}: left out; those of"
        " the airframe fly"
    )
    return replace(
        _without_spin(bodies, bodies.rotors), rotors=(), notes=(*bodies.notes, note)
    )


def _without_spin(bodies: RigidBodies, rotors: Iterable[StatedRotor]) -> RigidBodies:
    """Bodies in which the joints that spin or tilt rotors are held."""
    rotors = tuple(rotors)
    spinning = {each.joint or _joint_of(bodies, each.link) for each in rotors} | {
        each.tilt_joint for each in rotors
    }
    # sorted, because a set's order would change the frames from run to run
    return hold_joints(bodies, dict.fromkeys(sorted(spinning - {""}), 0.0))


def _merge(usual: Values, stated: Values, own: Values) -> dict[str, Any]:
    """Values of a rotor: usual ones, those of another file, the rotor's own; these
    complete the tilt of the file.
    """
    merged = {**usual, **stated, **own}
    # tilts are merged field by field: a user completes the lag of a servo whose range
    # the file has
    if "tilt" in stated:
        merged["tilt"] = {
            **usual.get("tilt", {}),
            **stated["tilt"],
            **own.get("tilt", {}),
        }
    return merged


def _joint_of(bodies: RigidBodies, link: str) -> str:
    """Joint that moves a link of the bodies; "" for the base, a frame and an unknown
    name.
    """
    return next((each.joint.name for each in bodies.links if each.name == link), "")


def _at_mass(bodies: RigidBodies, rotor: StatedRotor) -> StatedRotor:
    """Rotor whose place is the centre of mass of its moving link, where its simulator
    pushes there.
    """
    seat = place_in(bodies, rotor.link, f"rotors[{rotor.name}].link")
    if not rotor.at_mass or seat.link == BASE:
        return rotor
    return replace(
        rotor,
        position=seat.rotation.apply_T(
            bodies.links[seat.link].body.com - seat.position
        ),
    )


def _spin(bodies: RigidBodies, rotor: StatedRotor) -> Values:
    """Inertia of what turns about a rotor's axis, kg m^2, from the link that its joint
    spins.
    """
    # what the joint spins, seen about its axis; the simulator's slow-down is taken out
    for link in bodies.links:
        if rotor.joint and link.joint.name == rotor.joint:
            axis = link.joint.axis
            inertia = float(axis.dot(link.body.inertia.apply(axis))) / rotor.slower
            return {"inertia": description.zero_is_structure(inertia)}
    return {}


def _require_numbers(rotor: StatedRotor, values: Values) -> None:
    """Raise an error for a number of a file that no rotor can have, also where it lacks
    others.
    """
    for name, source in rotor.where.items():
        stated = Fields({name: values.get(name)}, f"rotors[{rotor.name}]")
        with errors_as(VehicleError, f"{source}: "):
            numbers_from(Rotor, stated, partial=True)
            # 1 N, which passes, stands for none stated
            stated.number(MAX_THRUST, 1.0, low=0.0, strict=True)


def _gaps(
    bodies: RigidBodies, rotors: Mapping[str, StatedRotor], values: Mapping[str, Values]
) -> Iterator[str]:
    """Lines on what the rotors of a file lack: the rotors, the missing fields and where
    to state them.

    Rotors that ride on joints stand last.
    """
    below = {
        name: _joints_below(bodies, name, values[name].get("link", rotor.link))
        for name, rotor in rotors.items()
    }

    def words_of(name: str) -> str:
        if below[name]:
            return _rides_on([*chain.from_iterable(below.values())])
        lacks = ", ".join(gaps_of(rotors[name], values[name]))
        cure = "state them in [rotor_defaults], or in [[rotors]] with the rotor's name"
        return f"the file states no {lacks}; {cure}" if lacks else ""

    return _notes(sorted(rotors, key=lambda name: bool(below[name])), words_of)


def joints_below_rotors(bodies: RigidBodies) -> list[str]:
    """Names of the joints that move the rotors of a file, without those that spin or
    tilt them.
    """
    still = _without_spin(bodies, bodies.rotors)
    below = [_joints_below(still, each.name, each.link) for each in bodies.rotors]
    return list(dict.fromkeys(chain.from_iterable(below)))


def _joints_below(bodies: RigidBodies, rotor: str, link: str) -> list[str]:
    """Names of the joints that move the link or frame of a rotor, the base's first;
    none if the base carries it.
    """
    at = place_in(bodies, link, f"rotors[{rotor}].link").link
    joints = list[str]()
    while at != BASE:
        joints.insert(0, bodies.links[at].joint.name)
        at = bodies.links[at].parent
    return joints


def _notes(rotors: Iterable[str], words_of: Callable[[str], str]) -> Iterator[str]:
    """Notes on rotors, those of the same words in one line; none of empty words."""
    alike: dict[str, list[str]] = {}
    for name in rotors:
        alike.setdefault(words_of(name), []).append(name)
    return (
        f"rotors {', '.join(names)}: {words}" for words, names in alike.items() if words
    )


def _default_words(rotor: StatedRotor) -> str:
    """Words on what the file of a rotor leaves to its simulator."""
    words = ", ".join(rotor.assumed)
    return (
        f"the file states no {words}: the default of its plugin flies" if words else ""
    )


def _other_thrust(rotor: StatedRotor, values: Values) -> str:
    """Words on a largest thrust of the file that its user's coefficient and speed
    contradict; refused of the user's.
    """
    try:
        given = values[MAX_THRUST]
        follows = values["thrust_coefficient"] * values["max_speed"] ** 2
    except KeyError:
        return ""
    # data sheets round both numbers, so a percent is agreement
    if math.isclose(given, follows, rel_tol=ROUNDED):
        return ""
    # only the user's own number can be taken back
    if given != rotor.values.get(MAX_THRUST):
        words = (
            "must be left out beside thrust_coefficient and max_speed, which give"
            f" {follows:.3g} N"
        )
        refuse(f"rotors[{rotor.name}].{MAX_THRUST}", given, words)
    return (
        f"{given:g} N at most in the file: thrust_coefficient and max_speed give"
        f" {follows:.3g} N, which fly"
    )


def _rides_on(joints: Sequence[str]) -> str:
    """Words on joints that move a rotor, and how to hold them."""
    first, *others = dict.fromkeys(joints)
    hold = f'[[joints]] name = "{first}", hold = 0.0 (rad or m, yours to choose'
    if not others:
        return f"ride on a link that joint {first} moves; hold it: {hold})"
    moving = ", ".join((first, *others))
    up = "such that all thrusts together point up, which 0 everywhere need not do"
    return (
        f"ride on links that joints {moving} move; hold each at an angle for flight:"
        f" {hold}, {up})"
    )


def _rotor(bodies: RigidBodies, origin: StatedRotor, values: Values) -> Rotor:
    """Rotor in base axes from its place on a link and its values; fields that none
    states get their defaults.
    """
    where = f"rotors[{origin.name}]"
    values = whole_values(values)
    link = values.pop("link", None)
    seat = place_in(bodies, link or origin.link, f"{where}.link")
    # a place from the vehicle file counts from the base, one of the robot's file from
    # its link
    of_base = place_in(bodies, link or "base", f"{where}.link")
    if seat.link != BASE:
        refuse(
            f"{where}.link",
            seat.name,
            f"must be fixed to the base; joint {bodies.links[seat.link].joint.name}"
            " moves it",
        )
    place, hub = (
        (of_base, values.pop("position"))
        if "position" in values
        else (seat, origin.position)
    )
    position = description.vector(place.position + place.rotation.apply(hub))
    place, axis = (
        (of_base, values.pop("axis")) if "axis" in values else (seat, origin.axis)
    )
    thrust_axis = description.unit_axis(f"{where}.axis", place.rotation.apply(axis))
    table: ThrustTable | None = values.get("table")
    if table is not None:
        # two statements of one coefficient could disagree
        for needed in coefficients_of(table):
            if needed in values:
                refuse(
                    f"{where}.{needed}",
                    values[needed],
                    "must be left out: it follows from thrust_table",
                )
            values[needed] = getattr(table, needed)
        # beyond the last measured speed the table only extrapolates
        values.setdefault("max_speed", table.speed[-1])
    for needed in COEFFICIENTS:
        if needed not in values:
            raise VehicleError(
                f"{where}.{needed}: is missing: must stand here or in rotor_defaults"
            )
    if "tilt" in values:
        turning = values["tilt"].get("axis") or arm_direction(
            f"{where}.tilt", position, thrust_axis
        )
        values["tilt"] = Tilt(**values["tilt"] | {"axis": turning})
    return Rotor(name=origin.name, position=position, axis=thrust_axis, **values)
