"""Contact of a vehicle with the surfaces of a scenario: a force whose bristles move with the plant.

Every point may touch every surface. What a pair remembers is its bristle; where a surface moves, there is a clock
beside them, since it goes on within a control period. Bodies that move in the world (:mod:`skyarm.contact.carrier`)
have their motion there, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from skyarm.algebra import ZERO3, Vec3
from skyarm.contact.carrier import NOBODY, Carried, Carrier, Meeting, untouched_after
from skyarm.contact.contact_point import ContactPoint, Touch, moving_points, touch_of, wrenches_on
from skyarm.contact.free_object import FreeObject
from skyarm.contact.gripper import UNCHANGED, Grasps, Grip, Gripper
from skyarm.contact.material import RECOVERY
from skyarm.contact.mechanism import Mechanism
from skyarm.contact.surface import Surface
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.environment.component import Force, Wrench, moved_by
from skyarm.files import shown
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.units import Unit
from skyarm.scalars import Scalar, data, exp, logical_and, maximum, minimum, neg, sqrt
from skyarm.vehicle.check import VehicleError
from skyarm.vehicle.vehicle_records import Vehicle

NEAR, SWIFT = 0.005, 400.0
"""m that a point stays away from a surface at least while longer steps are taken, and m/s^2 that it may accelerate by
meanwhile: both are the same in 5 ms, longer periods ask for more."""

TIP = "tip"
"""Name of the point that a vehicle with a tip has where nothing is said of its points."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ContactMemory:
    """Memory of a contact.

    Attributes:
        clock: s, of surfaces that move; empty where none does.
        bristles: deflection of each pair's bristle, m, world axes: the first surface's points, then the next one's;
            then those of the carriers' pairs (:class:`skyarm.contact.carrier.Carried`).
        carried: memories of the carriers. grips: of the grippers.
    """

    clock: tuple[Any, ...]
    bristles: tuple[Vec3, ...]
    carried: tuple[Any, ...] = ()
    grips: tuple[Grip, ...] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Contact(Force):
    """Surfaces of the world and the points of the vehicle that they push back.

    Attributes:
        points: left out for the vehicle's tip.
        objects: bodies that nothing holds. mechanisms: bodies with one degree of freedom.
        grippers: what the vehicle takes hold of them with.
    """

    surfaces: tuple[Surface, ...] = ()
    points: tuple[ContactPoint, ...] = ()
    objects: tuple[FreeObject, ...] = ()
    mechanisms: tuple[Mechanism, ...] = ()
    grippers: tuple[Gripper, ...] = ()
    rotor_radius: Annotated[Scalar, Unit("m", "of the rotors' discs, which may touch nothing; 0: hubs", low=0.0)] = 0

    def __post_init__(self) -> None:
        accept_fields(self, "world")
        if type(self.rotor_radius) is float and self.rotor_radius == 0.0:
            object.__setattr__(self, "rotor_radius", 0)
        object.__setattr__(self, "points", tuple(each for point in self.points for each in point.each()))
        require_names_apart(self)

    @property
    def coupled(self) -> bool:  # type: ignore[override]
        """Bristles and clock go on within a control period."""
        return True

    @property
    def carriers(self) -> tuple[Carrier, ...]:
        """Everything that moves and carries surfaces, in the order of the memory."""
        return (*self.objects, *self.mechanisms)

    @property
    def carried(self) -> Carried:
        """The carriers with what they may touch."""
        return Carried(carriers=self.carriers, surfaces=self.surfaces, points=self.points)

    @property
    def grasps(self) -> Grasps:
        """The grippers with what they may hold."""
        return Grasps(grippers=self.grippers, carriers=self.carriers)

    @property
    def steps(self) -> tuple[tuple[str, Any], ...]:
        """What asks for an integration step, in words, and the longest that it bears, s."""
        return asked_steps(self)

    @property
    def largest_step(self) -> Any:  # type: ignore[override]
        """Longest integration step (s) that everything bears; None of an empty world."""
        return least(step for _, step in self.steps)

    @property
    def largest_euler_step(self) -> Any:
        """The same of the semi-implicit Euler method: damping of friction and grasps counts, too."""
        return euler_step(self)

    @property
    def largest_verlet_step(self) -> Any:
        """The same of the Stoermer-Verlet method, which takes forces once a step."""
        return verlet_step(self)

    def on(self, vehicle: Vehicle) -> Contact:
        """The contact with the vehicle's tip as its point where none is named."""
        if self.points or not vehicle.end_effector:
            return self
        return replace(self, points=(ContactPoint(name=TIP, frame=vehicle.end_effector),))

    @property
    def pairs(self) -> tuple[tuple[Surface, ContactPoint], ...]:
        """Every surface with every point, in the order of the bristles."""
        return tuple((surface, point) for surface in self.surfaces for point in self.points)

    @property
    def logged_pairs(self) -> int:
        """How many pairs of a surface and a point of the vehicle a log has columns of."""
        carried = sum(len(carrier.surfaces) for carrier in self.carriers)
        return (len(self.surfaces) + carried) * len(self.points)

    @property
    def still(self) -> tuple[Surface, ...]:
        """Surfaces that do not move."""
        return tuple(surface for surface in self.surfaces if not surface.moves)

    def check(self, vehicle: Vehicle) -> None:
        """Raise ValueError with one line unless the vehicle has the points."""
        require_on_vehicle(self, vehicle)

    def start(self, period: float, draws: Sequence[Any]) -> ContactMemory:
        """Upright bristles at t = 0, and every carrier where it starts."""
        clock = (0.0,) if any(surface.moves for surface in self.surfaces) else ()
        upright = tuple(Vec3(0.0, 0.0, 0.0) for _ in range(len(self.pairs) + self.carried.count))
        return ContactMemory(
            clock=clock, bristles=upright, carried=tuple(carrier.start() for carrier in self.carriers),
            grips=tuple(gripper.start() for gripper in self.grippers),
        )  # fmt: skip

    def advance(self, memory: Any, t: Any, dt: float, state: State, draws: Sequence[Any]) -> Any:
        """The clock set anew, and attitudes in unit length, so that steps leave no rounding in them."""
        carried = tuple(each.advance(held) for each, held in zip(self.carriers, memory.carried, strict=True))
        return (
            replace(memory, clock=(t,) if memory.clock else (), carried=carried) if memory.clock or carried else memory
        )

    def _step(self, motion: PointMotion) -> Any:
        """Integration step (s) that forces are taken for: the plant's, or the longest of the contact."""
        return self.largest_step if motion.step is None else motion.step

    def touches(self, memory: Any, motion: PointMotion) -> list[Touch]:
        """What happens at every pair now."""
        found, moving = [], moving_points(self.points, motion)
        bristles, clock, step = iter(memory.bristles), (*memory.clock, 0.0)[0], self._step(motion)
        for surface in self.surfaces:
            material, surface_velocity = surface.material, surface.place(clock)[1]
            for point, (position, velocity, turning) in zip(self.points, moving, strict=True):
                depth, n = surface.depth(position, point.radius, clock)
                spot = n * neg(point.radius)  # where it touches, seen from its middle
                slip = velocity + turning.cross(spot) - surface_velocity
                found.append(touch_of(material, depth, n, spot, slip, next(bristles), step, mean=motion.step))
        return found

    def meetings(self, memory: Any, motion: PointMotion) -> list[Meeting]:
        """What happens now at every pair of which a carrier is one."""
        if not self.carriers:
            return []
        moving = moving_points(self.points, motion)
        clock, bristles = (*memory.clock, 0.0)[0], memory.bristles[len(self.pairs) :]
        return self.carried.meetings(memory.carried, moving, clock, bristles, self._step(motion))

    def slope(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> ContactMemory:
        """Rate of the memory."""
        meetings = self.meetings(memory, motion)
        touches = (*self.touches(memory, motion), *(each.touch for each in meetings))
        going = zip(self.carriers, memory.carried, self._pushes(memory, motion, meetings), strict=True)
        return ContactMemory(
            clock=tuple(1.0 for _ in memory.clock),
            bristles=tuple(Vec3(*(data(c) for c in touch.bristle_rate)) for touch in touches),
            carried=tuple(carrier.slope(held, *push, motion.gravity) for carrier, held, push in going),
            grips=tuple(UNCHANGED for _ in memory.grips),
        )

    def _pushes(self, memory: Any, motion: PointMotion, meetings: Sequence[Meeting]) -> list[tuple[Vec3, Vec3]]:
        """Force (N) on each carrier and torque (N m) about the origin of its axes, world axes."""
        pushes = self.carried.pushes(memory.carried, meetings)
        if not self.grippers:
            return pushes
        pulls = self.grasps.on_bodies(memory, motion)
        return [(f + g, t + u) for (f, t), (g, u) in zip(pushes, pulls, strict=True)]

    def before_euler_step(self, memory: Any, slope: Any, dt: Any) -> ContactMemory:
        """Bristles have moved by the velocities that the last step left: by those before it, friction would chatter."""
        going = zip(self.carriers, memory.carried, slope.carried, strict=True)
        bent = moved_by(memory.bristles, slope.bristles, dt)
        carried = tuple(carrier.before_euler_step(held, rate, dt) for carrier, held, rate in going)
        return ContactMemory(clock=memory.clock, bristles=bent, carried=carried, grips=memory.grips)

    def push(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any], dt: Any) -> ContactMemory:
        """Bodies are pushed by touches and grasps; bristles have moved before."""
        pushes = self._pushes(memory, motion, self.meetings(memory, motion))
        going = zip(self.carriers, memory.carried, pushes, strict=True)
        carried = tuple(carrier.pushed(held, *push, motion.gravity, dt) for carrier, held, push in going)
        return ContactMemory(clock=memory.clock, bristles=memory.bristles, carried=carried, grips=memory.grips)

    def drift(self, memory: Any, dt: Any) -> ContactMemory:
        """The clock and the bodies go on."""
        going = zip(self.carriers, memory.carried, strict=True)
        return ContactMemory(
            clock=tuple(t + dt for t in memory.clock),
            bristles=memory.bristles,
            carried=tuple(carrier.drift(held, dt) for carrier, held in going),
            grips=memory.grips,
        )

    def euler_step(self, memory: Any, slope: Any, dt: Any) -> ContactMemory:
        """Memory after a semi-implicit Euler step, in which bodies go on with their new velocities."""
        going = zip(self.carriers, memory.carried, slope.carried, strict=True)
        carried = tuple(carrier.kick(held, rate, dt) for carrier, held, rate in going)
        pushed = ContactMemory(clock=memory.clock, bristles=memory.bristles, carried=carried, grips=memory.grips)
        return self.drift(pushed, dt)

    def wrenches(self, memory: Any, t: Any, motion: PointMotion, rotor_speeds: Sequence[Any]) -> Sequence[Wrench]:
        """What touches does to the bodies of the points, and what grippers do."""
        touches, meetings = self.touches(memory, motion), self.meetings(memory, motion)
        pushes = []
        for i in range(len(self.points)):
            force = torque = ZERO3
            own = [each.touch for each in meetings if each.by == NOBODY and each.index == i]
            for touch in (*touches[i :: len(self.points)], *own):
                force, torque = force + touch.force, torque + touch.spot.cross(touch.force)
            pushes.append((force, torque))
        return wrenches_on(self.points, motion, pushes) + self.grasps.on_vehicle(memory, motion)

    def act(self, memory: Any, t: Any, motion: PointMotion) -> Any:
        """Grippers take hold, let go and give way."""
        return replace(memory, grips=self.grasps.after(memory, t, motion)) if self.grippers else memory

    def far(self, memory: Any, motion: PointMotion, seconds: Any) -> Any:
        """Whether no point or spot comes near to a surface within so many seconds, wherever its velocity leads.

        Its whole speed counts, and not only what brings it nearer to the nearest place: force may still act where it
        leaves, and in a hole another wall may be in its way. What a gripper holds is near.
        """
        found: Any = True
        margin = maximum(NEAR, 0.5 * SWIFT * seconds * seconds)
        for grip in memory.grips:
            found = grip.taken < 0.5 if found is True else logical_and(found, grip.taken < 0.5)
        for touch in (*self.touches(memory, motion), *(each.touch for each in self.meetings(memory, motion))):
            away = touch.depth + sqrt(touch.slip.dot(touch.slip)) * seconds < -margin
            found = away if found is True else logical_and(found, away)
        return found

    def alone(self, memory: Any, seconds: Any, rounds: int, gravity: Any) -> ContactMemory:
        """The clock goes on, bristles stand up, bodies move untouched."""
        left = exp(-RECOVERY * seconds)
        bodies = zip(self.carriers, memory.carried, strict=True)
        return ContactMemory(
            clock=tuple(t + seconds for t in memory.clock),
            bristles=tuple(bristle * left for bristle in memory.bristles),
            carried=tuple(untouched_after(each, held, seconds / rounds, rounds, gravity) for each, held in bodies),
            grips=memory.grips,
        )

    def logged(self, memory: Any, motion: PointMotion) -> tuple[Any, ...]:
        """Normal force (N), friction (N) and penetration (m) of each pair, one after the other; zeros outside.

        Behind them stand the carriers' numbers, then the grippers'.
        """
        numbers: list[Any] = []
        own = [each.touch for each in self.meetings(memory, motion) if each.by == NOBODY]
        for touch in (*self.touches(memory, motion), *own):
            friction = touch.friction
            numbers += [touch.normal, sqrt(friction.dot(friction)), maximum(touch.depth, 0.0)]
        for carrier, held in zip(self.carriers, memory.carried, strict=True):
            numbers += carrier.logged(held)
        return (*numbers, *self.grasps.logged(memory, motion))


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


