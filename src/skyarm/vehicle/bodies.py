"""What any description of a vehicle comes down to before rotors are put on: rigid bodies in a tree."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.vehicle.vehicle_records import Body, Frame, Link


@dataclass(frozen=True, slots=True)
class RigidBodies:
    """Bodies, joints and frames of a vehicle.

    Attributes:
        name: of the vehicle.
        root: name of the root link, the base.
        base, links: bodies and joints, in an order in which every parent precedes its children.
        frames: one for each link that a fixed joint merged into another.
    """

    name: str
    root: str
    base: Body
    links: tuple[Link, ...]
    frames: tuple[Frame, ...]
