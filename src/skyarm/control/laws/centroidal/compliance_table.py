"""The table ``admittance`` of a law: mass, damping and stiffness of a virtual tip, its axes, what it hears.

::

    admittance = { mass = [1, 1, 1], damping = [8, 8, 8], stiffness = [20, 20, 0], normal = [-1, 0, 0] }
    admittance.rotation = { inertia = [0.05, 0.05, 0], damping = [0.3, 0.3, 0], stiffness = [0.5, 0.5, 0] }
"""

from __future__ import annotations

import math
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.controller import ControllerError
from skyarm.control.laws.centroidal.outside_force import Hearing
from skyarm.control.laws.centroidal.virtual_body import Compliance, RotationalCompliance
from skyarm.files import Fields, shown
from skyarm.records.coerce import concrete

LEAST, MOST = 0.01, 1000.0
"""kg, of the virtual mass."""

LEAST_TURNED, MOST_TURNED = 0.001, 100.0
"""kg m^2, of the virtual inertia."""

TORQUE = 0.05
"""N m, above which a torque is heard where none is told: noisy flights of docs/giving_way.md (Turning) have it."""

FASTEST = 50.0
"""rad/s, of the virtual tip: no loop of an arm follows a faster one."""


def compliance_of(table: Any, at: str, lead: float) -> tuple[Compliance, Hearing]:
    """Constants for a table; ``lead`` in s.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    try:
        fields = Fields(table, at)
        turns = fields.take("rotation", None) is not None
        first, second, third = _rows(fields, "mass", (LEAST, MOST), needed=not turns)
        axes = () if "normal" not in fields.table else _axes(fields.vector("normal"), f"{at}.normal")
        hearing = Hearing(threshold=fields.number("threshold", Hearing().threshold, low=0.0))
        fields.done()
    except ValueError as error:
        raise ControllerError(str(error)) from None
    return Compliance(mass=first, damping=second, stiffness=third, lead=lead, axes=axes), hearing


def rotation_of(table: Any, at: str, lead: float, axes: tuple[Vec3, ...]) -> tuple[RotationalCompliance, float] | None:
    """Constants of turning and the torque (N m) that is heard, for a table ``admittance``; None without ``rotation``.

    Args:
        table: checked by :func:`compliance_of`.
        at: its name.
        lead: s, by how long a torque is known late.
        axes: of the translation, which are those of the rotation.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    if table.get("rotation") is None:
        return None
    try:
        fields = Fields(table["rotation"], f"{at}.rotation")
        first, second, third = _rows(fields, "inertia", (LEAST_TURNED, MOST_TURNED), needed=True)
        threshold = fields.number("threshold", TORQUE, low=0.0)
        fields.done()
    except ValueError as error:
        raise ControllerError(str(error)) from None
    return RotationalCompliance(inertia=first, damping=second, stiffness=third, lead=lead, axes=axes), threshold


def require_moderate(at: str, inertia: str, held: Compliance | RotationalCompliance) -> None:
    """Refuse plain numbers of a record that its table refuses: those that a sweep puts there.

    Args:
        at: name of the record.
        inertia: name of its inertias, ``mass`` or ``inertia``.
        held: record. An axis whose inertia is a structural 0 is held.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    limits = (LEAST, MOST) if inertia == "mass" else (LEAST_TURNED, MOST_TURNED)
    rows: list[tuple[Any, ...]] = list(zip(getattr(held, inertia), held.damping, held.stiffness, strict=True))
    for i, (own, damping, stiffness) in enumerate(rows):
        if not concrete(own, damping, stiffness):
            continue
        if type(own) is float and own == 0.0:
            allowed = f"must be from {limits[0]:g} to {limits[1]:g}: an axis that gives way is not held by 0"
            raise ControllerError(f"{at}.{inertia}[{i}] = {shown(own)}: {allowed}")
        try:
            _axis(at, inertia, limits, i, own, damping, stiffness)
        except ValueError as error:
            raise ControllerError(str(error)) from None


def _rows(
    fields: Fields, inertia: str, limits: tuple[float, float], *, needed: bool
) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
    """Mass or inertia, damping and stiffness, of three axes each."""
    columns = [_three(fields, name) for name in (inertia, "damping", "stiffness")]
    if needed and not any(columns[0]):
        raise ValueError(f"{fields.at(inertia)} = {shown(list(columns[0]))}: must be above 0 along an axis at least")
    rows = [_axis(fields.where, inertia, limits, i, *row) for i, row in enumerate(zip(*columns, strict=True))]
    first, second, third = (tuple(row[k] for row in rows) for k in range(3))
    return first, second, third


def _three(fields: Fields, name: str) -> tuple[float, float, float]:
    """Three numbers, one for each axis."""
    values = fields.vector(name)
    for i, value in enumerate(values):
        if value < 0.0:
            raise ValueError(f"{fields.at(name)}[{i}] = {shown(value)}: must be at least 0")
    return values


def _axis(
    at: str, name: str, limits: tuple[float, float], i: int, mass: float, damping: float, stiffness: float
) -> tuple[Any, Any, Any]:
    """Mass or inertia, damping and stiffness of an axis; structural zeros of one that is held."""
    if mass == 0.0:
        for each, value in (("damping", damping), ("stiffness", stiffness)):
            if value:
                allowed = f"must be 0 along an axis of {name} 0, which is held"
                raise ValueError(f"{at}.{each}[{i}] = {shown(value)}: {allowed}")
        return 0, 0, 0
    least, most = limits
    if not least <= mass <= most:
        raise ValueError(f"{at}.{name}[{i}] = {shown(mass)}: must be 0 or from {least:g} to {most:g}")
    if damping > FASTEST * mass:
        raise ValueError(f"{at}.damping[{i}] = {shown(damping)}: must be at most {FASTEST:g} 1/s times the {name}")
    if stiffness > FASTEST * FASTEST * mass:
        raise ValueError(
            f"{at}.stiffness[{i}] = {shown(stiffness)}: must be at most ({FASTEST:g} rad/s)^2 times the {name}"
        )
    return mass, damping, stiffness


def _axes(normal: tuple[float, float, float], at: str) -> tuple[Vec3, ...]:
    """The unit normal, a level tangent (of a level surface: x), and the one across both."""
    length = math.sqrt(sum(c * c for c in normal))
    if not 1e-6 < length < math.inf:
        raise ValueError(f"{at} = {shown(list(normal))}: must have a direction")
    n = Vec3(*(c / length for c in normal))
    level = math.hypot(n.x, n.y)
    first = Vec3(-n.y / level, n.x / level, 0.0) if level > 1e-6 else Vec3(1.0, 0.0, 0.0)
    second = n.cross(first)
    return n, first, Vec3(*(c / math.sqrt(second.dot(second)) for c in second))
