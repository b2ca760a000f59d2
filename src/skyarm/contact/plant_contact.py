"""Contact whose forces the plant finds by itself: the world's bodies, their grasps, and what the plant said of touches.

On a plant with an own contact solver the formulas of :mod:`skyarm.contact.contact_point` do not apply. The plant moves
the bodies of the world, and writes after every control period into the memory the forces on each of the vehicle's
points; logs and sensors of force read them there. Grippers and the inner efforts of mechanisms stay ours.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.contact.carrier import Carrier
from skyarm.contact.contact import Contact, ContactMemory
from skyarm.contact.contact_point import wrenches_on
from skyarm.contact.free_object import FreeObject
from skyarm.contact.gripper import UNCHANGED
from skyarm.contact.mechanism import Mechanism
from skyarm.dynamics.point_motion import PointMotion
from skyarm.environment.component import Wrench
from skyarm.records.leaves import field_names
from skyarm.scalars import data, mul


@dataclass(frozen=True, kw_only=True, slots=True)
class Felt:
    """What a surface did to a point of the vehicle at the last control instant.

    Attributes:
        force: N, on the point; torque: N m, about it; world axes. normal: N. friction: N. depth: m, at least 0.
    """

    force: Vec3
    torque: Vec3
    normal: Any
    friction: Any
    depth: Any


_ZERO = Vec3(0.0, 0.0, 0.0)

NOTHING = Felt(force=_ZERO, torque=_ZERO, normal=0.0, friction=0.0, depth=0.0)
"""Of a point that touches nothing."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PlantContactMemory(ContactMemory):
    """Memory of a contact that the plant finds; it has no bristles.

    Attributes:
        felt: of each pair of a surface and a point, in the order of a log.
    """

    felt: tuple[Felt, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class PlantContact(Contact):
    """The same world, on a plant with contacts of its own."""

    def start(self, period: float, draws: Sequence[Any]) -> PlantContactMemory:
        """Every body where it starts; nothing felt yet."""
        held = Contact.start(self, period, draws)
        return PlantContactMemory(
            clock=held.clock, bristles=(), carried=held.carried, grips=held.grips, felt=(NOTHING,) * self.logged_pairs
        )

    def without_touches(self, memory: PlantContactMemory) -> PlantContactMemory:
        """The memory as if nothing touched: what acts beside the plant's own contacts."""
        return dataclasses.replace(memory, felt=tuple(NOTHING for _ in memory.felt))

    def wrenches(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        """What the vehicle's points felt, and what grippers do."""
        count, pushes = len(self.points), []
        for i in range(count):
            force = torque = ZERO3
            for each in memory.felt[i::count]:
                force, torque = force + each.force, torque + each.torque
            pushes.append((force, torque))
        return wrenches_on(self.points, motion, pushes) + self.grasps.on_vehicle(memory, motion)

    def slope(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> PlantContactMemory:
        """Rate of the memory without touches: under grasps, weights and inner efforts alone."""
        pushes = self._pulls(memory, motion)
        going = zip(self.carriers, memory.carried, pushes, strict=True)
        return PlantContactMemory(
            clock=tuple(1.0 for _ in memory.clock),
            bristles=(),
            carried=tuple(carrier.slope(held, *push, motion.gravity) for carrier, held, push in going),
            grips=tuple(UNCHANGED for _ in memory.grips),
            felt=tuple(NOTHING for _ in memory.felt),
        )

    def _pulls(self, memory: Any, motion: PointMotion) -> list[tuple[Vec3, Vec3]]:
        """What grasps do to each body."""
        return self.grasps.on_bodies(memory, motion) if self.grippers else [(ZERO3, ZERO3) for _ in self.carriers]

    def efforts(self, memory: Any, slope: PlantContactMemory, motion: PointMotion) -> list[Any]:
        """What pushes on the bodies of the world beside touches, and beside weight and gyration of free objects.

        Of an object force (N, world axes) and torque about its centre of mass (N m, its own axes), of a mechanism the
        effort along its coordinate.
        """
        found: list[Any] = []
        rows = zip(self.carriers, memory.carried, slope.carried, self._pulls(memory, motion), strict=True)
        for carrier, held, rate, (force, torque) in rows:
            if isinstance(carrier, FreeObject):
                R = held.attitude.rotation()
                found += [*force, *R.apply_T(torque - R.apply(carrier.com).cross(force))]
            else:
                found.append(mul(rate.rate, as_mechanism(carrier).moved))
        return [data(number) for number in found]

    def before_euler_step(self, memory: Any, slope: Any, dt: Any) -> PlantContactMemory:
        """Bristles of mechanisms' own friction have moved."""
        return _with(Contact.before_euler_step(self, memory, slope, dt), memory.felt)

    def euler_step(self, memory: Any, slope: Any, dt: Any) -> PlantContactMemory:
        """The clock and mechanisms' bristles; the motions are the plant's."""
        return _with(Contact.euler_step(self, memory, slope, dt), memory.felt)

    def logged(self, memory: Any, motion: PointMotion) -> tuple[Any, ...]:
        """As :meth:`Contact.logged`; forces and depths as the plant found them."""
        numbers: list[Any] = []
        for each in memory.felt:
            numbers += [each.normal, each.friction, each.depth]
        for carrier, held in zip(self.carriers, memory.carried, strict=True):
            numbers += carrier.logged(held)
        return (*numbers, *self.grasps.logged(memory, motion))


def plant_contact(contact: Contact) -> PlantContact:
    """The same world for a plant that finds contacts by itself."""
    return PlantContact(**{name: getattr(contact, name) for name in field_names(Contact) or ()})


def as_mechanism(carrier: Carrier) -> Mechanism:
    """A carrier that is no free object."""
    if not isinstance(carrier, Mechanism):
        raise TypeError(f"carrier {carrier.name!r}: must be a free object or a mechanism")
    return carrier


def _with(held: ContactMemory, felt: tuple[Felt, ...]) -> PlantContactMemory:
    return PlantContactMemory(
        clock=held.clock, bristles=held.bristles, carried=held.carried, grips=held.grips, felt=felt
    )