VERLET_SHARE = 0.75
"""Of a semi-implicit Euler step in one of the Stoermer-Verlet method. An elastic bounce of a limp vehicle on its tip
then errs by 0.006 % of its energy at any phase of the steps, and by 0.014 % at a share of 1 (measured); sticking holds
up to 13 N on a tip of 20 g at a friction of 0.6, as stability of the bristle has it, where a share of 1 leaves 7 N."""


def asked_steps(contact: Contact) -> tuple[tuple[str, Any], ...]:
    """What asks for an integration step, in words, and the longest that it bears, s."""
    touched = contact.surfaces if contact.points or not contact.carriers else ()
    own = [(f"the material of surface {each.name!r}", each.material.largest_step) for each in touched]
    inner = [(f"mechanism {c.name!r}", c.largest_step) for c in contact.carriers if c.largest_step is not None]
    return (*own, *contact.carried.steps(), *contact.grasps.steps(), *inner)


def euler_step(contact: Contact) -> Any:
    """Longest step (s) of the semi-implicit Euler method; None of an empty world."""
    grasped = [step for _, step in contact.grasps.steps(euler=True)]
    inner = [each.largest_euler_step for each in contact.carriers if each.largest_euler_step is not None]
    return least((*(step for _, step in contact.steps), *grasped, *inner))


def verlet_step(contact: Contact) -> Any:
    """Longest step (s) of the Stoermer-Verlet method; None of an empty world."""
    step = contact.largest_euler_step
    return None if step is None else VERLET_SHARE * step


def least(steps: Iterable[Any]) -> Any:
    """The smallest of some steps (s); None of none."""
    smallest = None
    for each in steps:
        smallest = each if smallest is None else minimum(smallest, each)
    return smallest
