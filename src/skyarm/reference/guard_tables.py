"""``until`` of a phase: what the flight must show before the reference goes on.

::

    until = { error = 0.005 }                      # m, of the tip, at most
    until = { force = 0.5, timeout = 8 }           # N against the tip, at least; s of waiting, at most
    until = { force_below = 0.2 }                  # N, at most
    until = { distance = 0.02, direction = [0, 0, 1] }  # m, that the tip has moved against the direction
    until = { force = 0.5, force_sensor = true }   # as the sensor at the tip reads it, not as the law observes it
    until = { closed = "fingertip" }               # a tactile switch, or open
    until = { force = 0.5, hold = 0.1, on_timeout = "fail", early = true }

What is asked must hold together for ``hold`` s (0.5). A wrong table raises ValueError with one line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from skyarm.files import Fields, shown
from skyarm.reference.task_tables import CLOSEST, within

NUMBERS = ("error", "force", "force_below", "distance")

SWITCHES = ("closed", "open")

ASKED = (*NUMBERS, *SWITCHES)

Vector = tuple[float, float, float]

SHORTEST = 1e-6
"""Length of a vector below which it points nowhere."""


def guard_from(phase: Fields, normal: Vector | None, usual: Mapping[str, Any] | None = None) -> dict[str, Any] | None:
    """Fields of the guard that a phase's ``until`` describes; None where nothing is asked.

    Args:
        phase: its table.
        normal: of the surface that the task touches, where it says one.
        usual: what the phase asks for where its table says nothing.
    """
    if phase.take("until", None) is None:
        return None if usual is None else dict(usual)
    fields = Fields(phase.take("until"), phase.at("until"))
    found = _asked(fields)
    found["hold"] = within(fields.number("hold", 0.5, low=0.0), fields.at("hold"))
    found["timeout"] = within(fields.number("timeout", 5.0), fields.at("timeout"), CLOSEST)
    found["fails"] = fields.choice("on_timeout", ("go_on", "fail"), "go_on") == "fail"
    found["early"] = _flag(fields, "early")
    given = fields.take("direction", None)
    if given is not None:
        found["direction"] = unit_vector(fields, "direction")
    fields.done()
    if not any(name in found for name in ASKED):
        raise ValueError(f"{phase.at('until')} = {shown(fields.table)}: must have one of {', '.join(ASKED)}")
    if "direction" not in found and any(name in found for name in NUMBERS[1:]):
        if normal is None:
            allowed = "must be a vector out of the surface, since the task says no normal"
            raise ValueError(f"{fields.at('direction')}: is missing; {allowed}")
        found["direction"] = normal
    return found


def _asked(fields: Fields) -> dict[str, Any]:
    """What must hold: numbers, and names of switches."""
    found: dict[str, Any] = {}
    for name in SWITCHES:
        if fields.take(name, None) is not None:
            found[name] = fields.take(name)
            if not isinstance(found[name], str) or not found[name]:
                raise ValueError(f"{fields.at(name)} = {shown(found[name])}: must be the name of a tactile switch")
    for name in NUMBERS:
        if fields.take(name, None) is not None:
            found[name] = within(fields.number(name, low=0.0, strict=True), fields.at(name))
    if "force" in found and found.get("force_below", math.inf) <= found["force"]:
        raise ValueError(f"{fields.at('force_below')} = {found['force_below']:g}: must be above force")
    found["sensed"] = _flag(fields, "force_sensor")
    if found["sensed"] and not ("force" in found or "force_below" in found):
        raise ValueError(f"{fields.at('force_sensor')} = true: must be left out without force or force_below")
    return found


def _flag(fields: Fields, name: str) -> bool:
    """True or false."""
    found = fields.take(name, False)
    if not isinstance(found, bool):
        raise ValueError(f"{fields.at(name)} = {shown(found)}: must be true or false")
    return found


def unit_vector(fields: Fields, name: str) -> Vector:
    """A vector of any length, as one of length 1."""
    given = fields.vector(name)
    length = math.hypot(*given)
    if not SHORTEST < length < 1.0 / SHORTEST:
        raise ValueError(f"{fields.at(name)} = {shown(list(given))}: must be a vector that points somewhere")
    x, y, z = (c / length for c in given)
    return x, y, z
