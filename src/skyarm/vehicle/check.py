"""Checks of a vehicle: topology, names, and physical consistency of its numbers.

Each message names the field, the value and what is allowed; the file is added by the reader that knows it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from skyarm.algebra import Sym3
from skyarm.records.coerce import TOLERANCE, RecordError, coefficient, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import shown
from skyarm.vehicle import mobility

if TYPE_CHECKING:
    from skyarm.vehicle.attach import RigidBodies
    from skyarm.vehicle.linkage import Body, Follower, Joint
    from skyarm.vehicle.vehicle_records import Vehicle


FARTHEST = 10.0
"""m from one part to the next: an arm of 15 mm written in millimetres is longer."""

TURN = 2.0 * math.pi * 1.001, FARTHEST
"""Usual position of a joint: a turn, as files round it, or m."""

SHARE: Mapping[str, Any] = {"low": 0.0, "folds": True, "rule": coefficient}
"""A number of at least 0 whose integer zero is structure: there is no such effect."""


class VehicleError(RecordError):
    """Error in a vehicle's description."""


def accept_named(record: Any, kind: str) -> None:
    """Check and convert the fields of a named dataclass; errors state its name, as in ``joints[shoulder].axis``.

    Raises:
        VehicleError: one line with field, value and what is allowed.
    """
    name = record.link.name if kind == "follower" and hasattr(record.link, "name") else getattr(record, "name", "")
    accept_fields(record, f"{kind}s[{name}]" if isinstance(name, str) and name else kind, VehicleError)


def refuse(field: str, value: object, allowed: str) -> NoReturn:
    """Raise an error with field, value and the allowed values, on one line."""
    raise VehicleError(f"{field} = {shown(value)}: {allowed}")


def inertia(field: str, inertia_com: Sym3, *, planar: bool, least: float = 0.0) -> None:
    """Check an inertia for physical consistency: positive semi-definite, triangle inequality of principal moments.

    Args:
        field: name in messages.
        inertia_com: about the centre of mass, kg m^2.
        planar: of a planar model, which obeys no triangle inequality.
        least: kg m^2; all moments of a solid body are larger.
    """
    if not concrete(*inertia_com.entries):
        return
    moments = principal_moments(inertia_com)
    slack = TOLERANCE * max(*(abs(moment) for moment in moments), 1e-300)
    shown = f"principal moments {', '.join(f'{m:.6g}' for m in moments)}"
    if moments[0] < -slack:
        refuse(field, shown, "must not be negative")
    if least > 0.0 and moments[0] < least:
        refuse(field, shown, f"must leave no axis without inertia: at least {least:g} kg m^2 about each")
    if 0.0 < moments[2] < NOISE:
        refuse(field, shown, f"must be 0 or at least {NOISE:g} kg m^2")
    if not planar and moments[0] + moments[1] < moments[2] - slack:
        refuse(
            field,
            shown,
            "must obey the triangle inequality (no real body has this inertia; "
            "a controller's model may declare 'planar = true')",
        )


def rising(field: str, column: Sequence[Any], why: str = "") -> None:
    """Raise an error unless each number of a column is above the one before it."""
    for i, (a, b) in enumerate(pairwise(column)):
        if concrete(a, b) and not a < b:
            refuse(f"{field}[{i + 1}]", b, f"must be above the one before it, {a:g}{why}")


def principal_moments(inertia_com: Sym3) -> list[float]:
    """Principal moments of inertia, kg m^2, in ascending order."""
    rows = [[float(each) for each in row] for row in inertia_com.full().rows]
    return [float(each) for each in np.linalg.eigvalsh(np.array(rows))]


def joint(field: str, value: Joint) -> None:
    """Check the kind and limits of one joint."""
    if value.kind not in ("revolute", "prismatic"):
        refuse(f"{field}.kind", value.kind, "must be 'revolute' or 'prismatic'")
    if concrete(value.lower, value.upper) and not value.lower < value.upper:
        refuse(f"{field}.lower", value.lower, f"must be below upper = {value.upper!r}")


def unique(field: str, names: list[str]) -> None:
    """Raise an error if names are repeated or empty."""
    for name in names:
        if not name:
            refuse(field, name, "must have a name")
        if names.count(name) > 1:
            refuse(field, name, "stands twice; names must be unique")


def vehicle(value: Vehicle) -> None:
    """Check a vehicle as a whole: unique names, order of links, existing references, physical consistency."""
    solid = concrete(value.base.mass) and not value.base.planar
    inertia("base.inertia", value.base.inertia, planar=value.base.planar, least=NOISE if solid else 0.0)
    if concrete(value.base.mass) and not value.base.mass > 0.0:
        refuse("base.mass", value.base.mass, "must be greater than 0")
    unique("links.name", [link.name for link in value.moving])
    unique("joints.name", [link.joint.name for link in value.moving])
    unique("rotors.name", [each.name for each in value.rotors])
    unique("frames.name", [each.name for each in value.frames])
    for index, link in enumerate(value.links):
        if not -1 <= link.parent < index:
            refuse(f"links[{link.name}].parent", link.parent, "must be the base (-1) or a link that stands before it")
        inertia(f"links[{link.name}].inertia", link.body.inertia, planar=link.body.planar)
        joint(f"joints[{link.joint.name}]", link.joint)
    for index, follower in enumerate(value.followers):
        _follower(value, follower, index)
    for each in value.rotors:
        if each.tilt is not None:
            each.tilt.require(f"rotors[{each.name}].tilt", each.axis)
    for frame in value.frames:
        if not -1 <= frame.link < len(value.moving):
            refuse(f"frames[{frame.name}].link", frame.link, f"must be -1 (base) ... {len(value.moving) - 1}")
    if value.end_effector and value.end_effector not in [each.name for each in value.frames]:
        refuse(
            "end_effector",
            value.end_effector,
            f"must be one of {', '.join(each.name for each in value.frames) or 'none'}",
        )
    _drives(value)
    if found := mobility.what_does_not_move(value):
        refuse(*found)


