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
import itertools
from typing import Any

import numpy as np

from skyarm.files import Fields, shown
from skyarm.reference.signal_tables import signal_from
from skyarm.reference.signals import Signal
from skyarm.reference.task_tables import within
from skyarm.reference.tip_push import FASTEST, SPEED, STRONGEST, TipPush

SHORTEST = 1e-6
"""Length of a normal below which it points nowhere."""

LOOKS = 401
"""Instants of a flight at which the force is looked at, beside those at which it switches."""

ROUNDING = 1e-6
"""N below 0 that a force without a grip may be: a smooth ramp back to 0 ends at no exact 0."""


def push_from(table: Any, where: str, duration: float = 0.0) -> TipPush:
    """The wanted contact that a table describes.

    Args:
        table: as above.
        where: its name.
        duration: s of the flight, in the course of which the force is looked at.

    Raises:
        ValueError: one line with field, value and what is allowed.
    """
    fields = Fields(table, where)
    force = signal_from(fields.take("force"), fields.at("force"))
    normal = fields.vector("normal")
    if sum(c * c for c in normal) < SHORTEST * SHORTEST:
        raise ValueError(f"{fields.at('normal')} = {shown(list(normal))}: must point out of the surface")
    speed = within(fields.number("speed", SPEED, low=0.0, strict=True), fields.at("speed"), 0.0, FASTEST)
    found = TipPush(force=force, normal=normal, speed=speed)
    # each is asked for, so that a misspelt one is told of all
    if fields.take("grip", None) is not None:
        found = dataclasses.replace(found, grip=signal_from(fields.take("grip"), fields.at("grip")))
    if fields.take("pivot", None) is not None:
        found = dataclasses.replace(found, pivot=_vector(fields, "pivot", found))
    if fields.take("axis", None) is not None:
        found = dataclasses.replace(found, axis=_vector(fields, "axis", found))
    fields.done()
    _require_force(force, fields.at("force"), duration, pulls=found.grip is not None)
    return found


def _require_force(force: Signal, at: str, duration: float, *, pulls: bool) -> None:
    """Refuse a force that no vehicle has, and one that pulls where nothing is gripped."""
    switches = sorted({0.0, *(float(t) for t in force.switch_times()), duration})
    between = [0.5 * (a + b) for a, b in itertools.pairwise(switches)]
    looks = np.concatenate([switches, between, np.linspace(0.0, duration, LOOKS)])
    found = np.broadcast_to(np.asarray(force.derivatives(looks)[0], dtype=float), looks.shape)
    worst = int(np.argmax(np.abs(found)))
    if abs(found[worst]) > STRONGEST:
        raise ValueError(f"{at} = {found[worst]:g} N at {looks[worst]:.4g} s: must be at most {STRONGEST:g} N")
    least = int(np.argmin(found))
    if not pulls and found[least] < -ROUNDING:
        allowed = "must be at least 0 without grip; what only presses cannot pull"
        raise ValueError(f"{at} = {found[least]:g} N at {looks[least]:.4g} s: {allowed}")


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
