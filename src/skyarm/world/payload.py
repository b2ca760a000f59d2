"""Payload fixed to the vehicle."""

from __future__ import annotations

from typing import Annotated

from skyarm.algebra import Scalar
from skyarm.records.field_rules import checked
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle
from skyarm.vehicle.vehicle_records import LOAD


@immutable
@checked("payload")
class Payload:
    """Point mass fixed to a frame of the vehicle for the whole episode.

    Attributes:
        frame: name of the frame that holds it; empty for the vehicle's tip.
    """

    mass: Annotated[Scalar, LOAD]
    frame: str = ""

    def held_by(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle with this payload attached; raises VehicleError for an
        unknown frame.
        """
        return vehicle.with_payload(self.mass, self.frame or None)
