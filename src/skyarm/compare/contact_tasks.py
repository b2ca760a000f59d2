"""Tasks of the contact suite: a shipped scenario each, what of its world is wrong, and what counts as a success.

What counts as a success was fixed before anything flew. Bounds that the rotors or the push do not allow are narrower;
they were set by counting the discarded worlds, which needs no flight. The magnet was made stronger after a flight:

* where the tip slides sideways, friction turns the vehicle. Of 1 N on the paper's arm (0.21 m) half the yaw torque
  holds a friction of 0.27: such tasks meet 0.1 to 0.28;
* wind is at most half the push: a push of 1 N meets up to 0.6 N of it, one of 5 N and what has no push 2 N.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Range = tuple[float, float]

FRICTION: Range = (0.1, 0.8)
SIDEWAYS_FRICTION: Range = (0.1, 0.28)
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


LIGHT = 0.6
"""N of wind at most beside a push of 1 N."""

TASKS: Mapping[str, Task] = {
    task.name: task
    for task in (
        Task(
            name="press_and_hold", title="press 1 N and hold", push=1.0, face=0.092, wind=LIGHT, tilts=True,
            materials=("surfaces.wall",), held=True,
        ),
        Task(
            name="slide_up", title="slide 30 cm up, 5 N", push=5.0, face=0.05, tilts=True,
            materials=("surfaces.mast",), held=True,
        ),
        Task(
            name="slide_circle", title="slide round a circle, 1 N", push=1.0, face=0.092, wind=LIGHT, tilts=True,
            materials=("surfaces.wall",), friction=SIDEWAYS_FRICTION, sideways=True, held=True,
        ),
        Task(
            name="write_on_wall", title="write a letter, 1 N", push=1.0, face=0.092, wind=LIGHT, tilts=True,
            materials=("surfaces.wall",), friction=SIDEWAYS_FRICTION, sideways=True, held=True,
        ),
        Task(
            name="push_button", title="push a button", push=1.5, face=0.052, wind=0.9, tilts=True,
            materials=("surfaces.wall", "mechanisms.button"), angle=0.003,
        ),
        Task(
            name="open_door", title="push a door open, 55 deg", push=1.0, face=0.092, wind=LIGHT,
            materials=("mechanisms.door",), friction=SIDEWAYS_FRICTION, sideways=True,
            hinge=("mechanisms.door", 0.2600, 0.5, 0.0), angle=0.9599,
        ),
        Task(
            name="pull_door", title="pull a door open by its handle, 55 deg", grip="hand", drags="door",
            hinge=("mechanisms.door", 0.0, -0.8, 0.0), angle=0.9599,
        ),
        Task(
            name="turn_valve", title="turn a valve by its lever, 80 deg", grip="hand", drags="valve",
            hinge=("mechanisms.valve", 0.0, -0.106066, -0.106066), angle=1.3963,
        ),
        Task(
            name="peg_in_hole", title="peg in a hole, 90 % deep", push=1.0, normal=(0.0, 0.0, 1.0), face=0.03,
            wind=LIGHT, materials=("surfaces.plate",), friction=SIDEWAYS_FRICTION, sideways=True, depth=0.773,
        ),
        Task(
            name="pick_and_carry", title="pick, carry, place within 10 mm", object="box",
            materials=("surfaces.table",), place=(0.6, 0.0),
        ),
        Task(
            name="carry_in_wind", title="carry 1 m through wind, place within 10 mm", object="box",
            materials=("surfaces.table",), place=(1.2, 0.0),
        ),
        Task(
            name="perch_on_shelf", title="land on a shelf and stand", materials=("surfaces.shelf",), stands=0.1,
        ),
    )
}  # fmt: skip
"""By name, in the order of the tables."""
