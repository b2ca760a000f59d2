"""A law that joins a reference which is already running."""

from __future__ import annotations

from typing import Any

from skyarm.algebra import Vec3
from skyarm.records.leaves import field_names
from skyarm.reference import Reference
from skyarm.scalars import where
from skyarm.scenario.scenario_record import Scenario

POSES = ("position", "yaw", "joints", "tip")
"""What a reference at rest keeps; its derivatives are zero."""

ASKED = (0, 5)
"""Places in the push of what asks for contact: force and grip."""


def joins_late(scenario: Scenario) -> bool:
    """Whether the law may join after the first instant."""
    return not (type(scenario.joined) is int and scenario.joined == 0)


def joined_reference(scenario: Scenario, going: Reference, time: Any) -> Reference:
    """What the law is told: until it joins the pose of t = 0, at rest, then the reference as it goes.

    Costs nothing where the law follows from the first instant. Structural numbers stay: they do not move.
    """
    if not joins_late(scenario):
        return going
    still, resting = scenario.trajectory.at(0.0), time < scenario.joined
    fields: dict[str, Any] = {}
    for name in field_names(Reference) or ():
        moving, rest = getattr(going, name), getattr(still, name)
        if isinstance(moving, (Vec3, tuple)):
            pose = tuple(rest) if name in POSES else (0.0,) * len(tuple(moving))
            if name == "push" and moving:  # no contact yet, and what is believed of it
                pose = tuple(0.0 if i in ASKED else value for i, value in enumerate(rest))
            kept = [_resting(resting, a, b) for a, b in zip(pose, moving, strict=True)]
            fields[name] = Vec3(*kept) if isinstance(moving, Vec3) else tuple(kept)
        else:
            fields[name] = _resting(resting, rest if name in POSES else 0.0, moving)
    return Reference(**fields)


def _resting(resting: Any, still: Any, going: Any) -> Any:
    return going if type(going) is int else where(resting, still, going)
