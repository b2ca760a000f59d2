"""Contact model whose grasps a plant closes by constraints in place of springs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from skyarm.algebra import Force, Scalar
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.vehicle import Vehicle
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_memory import ContactMemory


@immutable
class ClosedContact(Contact):
    """Contact model whose grasps are closed by constraints of the plant, which writes
    their forces into the memory.
    """

    def settle(
        self, memory: ContactMemory, motion: PointMotion, vehicle: bool
    ) -> ContactMemory:
        """Internal state in static equilibrium; the first forces of constraints are
        those of springs.
        """
        # not super(): a dataclass with slots is another class than the one made here
        memory = Contact.settle(self, memory, motion, vehicle)
        pulls = (pull for _, _, pull, _ in self.gripping.pulls(memory, motion, 0.0))
        return replace(
            memory,
            constraints=as_data(
                tuple(Force(each.torque, each.force) for each in pulls)
            ),
        )

    def require_vehicles(
        self, vehicles: Mapping[str, Vehicle], period: float, gravity: Scalar
    ) -> None:
        """Refuse what a contact model refuses, and grasps that a plant cannot close by
        constraints.
        """
        Contact.require_vehicles(self, vehicles, period, gravity)
        objects = [each.name for each in self.objects]
        for name, vehicle in vehicles.items():
            if vehicle.followers:
                # a file of one vehicle has no table agents
                of = (
                    f"agents.{name}.plant.vehicle"
                    if len(vehicles) > 1
                    else "plant.vehicle"
                )
                words = (
                    "must have no joints that follow others where plant.closure is"
                    " 'weld'"
                )
                raise RecordError(f"{of} = {shown(vehicle.name)}: {words}")
        for i, grasp in enumerate(self.grasps):
            at = f"world.grasps[{i}]"
            words = ""
            if grasp.kind == "cable":
                words = "kind = 'cable': must be 'ball' or 'fixed'"
            elif grasp.body not in objects:
                words = f"body = {shown(grasp.body)}: must be an object"
            elif grasp.closes:
                words = f"close = {shown(grasp.close)}: must be 0"
            if words:
                raise RecordError(f"{at}.{words} where plant.closure is 'weld'")
