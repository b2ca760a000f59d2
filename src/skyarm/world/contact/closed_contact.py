"""Contact models of which a plant finds the forces by constraints: of grasps, or of all
contacts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

from skyarm.algebra import Force, Scalar, Scalars
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.coerce import RecordError
from skyarm.records.files import shown
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data, leaves
from skyarm.vehicle import Vehicle
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.meetings import Meeting

OF_A_POINT, OF_BODIES = 3, 4
"""Count of logged numbers of a point: normal force, friction and penetration; and of a
pair of bodies: normal force and place."""

REFUSED = "where plant.contact is 'geoms'"


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


@immutable
class GeomContact(Contact):
    """Contact model of a plant with its own contact forces, which writes them into the
    memory; it exerts none itself.
    """

    geoms: ClassVar[bool] = True

    def start(self, period: float, draws: Sequence[Scalar]) -> ContactMemory:
        """Initial internal state, in which no force is logged yet."""
        # not super(): a dataclass with slots is another class than the one made here
        memory = Contact.start(self, period, draws)
        points = ((0.0,) * OF_A_POINT,) * self.logged_pairs
        bodies = ((0.0,) * OF_BODIES,) * len(self.body_pairs)
        return replace(memory, touches=(*points, *bodies))

    def meetings(self, memory: ContactMemory, motion: PointMotion) -> list[Meeting]:
        """No contacts: the plant exerts their forces."""
        return []

    def bodies_near(
        self, memory: ContactMemory, motion: PointMotion, seconds: Scalar = 0.0
    ) -> Scalar:
        """False, since the plant exerts the forces of all bodies."""
        return False

    def logged(self, memory: ContactMemory, motion: PointMotion) -> Scalars:
        """Logged contact forces, states of objects, and forces of pairs of bodies."""
        rows = zip(self.carriers, memory.carried, strict=True)
        carried = tuple(each.logged(body) for each, body in rows)
        touches, first = memory.touches, self.logged_pairs
        return tuple(leaves((touches[:first], carried, touches[first:])))

    def require_vehicles(
        self, vehicles: Mapping[str, Vehicle], period: float, gravity: Scalar
    ) -> None:
        """Refuse what a contact model refuses, and parts that the plant's own contacts
        lack.
        """
        Contact.require_vehicles(self, vehicles, period, gravity)
        parts = ("mechanisms", "grippers", "grasps")
        lacks = [each for each in parts if getattr(self, each)]
        for i, each in enumerate(self.surfaces):
            if each.moves or each.shape == "hole":
                lacks.append(f"surfaces[{i}], a hole or in motion")
        if lacks:
            raise RecordError(f"world.{lacks[0]}: must be left out {REFUSED}")
