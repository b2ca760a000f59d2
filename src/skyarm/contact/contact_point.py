"""Points of a vehicle that may touch: the tip, skids, feet, or any point of a link."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated

from skyarm.algebra import ZERO3, Vec3
from skyarm.files import must_be_one_of, shown
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

BASE_NAME = "base"


MOST = 64
"""Points of a ring at most: each costs as much as any other."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Ring:
    """A ring says places on a circle across the z axis: the rim of a peg.

    Attributes:
        count: of places, the first on the x axis.
    """

    radius: Annotated[Scalar, Unit("m", "of the circle", low=0.0, strict=True)]
    count: int

    def __post_init__(self) -> None:
        accept_fields(self, "ring")
        if not 3 <= self.count <= MOST:
            raise RecordError(f"ring.count = {self.count}: must be from 3 to {MOST}")

    def offsets(self) -> list[Vec3]:
        """Places about the middle, m."""
        angles = [2.0 * math.pi * i / self.count for i in range(self.count)]
        return [Vec3(self.radius * math.cos(angle), self.radius * math.sin(angle), 0) for angle in angles]


@dataclass(frozen=True, kw_only=True, slots=True)
class ContactPoint:
    """A contact point is a point of a body, or a ball about it, that surfaces push back.

    Attributes:
        name: for logs and messages.
        frame: of the vehicle, in whose axes ``position`` is; empty where ``body`` says them.
        body: "base" or the name of a link.
        ring: points on a circle about the position, in its place; :meth:`each` makes them.
    """

    name: str
    frame: str = ""
    body: str = ""
    position: Annotated[Vec3, Unit("m", "axes of the frame or the body")] = ZERO3
    radius: Annotated[Scalar, Unit("m", "of the ball", low=0.0)] = 0
    ring: Ring | None = None

    def __post_init__(self) -> None:
        accept_fields(self, "point")
        if not self.name:
            raise RecordError("point.name = '': must not be empty")
        if type(self.radius) is float and self.radius == 0.0:
            object.__setattr__(self, "radius", 0)
        if self.frame and self.body:
            raise RecordError(f"point.frame = {shown(self.frame)}: must be left out beside body")
        if not self.frame and not self.body:
            raise RecordError("point.body: is missing; say a frame of the vehicle, or a body with a position")

    def each(self) -> tuple[ContactPoint, ...]:
        """The points of its ring, named by numbers from 1; itself without one."""
        if self.ring is None:
            return (self,)
        found = []
        for i, offset in enumerate(self.ring.offsets()):
            place = self.position + offset
            found.append(replace(self, name=f"{self.name}_{i + 1}", position=place, ring=None))
        return tuple(found)

    def place(self, vehicle: Vehicle) -> tuple[Vec3, int]:
        """(position in the axes of its body, index of the body).

        Raises:
            ValueError: the vehicle has no such frame or body; names those it has.
        """
        if self.frame:
            found = vehicle.frame(self.frame)
            if concrete(*self.position) and not any(self.position):
                return found.position, found.link
            return found.position + found.rotation.apply(self.position), found.link
        if self.body == BASE_NAME:
            return self.position, BASE
        names = [link.name for link in vehicle.moving]
        if self.body not in names:
            raise RecordError(f"body = {shown(self.body)}: {must_be_one_of([BASE_NAME, *names], self.body)}")
        return self.position, names.index(self.body)
