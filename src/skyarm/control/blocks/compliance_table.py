"""The table ``admittance`` of a law: mass, damping and stiffness of a virtual tip, its axes, what it hears.

::

    admittance = { mass = [1, 1, 1], damping = [8, 8, 8], stiffness = [20, 20, 0], normal = [-1, 0, 0] }
"""

from __future__ import annotations

import math
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.outside_force import Hearing
from skyarm.control.blocks.virtual_tip import Compliance
from skyarm.control.controller import ControllerError
from skyarm.files import Fields, shown

LEAST, MOST = 0.01, 1000.0
"""kg, of the virtual mass."""

FASTEST = 50.0
"""rad/s, of the virtual tip: no loop of an arm follows a faster one."""


def compliance_of(table: Any, at: str, lead: float) -> tuple[Compliance, Hearing]:
    """Constants for a table; ``lead`` in s.

    Raises:
        ControllerError: one line with field, value and what is allowed.
    """
    try:
        fields = Fields(table, at)
        mass, damping, stiffness = (_three(fields, name) for name in ("mass", "damping", "stiffness"))
        rows = [_axis(at, i, *row) for i, row in enumerate(zip(mass, damping, stiffness, strict=True))]
        if not any(mass):
            raise ValueError(f"{at}.mass = {shown(list(mass))}: must be above 0 along an axis at least")
        axes = () if "normal" not in fields.table else _axes(fields.vector("normal"), f"{at}.normal")
        hearing = Hearing(threshold=fields.number("threshold", Hearing().threshold, low=0.0))
        fields.done()
    except ValueError as error:
        raise ControllerError(str(error)) from None
    first, second, third = (tuple(row[k] for row in rows) for k in range(3))
    return Compliance(mass=first, damping=second, stiffness=third, lead=lead, axes=axes), hearing


def _three(fields: Fields, name: str) -> tuple[float, float, float]:
    """Three numbers, one for each axis."""
    values = fields.vector(name)
    for i, value in enumerate(values):
        if value < 0.0:
            raise ValueError(f"{fields.at(name)}[{i}] = {shown(value)}: must be at least 0")
    return values


def _axis(at: str, i: int, mass: float, damping: float, stiffness: float) -> tuple[Any, Any, Any]:
    """Mass, damping and stiffness of an axis; structural zeros of one that is held."""
    if mass == 0.0:
        for name, value in (("damping", damping), ("stiffness", stiffness)):
            if value:
                raise ValueError(f"{at}.{name}[{i}] = {shown(value)}: must be 0 along an axis of mass 0, which is held")
        return 0, 0, 0
    if not LEAST <= mass <= MOST:
        raise ValueError(f"{at}.mass[{i}] = {shown(mass)}: must be 0 or from {LEAST:g} to {MOST:g}")
    if damping > FASTEST * mass:
        raise ValueError(f"{at}.damping[{i}] = {shown(damping)}: must be at most {FASTEST:g} 1/s times the mass")
    if stiffness > FASTEST * FASTEST * mass:
        raise ValueError(
            f"{at}.stiffness[{i}] = {shown(stiffness)}: must be at most ({FASTEST:g} rad/s)^2 times the mass"
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
