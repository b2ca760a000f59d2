"""Tasks of the contact suite (``library/contact_tasks.toml``), and the bounds of what is perturbed in their worlds."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any

Range = tuple[float, float]

FRICTION: Range = (0.1, 0.8)
STIFFNESS: Range = (500.0, 1e5)
"""N/m, drawn by its logarithm."""

NORMAL = 0.17453292519943295
"""rad, 10 degrees: largest error of the believed normal."""

RADIUS = 0.06
"""Share by which the way from the tip to a hinge may be wrong."""

MASS: Range = (0.5, 2.0)
"""Share of an object's mass, drawn by its logarithm."""

DRAG: Range = (0.5, 2.0)
"""Share of a mechanism's closer, damping and friction, drawn by its logarithm, each by itself."""

THRUST: Range = (0.9, 1.0)
"""Share of the rotors' thrust."""

WIND = 2.0
"""N, largest."""

DELAY = 0.010
"""s, largest age of the commands, of which no law knows."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Task:
    """A task of the suite.

    Attributes:
        name: of the shipped scenario. title: in a few words.
        push: N, wanted; 0 of a task without. normal: believed, out of the surface.
        face: m, from the tip's path to the believed surface, against the normal.
        materials: names of what is touched, as ``surfaces.wall``; all of one stiffness and friction.
        friction: bounds. sideways: whether the tip slides so that friction turns the vehicle.
        wind: N, largest. tilts: whether the believed normal is wrong.
        hinge: name of a mechanism whose hinge is not where it is believed, and the way from the tip to it, m.
        drags: name of a mechanism of which closer, damping and friction are unknown.
        grip: name of a gripper that holds it with the drawn stiffness, and goes along an arc.
        object: name of an object of unknown mass.
        held: whether the force must be held.
        place: where the object must lie in the end, x and y, m. angle: that the mechanism must reach, rad or m.
        depth: height that the tip must reach, m. stands: share of the weight on the surface in the end.
    """

    name: str
    title: str
    push: float = 0.0
    normal: tuple[float, float, float] = (-1.0, 0.0, 0.0)
    face: float = 0.0
    materials: tuple[str, ...] = ()
    friction: Range = FRICTION
    sideways: bool = False
    wind: float = WIND
    tilts: bool = False
    hinge: tuple[str, float, float, float] | None = None
    drags: str = ""
    grip: str = ""
    object: str = ""
    held: bool = False
    place: tuple[float, float] | None = None
    angle: float | None = None
    depth: float | None = None
    stands: float | None = None


def _plain(value: Any) -> Any:
    """An array of a file as a tuple."""
    return tuple(value) if isinstance(value, list) else value


TASKS: Mapping[str, Task] = {
    row["name"]: Task(**{key: _plain(value) for key, value in row.items()})
    for row in tomllib.loads((resources.files("skyarm.compare") / "library" / "contact_tasks.toml").read_text("utf-8"))[
        "tasks"
    ]
}
"""By name, in the order of the tables."""
