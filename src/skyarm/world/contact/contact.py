"""Contact model of the vehicle, surfaces and movable bodies, with friction bristles
that the plant integrates.

Every point of the vehicle may touch every surface, and so may every spot of a body that
moves in the world (:mod:`skyarm.world.contact.carrier`). What a pair remembers is its
bristle; where a surface moves, there is a clock beside them, since it advances within a
control period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import product, repeat
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from skyarm.algebra import ZERO3, ZERO3_DATA, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import RecordError, concrete, fold_zeros
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import errors_as, must_be_one_of, shown
from skyarm.records.immutable import UNWRITTEN, derived_field, field_if_any, immutable
from skyarm.records.leaves import as_data, rebuild
from skyarm.records.units import Unit, nonnegative
from skyarm.vehicle import Vehicle, VehicleError
from skyarm.world.component import (
    COLLISIONS,
    MOST_STEPS,
    Column,
    Wrench,
    moved_by,
    require_frame,
)
from skyarm.world.contact.carrier import NOBODY
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.contact_point import ContactPoint, wrenches_on
from skyarm.world.contact.contact_steps import ContactSteps
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.gripper import Gripper
from skyarm.world.contact.material import RECOVERY, Material
from skyarm.world.contact.mechanism import Mechanism
from skyarm.world.contact.meetings import Meeting
from skyarm.world.contact.standing_bristles import standing_bristles
from skyarm.world.contact.surface import Surface
from skyarm.world.contact.vehicle_bodies import BodyTouch, VehicleBody, bodies_of

if TYPE_CHECKING:
    from skyarm.world.scene.scene import Instants, Scene

FARTHEST = 0.05
"""Largest distance (m) between a vehicle's frame and the place of its grasp, beyond a
cable's length, at the start; chosen. The usual spring of 5000 N/m begins with 250 N
there."""

STRAIGHT = as_data(Mat3.identity())
"""Rotation by no angle, whose entries may vary."""

TIP = "tip"
"""Default name of the contact point at a vehicle's tip."""

LOGGED = (
    ("force", "N", "of a surface on a point, along its normal"),
    ("friction", "N", "of a surface on a point, across its normal"),
    ("depth", "m", "penetration of a point into a surface"),
)
"""Logged quantities of a surface and a contact point: array, unit, meaning."""

COLLISION_PLACE = "mean place of the force between two bodies, world axes; 0 without"
"""Meaning of a logged array of pairs of bodies."""

MUCH_SHORTER = 2.0
"""Ratio of the vehicle's longest stable step to that of the contact above which a
warning is issued."""


