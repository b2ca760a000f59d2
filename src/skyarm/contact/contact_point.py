"""Points of a vehicle that may touch: the tip, skids, feet, or any point of a link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from skyarm.algebra import ZERO3, Vec3
from skyarm.files import must_be_one_of, shown
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

BASE_NAME = "base"


@dataclass(frozen=True, kw_only=True, slots=True)
class ContactPoint:
    """A contact point is a point of a body, or a ball about it, that surfaces push back.

    Attributes:
        name: for logs and messages.
        frame: of the vehicle, at whose origin it is; empty where ``body`` and ``position`` say it.
        body: "base" or the name of a link.
    """

    name: str
    frame: str = ""
    body: str = ""
    position: Annotated[Vec3, Unit("m", "axes of the body")] = ZERO3
    radius: Annotated[Scalar, Unit("m", "of the ball", low=0.0)] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "point")
        if not self.name:
            raise RecordError("point.name = '': must not be empty")
        if type(self.radius) is float and self.radius == 0.0:
            object.__setattr__(self, "radius", 0)
        if self.frame and (self.body or self.position != ZERO3):
            raise RecordError(f"point.frame = {shown(self.frame)}: must be left out beside body and position")
        if not self.frame and not self.body:
            raise RecordError("point.body: is missing; say a frame of the vehicle, or a body with a position")

    def place(self, vehicle: Vehicle) -> tuple[Vec3, int]:
        """(position in the axes of its body, index of the body).

        Raises:
            ValueError: the vehicle has no such frame or body; names those it has.
        """
        if self.frame:
            found = vehicle.frame(self.frame)
            return found.position, found.link
        if self.body == BASE_NAME:
            return self.position, BASE
        names = [link.name for link in vehicle.moving]
        if self.body not in names:
            raise RecordError(f"body = {shown(self.body)}: {must_be_one_of([BASE_NAME, *names], self.body)}")
        return self.position, names.index(self.body)
