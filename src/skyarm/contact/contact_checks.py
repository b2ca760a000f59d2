"""What the parts of a world must be to each other, and to the vehicle that touches it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from skyarm.files import shown
from skyarm.records.coerce import RecordError
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle

if TYPE_CHECKING:
    from skyarm.contact.contact import Contact


def require_names_apart(contact: Contact) -> None:
    """Raise ValueError with one line where two parts of a kind have one name, or two of what a log has columns of."""
    taken: list[str] = []
    named = {
        what: [each.name for each in getattr(contact, what)] for what in ("surfaces", "points", "objects", "grippers")
    }
    named["mechanisms"] = [each.name for each in contact.mechanisms]
    named["mechanisms"] += [part.name for each in contact.mechanisms for part in each.parts]
    for what, names in named.items():
        for name in names:
            if names.count(name) > 1 or (what in ("objects", "grippers", "mechanisms") and name in taken):
                raise RecordError(f"world.{what}: name = {shown(name)}: must be of one only")
        taken += names


def require_on_vehicle(contact: Contact, vehicle: Vehicle) -> None:
    """Raise ValueError with one line unless the vehicle has the points and grippers, and they have what to touch."""
    if not contact.surfaces and not contact.carriers:
        raise RecordError("world.surfaces: is missing; a world has at least one surface")
    if not contact.points and not contact.carriers:
        raise RecordError(f"world.points: is missing; vehicle {vehicle.name!r} has no tip")
    for i, point in enumerate(contact.points):
        try:
            point.place(vehicle)
        except VehicleError as error:
            raise RecordError(f"world.points[{i}].frame = {shown(point.frame)}: {error}") from None
        except ValueError as error:
            raise RecordError(f"world.points[{i}].{error}") from None
    for i, mechanism in enumerate(contact.mechanisms):
        if not mechanism.surfaces:
            raise RecordError(f"world.mechanisms[{i}].parts: is missing; nothing of {mechanism.name!r} can be touched")
    for i, gripper in enumerate(contact.grippers):
        try:
            vehicle.frame(gripper.frame or None)
        except VehicleError as error:
            raise RecordError(f"world.grippers[{i}].frame = {shown(gripper.frame)}: {error}") from None
        if not contact.carriers:
            raise RecordError("world.grippers: must be left out of a world without objects")
