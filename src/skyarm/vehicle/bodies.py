"""What any description of a vehicle comes down to before rotors are put on: rigid bodies in a tree."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from skyarm.vehicle.couple import Mimic
from skyarm.vehicle.linkage import Body, Link
from skyarm.vehicle.vehicle_records import Frame, Look


@dataclass(frozen=True, slots=True)
class RigidBodies:
    """Bodies, joints and frames of a vehicle.

    Attributes:
        name: of the vehicle.
        root: name of the root link, the base.
        base, links: bodies and joints, in an order in which every parent precedes its children.
        frames: one for each link that a fixed joint merged into another.
        mimics: name of a joint that follows another one -> how; no joint does if empty.
        notes: what its reader left out or took in another way, a line each.
        looks: meshes of its links.
    """

    name: str
    root: str
    base: Body
    links: tuple[Link, ...]
    frames: tuple[Frame, ...]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    looks: tuple[Look, ...] = ()
