"""A payload held by the vehicle."""

from __future__ import annotations

from dataclasses import dataclass

from skyarm.scalars import Scalar
from skyarm.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True, slots=True)
class Payload:
    """A point mass fixed to a frame for the whole episode.

    Attributes:
        mass: kg.
        frame: name of the frame that holds it; empty for the vehicle's end effector.
    """

    mass: Scalar
    frame: str = ""

    def held_by(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with this payload; raises VehicleError for an unknown frame or a negative mass."""
        return vehicle.with_payload(self.mass, self.frame or None)
