"""``[reference.push]``: the force with which the tip presses on a surface, and what is believed of that surface.

::

    [reference.push]
    force = { kind = "sequence", start = 2, segments = [[1.0, 5.0]] }  # N, a signal; 0 asks for no contact
    normal = [-1, 0, 0]          # world axes, out of the surface; of any length
    speed = 0.1                  # m/s, with which the tip comes; left out: 0.1
    grip = { kind = "constant", value = 1, start = 4 }  # above 0.5: the tip is held by what it grips; left out: never
    pivot = [0.5, 0.8, 1.2]      # m: while it grips, the normal points from the axis through here to the tip
    axis = [0, 0, 1]             # of any length; left out: upright

A wrong table raises ValueError with one line: field, value, what is allowed.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from skyarm.files import Fields, shown
from skyarm.reference.signal_tables import signal_from
from skyarm.reference.tip_push import SPEED, TipPush

SHORTEST = 1e-6
"""Length of a normal below which it points nowhere."""


def push_from(table: Any, where: str) -> TipPush:
    """The wanted contact that a table describes.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    force = signal_from(fields.take("force"), fields.at("force"))
    normal = fields.vector("normal")
    if sum(c * c for c in normal) < SHORTEST * SHORTEST:
        raise ValueError(f"{fields.at('normal')} = {shown(list(normal))}: must point out of the surface")
    speed = fields.number("speed", SPEED, low=0.0, strict=True)
    found = TipPush(force=force, normal=normal, speed=speed)
    if "grip" in fields.table:
        found = dataclasses.replace(found, grip=signal_from(fields.take("grip"), fields.at("grip")))
    if "pivot" in fields.table:
        found = dataclasses.replace(found, pivot=_vector(fields, "pivot", found))
    if "axis" in fields.table:
        found = dataclasses.replace(found, axis=_vector(fields, "axis", found))
    fields.done()
    return found


def _vector(fields: Fields, name: str, push: TipPush) -> tuple[float, float, float]:
    """Pivot or axis of what the tip grips."""
    given = fields.take(name)
    needed = "grip" if name == "pivot" else "pivot"
    if getattr(push, needed) is None:
        raise ValueError(f"{fields.at(name)} = {shown(given)}: must be left out without {needed}")
    held = Fields({name: given}, fields.where).vector(name)
    if name == "axis" and sum(c * c for c in held) < SHORTEST * SHORTEST:
        raise ValueError(f"{fields.at(name)} = {shown(list(held))}: must point along the axis")
    return held