@immutable
class Contact(ContactSteps):
    """Contact model: surfaces, movable bodies, grippers, and the points and shapes of
    the vehicle that may touch them.

    Attributes:
        ignore: pairs that do not touch, named as in logs: "base/ground". A body of a
            vehicle is "base" or its link, of several vehicles behind the vehicle's name
            and a dot.
        vehicle_bodies: bodies of the vehicles that have shapes; :meth:`on` finds them.
        points: contact points of the vehicle; left out for its tip.
        objects: bodies that nothing holds. mechanisms: bodies with one degree of
            freedom.
        grippers: grippers of the vehicle. grasps: joints that hold a body at a frame of
            a vehicle from the start.
    """

    registered_as = "world"

    shared = True

    coupled = True

    geoms: ClassVar[bool] = False
    """True of one whose forces the plant finds between geoms."""

    surfaces: tuple[Surface, ...] = ()
    points: tuple[ContactPoint, ...] = ()
    objects: tuple[FreeObject, ...] = ()
    mechanisms: tuple[Mechanism, ...] = ()
    grippers: tuple[Gripper, ...] = ()
    grasps: tuple[Grasp, ...] = field_if_any(default=())
    self_collision: Annotated[
        bool,
        Unit("", "whether shapes of one vehicle touch each other, but of neighbours"),
    ] = field(default=False, metadata={UNWRITTEN: False})
    ignore: Annotated[
        tuple[str, ...], Unit("", 'pairs that do not touch, such as "base/ground"')
    ] = field_if_any(default=())
    vehicle_material: Annotated[
        Material, Unit("", "material of the vehicles' shapes against each other")
    ] = field(default=Material(), metadata={UNWRITTEN: Material()})
    vehicle_bodies: tuple[VehicleBody, ...] = derived_field()
    rotor_radius: Annotated[
        Scalar,
        nonnegative(
            "m",
            "radius of the rotor discs, for which any contact is a crash; 0: hubs only",
        ),
    ] = 0
    # with 12 a tumbling cylinder is within 1 mm of the converged flight a second after
    # a hit (measured)
    hit_steps: Annotated[
        int,
        Unit(
            "",
            "number of substeps of a physics step while a contact is hit",
            low=1,
            high=100,
            effect="higher values integrate an impact more exactly and take more time",
        ),
    ] = 12

    def __post_init__(self) -> None:
        accept_fields(self, "world")
        fold_zeros(self, "rotor_radius")
        object.__setattr__(
            self,
            # rings are read only here: all else sees single points
            "points",
            tuple(each for point in self.points for each in point.each()),
        )
        self._require_distinct_names()

    def _require_distinct_names(self) -> None:
        """Refuse duplicate names of surfaces, points, objects, mechanisms and grippers,
        and of grasps in a log.
        """
        taken: list[str] = []
        for what in ("surfaces", "points", "objects", "grippers", "mechanisms"):
            names = [each.name for each in getattr(self, what)]
            if what == "mechanisms":
                names += [part.name for each in self.mechanisms for part in each.parts]
            for name in names:
                if names.count(name) > 1 or (
                    # a point may share its name with a surface: a log has both, as
                    # surface/point
                    what not in ("surfaces", "points") and name in taken
                ):
                    raise RecordError(
                        f"world.{what}: name = {shown(name)}: must be of one only"
                    )
            taken += names
        labels = [each.label for each in self.grasps]
        for i, label in enumerate(labels):
            if label in labels[:i]:
                raise RecordError(
                    f"world.grasps[{i}].name = {shown(label)}: must be of one grasp"
                    " only"
                )

    def on(self, vehicles: Mapping[str, Vehicle]) -> Contact:
        """Contact model with the bodies of the vehicles that have shapes.

        The tips of the vehicles are the contact points if no contact point was given.
        The tip of a vehicle that has shapes is none, nor of one that holds a body by a
        grasp: it is where the body is.
        """
        bodies = bodies_of(vehicles, (*self.grippers, *self.grasps))
        masses, own = (
            [each.mass for each in some] for some in (bodies, self.vehicle_bodies)
        )
        # numbers of a batch may vary the masses, whose steps stay those of the scenario
        if bodies != self.vehicle_bodies or (concrete(*masses) and masses != own):
            return replace(self, vehicle_bodies=bodies).on(vehicles)
        # an empty name is that of the only vehicle
        holding = [each.agent or next(iter(vehicles)) for each in self.grasps]
        tips = {
            name: each.end_effector
            for name, each in vehicles.items()
            if name not in holding and each.end_effector and not each.collisions
        }
        # stated points take the place of the tips
        if self.points or not tips:
            return self
        # of one vehicle the short name, as logs and files of one vehicle have it
        points = (
            [ContactPoint(name=TIP, frame=frame) for frame in tips.values()]
            if len(vehicles) == 1
            else [
                ContactPoint(name=f"{name}_{TIP}", frame=frame, agent=name)
                for name, frame in tips.items()
            ]
        )
        return replace(self, points=tuple(points))

    def without_others(self, name: str) -> Contact:
        """Contact model in which a vehicle flies without the others: its ignored pairs,
        without its name.
        """
        own = {each.name for each in replace(self.of_agent(name), ignore=()).body_pairs}
        ignore = [
            f"/{each}".replace(f"/{name}.", "/")[1:]
            for each in self.ignore
            if each in own
        ]
        return replace(self, ignore=tuple(ignore))

    def of_agent(self, name: str) -> Contact:
        """Contact model with the points, grippers and grasps of one vehicle alone."""
        own: dict[str, Any] = {
            kind: tuple(
                each for each in getattr(self, kind) if each.agent in ("", name)
            )
            for kind in ("points", "grippers", "grasps", "vehicle_bodies")
        }
        return replace(self, **own)

    def touching(self, vehicle: Vehicle) -> set[int]:
        """Bodies of a vehicle (BASE or index of a link) that bear contact points,
        grippers or grasps.
        """
        holders: tuple[Gripper | Grasp, ...] = (*self.grippers, *self.grasps)
        links = {vehicle.frame(each.frame or None).link for each in holders}
        links |= {each.body for each in self.vehicle_bodies}
        return links | {point.place(vehicle)[1] for point in self.points}

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a contact model that does not fit a vehicle or needs too short
        integration steps.
        """
        self.require_vehicles({"": vehicle}, period, gravity)

    def require_vehicles(
        self, vehicles: Mapping[str, Vehicle], period: float, gravity: Scalar
    ) -> None:
        """Refuse a contact model that does not fit the vehicles or needs too short
        integration steps.
        """
        carriers = self.carriers
        bodies = {each.name: each for each in carriers}
        for i, grasp in enumerate(self.grasps):
            if grasp.body not in bodies:
                known = (
                    must_be_one_of(bodies, grasp.body)
                    if bodies
                    else "there are no objects or mechanisms"
                )
                raise RecordError(
                    f"world.grasps[{i}].body = {shown(grasp.body)}: {known}"
                )
            with errors_as(RecordError, f"world.grasps[{i}]."):
                bodies[grasp.body].require_near(grasp.place)
        self._require_known_heights()
        pairs = self.body_pairs
        self._require_ignored()
        if not self.surfaces and not carriers and not pairs:
            raise RecordError(
                "world.surfaces: is missing; a world has at least one surface"
            )
        if not self.points and not carriers and not self.vehicle_bodies:
            name = next(iter(vehicles.values())).name
            raise RecordError(f"world.points: is missing; vehicle {name!r} has no tip")
        for i, point in enumerate(self.points):
            vehicle = _vehicle_of(point.agent, vehicles, f"world.points[{i}]")
            of_frame = errors_as(
                RecordError, f"frame = {shown(point.frame)}: ", VehicleError
            )
            with errors_as(RecordError, f"world.points[{i}]."), of_frame:
                point.place(vehicle)
        for i, mechanism in enumerate(self.mechanisms):
            if not mechanism.surfaces:
                where = f"world.mechanisms[{i}].parts"
                raise RecordError(
                    f"{where}: is missing; nothing of {mechanism.name!r} can be touched"
                )
        for kind in ("grippers", "grasps"):
            for i, holder in enumerate(getattr(self, kind)):
                vehicle = _vehicle_of(holder.agent, vehicles, f"world.{kind}[{i}]")
                with errors_as(RecordError, f"world.{kind}[{i}]."):
                    require_frame(vehicle, holder.frame)
                    if kind == "grasps":
                        holder.require_heavy(vehicle)
        if self.grippers and not carriers:
            raise RecordError(
                "world.grippers: must be left out of a world without objects"
            )
        self.require_steps(period / MOST_STEPS)

    def _require_known_heights(self) -> None:
        """Refuse heightfields where the plant does not find the contacts."""
        for of, each in self.every_surface:
            if each.shape == "heightfield" and (of != NOBODY or not self.geoms):
                raise RecordError(
                    f"world.surfaces[{each.name}].shape = 'heightfield': touches on"
                    " MuJoCo's plant alone; plant.kind = 'mujoco' with plant.contact ="
                    " 'geoms' flies it"
                )

    def _require_ignored(self) -> None:
        """Refuse to ignore a pair that there is not, or twice."""
        for i, name in enumerate(self.ignore):
            every = replace(self, ignore=())
            names = [each.name for each in every.body_pairs]
            own = [each.name for each in replace(every, self_collision=True).body_pairs]
            allowed = ""
            if name in self.ignore[:i]:
                allowed = "must stand once"
            elif name not in names and name in own:
                allowed = "is of one vehicle: must be left out, or self_collision true"
            elif name not in names:
                allowed = must_be_one_of(names, name)
            if allowed:
                raise RecordError(f"world.ignore[{i}] = {shown(name)}: {allowed}")

    def require_within_reach(self, motion: PointMotion) -> None:
        """Refuse a grasp whose frame is too far from its place on the body at the
        start, given the vehicles' motion.

        Raises:
            RecordError: one line.
        """
        # neither period nor draws enter the initial state of a contact
        memory = self.start(0.0, ())
        for i, (grasp, _, pull, frame) in enumerate(
            self.gripping.pulls(memory, motion, 0.0)
        ):
            apart = frame.position - pull.place
            far = apart.norm() - grasp.length
            if concrete(far) and far > FARTHEST:
                of = f"frame {grasp.frame or 'tip'} of {grasp.agent or 'the vehicle'}"
                words = (
                    f"{of} starts {far:.3g} m from there, must be within {FARTHEST:g} m"
                )
                raise RecordError(
                    f"world.grasps[{i}].place ="
                    f" {shown([float(c) for c in grasp.place])}: {words}"
                )

    def start(self, period: float, draws: Sequence[Scalar]) -> ContactMemory:
        """Initial internal state: undeflected friction bristles, initial states of
        movable bodies and grippers.
        """
        return ContactMemory(
            finer=(1.0,) if self.hit_steps > 1 else (),
            clock=(0.0,) if any(surface.moves for surface in self.surfaces) else (),
            apart=(0.0,) if self.body_pairs else (),
            bristles=tuple(ZERO3_DATA for _ in range(self.bristle_count)),
            carried=tuple(carrier.start() for carrier in self.carriers),
            grips=tuple(gripper.start() for gripper in self.grippers),
            turns=(STRAIGHT,) * sum(each.kind == "fixed" for each in self.grasps),
            places=as_data(tuple(each.place for each in self.grasps if each.closes)),
        )

    def advance(
        self,
        memory: ContactMemory,
        t: Scalar,
        dt: float,
        state: State,
        draws: Sequence[Scalar],
    ) -> ContactMemory:
        """Internal state of the contact model at the start of a control period."""
        carried = tuple(
            each.advance(body)
            for each, body in zip(self.carriers, memory.carried, strict=True)
        )
        return replace(memory, clock=(t,) if memory.clock else (), carried=carried)

    def on_carriers(
        self,
        memory: ContactMemory,
        motion: PointMotion,
        meetings: Sequence[Meeting],
        t: Scalar,
    ) -> list[tuple[Vec3, Vec3]]:
        """Force (N) and torque (N m) of contacts and grasps on each movable body, about
        the body's origin.
        """
        loads = []
        pushes = self._loads(memory, motion, "carrier", len(self.carriers))
        rows = zip(
            self.carriers,
            memory.carried,
            self.gripping.on_bodies(memory, motion, t),
            strict=True,
        )
        for i, (carrier, body, held) in enumerate(rows):
            origin = carrier.frame(body).position
            force = torque = ZERO3
            for each in meetings:
                if i in (each.of, each.by):
                    # the force is that on the body ``by``; the one whose surface it is
                    # gets the opposite
                    push = each.touch.force if each.by == i else -each.touch.force
                    force = force + push
                    torque = torque + (each.place - origin).cross(push)
            force, torque = force + pushes[i][0], torque + pushes[i][1]
            loads.append((force + held[0], torque + held[1]))
        return loads

    def slope(
        self,
        memory: ContactMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> ContactMemory:
        """Time derivative of the contact model's internal state."""
        meetings = self.meetings(memory, motion)
        rows = zip(
            self.carriers,
            memory.carried,
            self.on_carriers(memory, motion, meetings, t),
            strict=True,
        )
        rest = memory.bristles[len(meetings) :]
        return replace(
            # grippers and grasps change at control instants only
            rebuild(memory, repeat(0.0)),
            clock=tuple(1.0 for _ in memory.clock),
            bristles=as_data(
                (
                    *(each.touch.bristle_rate for each in meetings),
                    *self.with_touches(
                        memory,
                        motion,
                        lambda every: tuple(each.bristle_rate for each in every),
                        tuple(each * -RECOVERY for each in rest),
                    ),
                )
            ),
            carried=tuple(
                carrier.slope(body, *push, motion.gravity)
                for carrier, body, push in rows
            ),
            # zeros within a plant that exerts them itself
            constraints=memory.constraints,
        )

    def before_euler_step(
        self, memory: ContactMemory, slope: ContactMemory, dt: Scalar
    ) -> ContactMemory:
        """Internal state of the contact model with friction bristles advanced, for a
        semi-implicit Euler step.
        """
        rows = zip(self.carriers, memory.carried, slope.carried, strict=True)
        carried = tuple(
            carrier.before_euler_step(body, rate, dt) for carrier, body, rate in rows
        )
        return replace(
            memory,
            bristles=moved_by(memory.bristles, slope.bristles, dt),
            carried=carried,
        )

    def push(
        self,
        memory: ContactMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
        dt: Scalar,
        felt: ContactMemory | None = None,
    ) -> ContactMemory:
        """Internal state of the contact model after forces accelerated the movable
        bodies for ``dt`` (s).
        """
        felt = memory if felt is None else felt
        pushes = self.on_carriers(felt, motion, self.meetings(felt, motion), t)
        rows = zip(self.carriers, memory.carried, pushes, strict=True)
        carried = tuple(
            carrier.after_push(body, *push, motion.gravity, dt)
            for carrier, body, push in rows
        )
        return replace(memory, carried=carried)

    def drift(self, memory: ContactMemory, dt: Scalar) -> ContactMemory:
        """Internal state of the contact model after ``dt`` (s) with constant velocities
        of the movable bodies.
        """
        carried = tuple(
            each.drift(body, dt)
            for each, body in zip(self.carriers, memory.carried, strict=True)
        )
        return replace(
            memory, clock=tuple(t + dt for t in memory.clock), carried=carried
        )

    def euler_step(
        self, memory: ContactMemory, slope: ContactMemory, dt: Scalar
    ) -> ContactMemory:
        """Internal state of the contact model after a semi-implicit Euler step of
        ``dt`` (s).
        """
        rows = zip(self.carriers, memory.carried, slope.carried, strict=True)
        return self.drift(
            replace(
                memory,
                carried=tuple(each.kick(body, rate, dt) for each, body, rate in rows),
            ),
            dt,
        )

    def wrenches(
        self,
        memory: ContactMemory,
        t: Scalar,
        motion: PointMotion,
        rotor_speeds: Sequence[Scalar],
    ) -> Sequence[Wrench]:
        """Forces and torques of all contacts and grasps on the vehicle's bodies."""
        loads = self._loads(memory, motion, "body", len(self.vehicle_bodies))
        acts = where(self.bodies_near(memory, motion), 1.0, 0.0)
        touches = self.on_points(memory, motion)
        pushes = []
        for i in range(len(self.points)):
            force = torque = ZERO3
            # pairs are ordered by surface: every point comes once with each surface
            for each in touches[i :: len(self.points)]:
                force, torque = force + each.force, torque + each.torque
            pushes.append((force, torque))
        return [
            *wrenches_on(self.points, motion, pushes),
            *(
                Wrench(
                    force_W=force,
                    torque_W=torque,
                    body=each.body,
                    agent=each.agent,
                    acts=acts,
                )
                for each, (force, torque) in zip(
                    self.vehicle_bodies, loads, strict=True
                )
            ),
            *self.gripping.wrenches(memory, motion, t),
        ]

    def _loads(
        self, memory: ContactMemory, motion: PointMotion, kind: str, count: int
    ) -> tuple[tuple[Vec3, Vec3], ...]:
        """Force (N) and torque (N m, about its origin) that touches of vehicles' bodies
        exert on each of some bodies.

        Args:
            memory: internal state.
            motion: of all vehicles.
            kind: "carrier" for movable bodies or "body" for those of vehicles.
            count: number of them.
        """
        pairs = self.body_pairs
        none = ((ZERO3, ZERO3),) * count
        if not any(kind in ("body", each.other) for each in pairs):
            return none

        def add_up(touches: Sequence[BodyTouch]) -> tuple[tuple[Vec3, Vec3], ...]:
            loads = [*none]
            for pair, touch in zip(pairs, touches, strict=True):
                if kind == "body":
                    force, torque = loads[pair.body]
                    loads[pair.body] = force + touch.force, torque + touch.torque
                if kind == pair.other:
                    force, torque = loads[pair.index]
                    loads[pair.index] = force - touch.force, torque + touch.back
            return as_data(tuple(loads))

        return self.with_touches(memory, motion, add_up, as_data(none))

    def settle(
        self, memory: ContactMemory, motion: PointMotion, vehicle: bool
    ) -> ContactMemory:
        """Internal state of the contact model in which friction balances the weight of
        bodies that start at rest.
        """
        memory = (
            replace(memory, turns=self.gripping.turns(memory, motion))
            if memory.turns
            else memory
        )
        weights = {
            i: each.mass * motion.gravity
            for i, each in enumerate(self.objects)
            if each.standing
        }
        # points of all vehicles are of NOBODY here: of several no one's weight is known
        if vehicle and len(motion.agents) == 1:
            weights[NOBODY] = motion.vehicle.mass * motion.gravity
        if not weights:
            return memory
        materials = {each.name: each.material for _, each in self.every_surface}
        meetings = self.meetings(memory, motion)
        meetings += self.bodies_at_rest(memory, motion)
        bent = standing_bristles(meetings, memory.bristles, weights, materials)
        return replace(memory, bristles=bent)

    def act(
        self, memory: ContactMemory, t: Scalar, dt: float, motion: PointMotion
    ) -> ContactMemory:
        """Internal state of the contact model after grippers and grasps close, open or
        slip at a control instant.
        """
        return self.gripping.act(memory, t, dt, motion)

    def holds(self, memory: ContactMemory, frame: str, agent: str = "") -> Scalars:
        """Grasp sensor signal of each gripper at a vehicle frame: 1 while the gripper
        holds a body, else 0.
        """
        grips = zip(self.grippers, memory.grips, strict=True)
        ours = [
            grip
            for own, grip in grips
            if own.frame in ("", frame) and own.agent in ("", agent)
        ]
        return tuple(where(grip.taken > 0.5, 1.0, 0.0) for grip in ours)

    def columns_of(self, agent: str) -> Sequence[Column]:
        """Log columns of one vehicle's points, and of all pairs of bodies."""
        own = self.of_agent(agent).columns
        return [
            each for each in self.columns if each in own or each.array in COLLISIONS
        ]

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of contact forces, movable bodies and grippers."""
        labels = [
            f"{surface.name}/{point.name}"
            for _, surface in self.every_surface
            for point in self.points
        ]
        columns = [
            Column(f"contact_{array}", label, unit, meaning)
            for label in labels
            for array, unit, meaning in LOGGED
        ]
        columns += [column for carrier in self.carriers for column in carrier.columns]
        for pair in self.body_pairs:
            columns.append(
                Column("collision_force", pair.name, "N", "normal force of two bodies")
            )
            columns += [
                Column("collision_place", f"{pair.name}/{axis}", "m", COLLISION_PLACE)
                for axis in "xyz"
            ]
        return (*columns, *self.gripping.columns)

    @property
    def constants(self) -> Mapping[str, Scalars]:
        """Hinge axis of the first mechanism, for metrics: a point (m) and a unit
        vector; empty for a slide.
        """
        return {"mechanism_hinge": self.mechanisms[0].hinge} if self.mechanisms else {}

    def logged(self, memory: ContactMemory, motion: PointMotion) -> Scalars:
        """Logged contact forces (N) and penetrations (m), states of movable bodies, and
        gripper forces.
        """
        numbers = [
            number for each in self.on_points(memory, motion) for number in each.logged
        ]
        for carrier, body in zip(self.carriers, memory.carried, strict=True):
            numbers += carrier.logged(body)
        nothing: Scalars = (0.0,) * (4 * len(self.body_pairs))
        numbers += self.with_touches(
            memory,
            motion,
            lambda every: tuple(
                number for each in every for number in (each.normal, *each.place)
            ),
            nothing,
        )
        return (*numbers, *self.gripping.logged(memory, motion))

    def shapes(self, seen: Instants) -> Scene:
        """Shapes of surfaces and movable bodies, and arrows of contact forces, for
        pictures.
        """
        from skyarm.world.contact.contact_scene import contact_scene

        return contact_scene(self, seen)

    def warnings(self, vehicle: Vehicle, step: float) -> Sequence[str]:
        """Warnings about contact that needs very short steps, and about ball grippers
        that hold objects tilted.
        """
        pairs = product(self.grippers, self.objects)
        tilted = [
            line
            for hand, it in pairs
            for line in hand.tilt_warning(it.name, it.mass, it.half_width)
        ]
        if not self.steps:
            return tuple(tilted)
        what, bound = min(self.steps, key=lambda each: float(each[1]))
        least = float(bound)
        # steps near those of the vehicle cost little more time
        if not MUCH_SHORTER * least < step:
            return tilted
        return (
            *tilted,
            (
                f"{what} asks for integration steps of {1e3 * least:.2g} ms in contact;"
                f" they are taken by themselves, about {step / least:.0f} in place of"
                " each of rates.physics, and cost that much more; is it so light, or"
                " its contact so stiff?"
            ),
        )


def _vehicle_of(agent: str, vehicles: Mapping[str, Vehicle], where: str) -> Vehicle:
    """Vehicle that a point, gripper or grasp is on.

    Raises:
        RecordError: one line: there is no such vehicle, or none is named of several.
    """
    if agent in vehicles:
        return vehicles[agent]
    # one vehicle needs no name; under an empty name any vehicle is meant
    if (not agent and len(vehicles) == 1) or "" in vehicles:
        return next(iter(vehicles.values()))
    if not agent:
        raise RecordError(
            f"{where}.agent: is missing; must be one of {', '.join(vehicles)}"
        )
    raise RecordError(
        f"{where}.agent = {shown(agent)}: {must_be_one_of(vehicles, agent)}"
    )