def _drives(value: Vehicle) -> None:
    """Check that each drive has a joint of its own with an effort limit above zero."""
    joints = [link.joint.name for link in value.links]
    for name in (each.name for each in value.drives):
        if name not in joints or [each.name for each in value.drives].count(name) > 1:
            refuse("drives", name, f"must be one of {', '.join(joints) or 'none'}, once")
        limit = value.links[joints.index(name)].joint.effort_limit
        if concrete(limit) and limit == 0:
            allowed = f"must be above 0: it leaves drives.{name} no torque"
            refuse(f"joints[{name}].effort_limit", limit, allowed)


def _follower(value: Vehicle, each: Follower, index: int) -> None:
    """Check a follower: existing leader, earlier parent, and a joint without friction, armature or stops."""
    field, link = f"followers[{each.name}]", each.link
    inertia(f"{field}.link.inertia", link.body.inertia, planar=link.body.planar)
    joint(f"{field}.link.joint", link.joint)
    if not 0 <= each.leader < value.n:
        refuse(f"{field}.leader", each.leader, f"must be the index of a link, 0 ... {value.n - 1}")
    if not -1 <= link.parent < value.n + index:
        refuse(f"{field}.link.parent", link.parent, "must be the base (-1), a link or an earlier follower")
    if concrete(each.ratio) and each.ratio == 0:
        refuse(f"{field}.ratio", each.ratio, "must not be 0; a joint that never moves is fixed")
    for name in ("damping", "coulomb", "armature", "stop_stiffness"):
        if concrete(getattr(link.joint, name)) and getattr(link.joint, name) != 0:
            refuse(f"{field}.link.joint.{name}", getattr(link.joint, name), "must be 0: its leader has it")


def require_plant(value: Vehicle) -> None:
    """Raise an error if a vehicle has bodies that are not physical; planar ones are allowed only in a law's model.

    Raises:
        VehicleError: with the first planar body.
    """
    names = ["base", *(f"links[{link.name}]" for link in value.moving)]
    for name, each in zip(names, value.bodies, strict=True):
        if each.planar:
            raise VehicleError(
                f"vehicle '{value.name}': {name}.planar = True: must be false in a plant (a planar inertia is "
                "impossible for a real body; such a vehicle is a controller's model only)"
            )


NOISE = 1e-15
"""kg m^2: a negative moment of at most this size is rounding; a milligram at 30 micrometres has as much."""

REPAIRABLE = 0.1
"""Of the largest moment: what lies farther beyond the inequality is no slip of rounding or of a program's density."""


def excess(moments: Sequence[float]) -> float:
    """Violation of the triangle inequality of principal moments, relative to the largest; at most 0 for a real body."""
    a, b, c = sorted(moments)
    return (c - a - b) / c if c > 0.0 else 0.0


def nearest_inertia(inertia: Sym3) -> Sym3:
    """Nearest physically consistent inertia, kg m^2, about the same centre of mass in the same axes."""
    given = np.array([[float(each) for each in row] for row in inertia.full().rows])
    values, axes = np.linalg.eigh(0.5 * np.trace(given) * np.eye(3) - given)
    second = (axes * np.maximum(values, 0.0)) @ axes.T
    found = np.trace(second) * np.eye(3) - second
    # products that were zero stay structure
    size = 1e-15 * float(np.abs(given).max())
    entries = [float(found[i, j]) for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    return Sym3.from_numbers(*(0.0 if abs(each) <= size else each for each in entries))


def with_real_inertias(bodies: RigidBodies) -> RigidBodies:
    """Bodies with each slightly unphysical inertia (by up to a tenth) replaced by the nearest physical one."""
    notes: list[str] = []
    base = _checked_body(f"link {bodies.root}", bodies.base, notes)
    links = tuple(replace(link, body=_checked_body(f"link {link.name}", link.body, notes)) for link in bodies.links)
    return replace(bodies, base=base, links=links, notes=(*bodies.notes, *notes)) if notes else bodies


def _checked_body(name: str, body: Body, notes: list[str]) -> Body:
    """Body with a repaired inertia where it violates physical consistency; the change is added to the notes."""
    if body.planar or not all(math.isfinite(float(entry)) for entry in body.inertia.entries):
        return body
    moments = principal_moments(body.inertia)
    beyond = moments[2] - moments[0] - moments[1]
    if beyond <= TOLERANCE * max(map(abs, moments)) or (beyond > NOISE and not 0.0 < excess(moments) <= REPAIRABLE):
        return body
    found = replace(body, inertia=nearest_inertia(body.inertia))
    now = ", ".join(f"{each:.6g}" for each in principal_moments(found.inertia))
    words = "rounding of its inertia left out" if beyond <= NOISE else "inertia repaired"
    notes.append(f"{name}: {words}: principal moments {', '.join(f'{each:.6g}' for each in moments)} -> {now} kg m^2")
    return found
