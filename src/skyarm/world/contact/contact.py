"""Contact model of the vehicle, surfaces and movable bodies, with friction bristles that the plant integrates.

Every point of the vehicle may touch every surface, and so may every spot of a body that moves in the world
(:mod:`skyarm.world.contact.carrier`). What a pair remembers is its bristle; where a surface moves, there is a clock
beside them, since it advances within a control period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from skyarm.algebra import ZERO3, ZERO3_DATA, Mat3, Scalar, Scalars, Vec3
from skyarm.algebra import Force as Wrench6
from skyarm.algebra.scalars import clip, data, exp, logical_and, maximum, sqrt, where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import RecordError, concrete, fold_zeros
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import errors_as, must_be_one_of, shown
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import blend, leaves
from skyarm.records.units import Unit, nonnegative
from skyarm.vehicle import Vehicle, VehicleError
from skyarm.world.component import MOST_STEPS, Column, Force, Wrench, moved_by
from skyarm.world.contact.box_edges import EDGE_PAIRS, pairs_with_edges
from skyarm.world.contact.carrier import NOBODY, AnyCarrier, CarriedFrame, untouched_after
from skyarm.world.contact.contact_point import ContactPoint, Touch, moving_points, wrenches_on
from skyarm.world.contact.contact_steps import least_of, steps_of_carriers
from skyarm.world.contact.free_object import FreeObject
from skyarm.world.contact.grasp import Grasp, Pull
from skyarm.world.contact.gripper import UNCHANGED, Grasps, Grip, Gripper
from skyarm.world.contact.material import RECOVERY
from skyarm.world.contact.mechanism import Mechanism
from skyarm.world.contact.meetings import Meeting, meetings_of, misses
from skyarm.world.contact.standing_bristles import standing_bristles
from skyarm.world.contact.surface import Surface

if TYPE_CHECKING:
    from skyarm.world.scene.scene import Instants, Scene

FARTHEST = 0.05
"""Largest distance (m) between a vehicle's frame and the place of its grasp, beyond a cable's length, at the start."""

P = TypeVar("P", ContactPoint, Gripper, Grasp)

STRAIGHT = Mat3(Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0), Vec3(0.0, 0.0, 1.0))
"""Rotation by no angle, whose entries may vary."""

HIT = 1.2
"""Impact speed (m/s) above which steps are finest; slower impacts use proportionally longer steps."""

REGROWTH = 0.1
"""Time constant (s) in which steps grow again after an impact."""

CALM_FOR = 2.0
"""Number of control periods in which nothing may be reached where steps are those of grasps alone."""

TIP = "tip"
"""Default name of the contact point at a vehicle's tip."""

LOGGED = (
    ("force", "N", "of a surface on a point, along its normal"),
    ("friction", "N", "of a surface on a point, across its normal"),
    ("depth", "m", "penetration of a point into a surface"),
)
"""Logged quantities of a surface and a contact point: array, unit, meaning."""

MUCH_SHORTER = 2.0
"""Ratio of the vehicle's longest stable step to that of the contact above which a warning is issued."""

VERLET_SHARE = 0.75
"""Step of the Stoermer-Verlet method as a fraction of that of semi-implicit Euler. An elastic bounce then changes
the energy by 0.006 % at any phase of the steps, and by 0.014 % at a fraction of 1 (measured). Sticking is stable
up to 13 N on a tip of 20 g at a friction of 0.6, against 7 N at a fraction of 1."""


@immutable
class ContactMemory:
    """Internal state of the contact model: time of moving surfaces, friction bristles, movable bodies and grippers.

    Attributes:
        finer: steps in the place of one in this interval; empty where hits take no more.
        clock: s, of surfaces that move; empty where none does.
        bristles: deflection of each pair's bristle, m, world axes, in the order of
            :func:`skyarm.world.contact.meetings.meetings_of`.
        carried: memories of the carriers. grips: memories of the grippers.
        turns: attitudes that fixed grasps keep, from the axes of the body to those of the vehicle's frame.
        places: places on their bodies at which grasps with ``close`` have closed, m.
        constraints: force and torque on the body of each grasp that the plant closes; empty where grasps are springs.
    """

    finer: Scalars
    clock: Scalars
    bristles: tuple[Vec3, ...]
    carried: tuple[Any, ...] = ()
    grips: tuple[Grip, ...] = ()
    turns: tuple[Mat3, ...] = ()
    places: tuple[Vec3, ...] = ()
    constraints: tuple[Wrench6, ...] = ()


@immutable
class Contact(Force[ContactMemory]):
    """Contact model: surfaces, movable bodies, grippers and the points of the vehicle that may touch them.

    Attributes:
        points: contact points of the vehicle; left out for its tip.
        objects: bodies that nothing holds. mechanisms: bodies with one degree of freedom.
        grippers: grippers of the vehicle. grasps: joints that hold a body at a frame of a vehicle from the start.
    """

    registered_as = "world"

    shared = True

    surfaces: tuple[Surface, ...] = ()
    points: tuple[ContactPoint, ...] = ()
    objects: tuple[FreeObject, ...] = ()
    mechanisms: tuple[Mechanism, ...] = ()
    grippers: tuple[Gripper, ...] = ()
    grasps: tuple[Grasp, ...] = field_if_any(default=())
    rotor_radius: Annotated[
        Scalar, nonnegative("m", "radius of the rotor discs, for which any contact is a crash; 0: hubs only")
    ] = 0
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
        object.__setattr__(self, "points", tuple(each for point in self.points for each in point.each()))
        self._require_distinct_names()

    def _require_distinct_names(self) -> None:
        """Refuse duplicate names of surfaces, points, objects, mechanisms and grippers, and of grasps in a log."""
        taken: list[str] = []
        for what in ("surfaces", "points", "objects", "grippers", "mechanisms"):
            names = [each.name for each in getattr(self, what)]
            if what == "mechanisms":
                names += [part.name for each in self.mechanisms for part in each.parts]
            for name in names:
                if names.count(name) > 1 or (what not in ("surfaces", "points") and name in taken):
                    raise RecordError(f"world.{what}: name = {shown(name)}: must be of one only")
            taken += names
        labels = [each.label for each in self.grasps]
        for i, label in enumerate(labels):
            if label in labels[:i]:
                raise RecordError(f"world.grasps[{i}].name = {shown(label)}: must be of one grasp only")

    @property
    def coupled(self) -> bool:  # type: ignore[override]
        """Always true: friction and movable bodies are integrated together with the vehicle."""
        return True

    @property
    def carriers(self) -> tuple[AnyCarrier, ...]:
        """All movable bodies with contact surfaces: free objects, then mechanisms."""
        return (*self.objects, *self.mechanisms)

    @property
    def every_surface(self) -> tuple[tuple[int, Surface], ...]:
        """All contact surfaces, each with the index of its movable body, or ``NOBODY`` for a surface of the world."""
        carried = ((of, each) for of, carrier in enumerate(self.carriers) for each in carrier.surfaces)
        return (*((NOBODY, each) for each in self.surfaces), *carried)

    @property
    def gripping(self) -> Grasps:
        """Grippers of the vehicle combined with the movable bodies that they can grasp."""
        return Grasps(grippers=self.grippers, carriers=self.carriers)

    @property
    def steps(self) -> tuple[tuple[str, Scalar], ...]:
        """Longest stable integration step (s) of each contact, grasp and mechanism, each with a describing text."""
        carriers = self.carriers
        touched = self.surfaces if self.points or not carriers else ()
        own = [(f"the material of surface {each.name!r}", each.material.largest_step) for each in touched]
        inner = [(f"mechanism {c.name!r}", c.largest_step) for c in carriers if c.largest_step is not None]
        return (
            *own,
            *steps_of_carriers(carriers, self.surfaces, points=bool(self.points)),
            *self.gripping.steps(),
            *self._steps_of_grasps(),
            *inner,
        )

    @property
    def largest_step(self) -> Scalar | None:  # type: ignore[override]
        """Longest stable integration step (s) of the whole contact model; None without contact."""
        return least_of(step for _, step in self.steps)

    @property
    def largest_euler_step(self) -> Scalar | None:
        """Longest stable semi-implicit Euler step (s) of the whole contact model; None without contact."""
        grasped = [step for _, step in (*self.gripping.steps(euler=True), *self._steps_of_grasps(euler=True))]
        inner = [each.largest_euler_step for each in self.carriers if each.largest_euler_step is not None]
        return least_of((*(step for _, step in self.steps), *grasped, *inner))

    @property
    def largest_verlet_step(self) -> Scalar | None:
        """Longest stable Stoermer-Verlet step (s) of the whole contact model; None without contact."""
        step = self.largest_euler_step
        return None if step is None else VERLET_SHARE * step

    @property
    def largest_calm_step(self) -> Scalar | None:  # type: ignore[override]
        """Longest stable integration step (s) while no body is near another, of a model with grasps; else None."""
        return self._calm_step(euler=False)

    @property
    def largest_calm_verlet_step(self) -> Scalar | None:  # type: ignore[override]
        """Longest stable Stoermer-Verlet step (s) while no body is near another, of a model with grasps; else None."""
        step = self._calm_step(euler=True)
        return None if step is None else VERLET_SHARE * step

    def _calm_step(self, *, euler: bool) -> Scalar | None:
        held = [step for _, step in (*self.gripping.steps(euler=euler), *self._steps_of_grasps(euler=euler))]
        inner = [each.largest_euler_step if euler else each.largest_step for each in self.carriers]
        return least_of((*held, *(step for step in inner if step is not None))) if self.grasps else None

    def _steps_of_grasps(self, *, euler: bool = False) -> list[tuple[str, Scalar]]:
        """Longest stable integration step (s) of each grasp of a body that exists."""
        bodies = {each.name: each for each in self.carriers}
        rows = []
        for each in self.grasps:
            if each.body in bodies:
                together = [other for other in self.grasps if other.body == each.body]
                rows.append((f"grasp {each.label!r}", each.step_of(bodies[each.body], together, euler=euler)))
        return rows

    def on(self, vehicles: Mapping[str, Vehicle]) -> Contact:
        """Contact model in which the tips of the vehicles are the contact points if no contact point was given.

        The tip of a vehicle that holds a body by a grasp is none: it is where the body is.
        """
        holding = [each.agent or next(iter(vehicles)) for each in self.grasps]
        tips = {name: each.end_effector for name, each in vehicles.items() if name not in holding and each.end_effector}
        if self.points or not tips:
            return self
        if len(vehicles) == 1:
            return replace(self, points=tuple(ContactPoint(name=TIP, frame=frame) for frame in tips.values()))
        points = [ContactPoint(name=f"{name}_{TIP}", frame=frame, agent=name) for name, frame in tips.items()]
        return replace(self, points=tuple(points))

    def of_agent(self, name: str) -> Contact:
        """Contact model with the points, grippers and grasps of one vehicle alone."""

        def own(parts: tuple[P, ...]) -> tuple[P, ...]:
            return tuple(each for each in parts if each.agent in ("", name))

        return replace(self, points=own(self.points), grippers=own(self.grippers), grasps=own(self.grasps))

    def touching(self, vehicle: Vehicle) -> set[int]:
        """Bodies of a vehicle (BASE or index of a link) that bear contact points, grippers or grasps."""
        frames = (each.frame or None for each in self.grippers), (each.frame or None for each in self.grasps)
        links = {vehicle.frame(name).link for names in frames for name in names}
        return links | {point.place(vehicle)[1] for point in self.points}

    @property
    def logged_pairs(self) -> int:
        """Number of surface-point pairs whose contact forces are logged."""
        return len(self.every_surface) * len(self.points)

    @property
    def meeting_count(self) -> int:
        """Number of all contact pairs of surfaces with points of the vehicle and of movable bodies."""
        every = len(self.every_surface)
        spots = sum(each.spot_count * (every - len(each.surfaces)) for each in self.carriers)
        edges = EDGE_PAIRS * sum(1 for _ in pairs_with_edges(self.every_surface, self.carriers))
        return self.logged_pairs + spots + edges

    @property
    def still(self) -> tuple[Surface, ...]:
        """Surfaces of the world that do not move during the flight."""
        return tuple(surface for surface in self.surfaces if not surface.moves)

    def require_vehicle(self, vehicle: Vehicle, period: float, gravity: Scalar) -> None:
        """Refuse a contact model that does not fit a vehicle or needs too short integration steps."""
        self.require_vehicles({"": vehicle}, period, gravity)

    def require_vehicles(self, vehicles: Mapping[str, Vehicle], period: float, gravity: Scalar) -> None:
        """Refuse a contact model that does not fit the vehicles or needs too short integration steps."""
        carriers = self.carriers
        bodies = {each.name: each for each in carriers}
        for i, grasp in enumerate(self.grasps):
            if grasp.body not in bodies:
                known = must_be_one_of(bodies, grasp.body) if bodies else "there are no objects or mechanisms"
                raise RecordError(f"world.grasps[{i}].body = {shown(grasp.body)}: {known}")
            with errors_as(RecordError, f"world.grasps[{i}]."):
                bodies[grasp.body].require_near(grasp.place)
        if not self.surfaces and not carriers:
            raise RecordError("world.surfaces: is missing; a world has at least one surface")
        if not self.points and not carriers:
            name = next(iter(vehicles.values())).name
            raise RecordError(f"world.points: is missing; vehicle {name!r} has no tip")
        for i, point in enumerate(self.points):
            vehicle = _vehicle_of(point.agent, vehicles, f"world.points[{i}]")
            try:
                point.place(vehicle)
            except VehicleError as error:
                raise RecordError(f"world.points[{i}].frame = {shown(point.frame)}: {error}") from None
            except ValueError as error:
                raise RecordError(f"world.points[{i}].{error}") from None
        for i, mechanism in enumerate(self.mechanisms):
            if not mechanism.surfaces:
                where = f"world.mechanisms[{i}].parts"
                raise RecordError(f"{where}: is missing; nothing of {mechanism.name!r} can be touched")
        holders: list[tuple[str, Gripper | Grasp]] = [(f"grippers[{i}]", each) for i, each in enumerate(self.grippers)]
        holders += [(f"grasps[{i}]", each) for i, each in enumerate(self.grasps)]
        for at, holder in holders:
            vehicle = _vehicle_of(holder.agent, vehicles, f"world.{at}")
            with errors_as(RecordError, f"world.{at}.frame = {shown(holder.frame)}: ", VehicleError):
                vehicle.frame(holder.frame or None)
            if isinstance(holder, Grasp):
                with errors_as(RecordError, f"world.{at}."):
                    holder.require_heavy(vehicle)
        if self.grippers and not carriers:
            raise RecordError("world.grippers: must be left out of a world without objects")
        self.require_steps(period / MOST_STEPS)

    def require_within_reach(self, motion: PointMotion) -> None:
        """Refuse a grasp whose frame is too far from its place on the body at the start, given the vehicles' motion.

        Raises:
            RecordError: one line.
        """
        memory = self.start(0.0, ())
        for i, (grasp, _, pull, frame) in enumerate(self.pulls(memory, motion, 0.0)):
            apart = frame.position - pull.place
            far = sqrt(apart.dot(apart)) - grasp.length
            if concrete(far) and far > FARTHEST:
                of = f"frame {grasp.frame or 'tip'} of {grasp.agent or 'the vehicle'}"
                words = f"{of} starts {far:.3g} m from there, must be within {FARTHEST:g} m"
                raise RecordError(f"world.grasps[{i}].place = {shown([float(c) for c in grasp.place])}: {words}")

    def require_steps(self, least: float) -> None:
        """Refuse a contact model that needs integration steps shorter than ``least`` (s)."""
        if not concrete(*leaves(self)):
            return  # of a batch: its lanes are looked at one by one
        allowed = f"must leave them {least:g} s or more, a thousandth of the control period"
        try:
            steps = [(what, float(step)) for what, step in self.steps]
        except ArithmeticError:  # of numbers beyond measure
            raise RecordError(f"world: has no integration steps in contact: {allowed}") from None
        for what, step in steps:
            if not step >= least:
                raise RecordError(f"world: {what} asks for integration steps of {step:.2g} s in contact: {allowed}")

    def start(self, period: float, draws: Sequence[Scalar]) -> ContactMemory:
        """Initial internal state: undeflected friction bristles, initial states of movable bodies and grippers."""
        return ContactMemory(
            finer=(1.0,) if self.hit_steps > 1 else (),
            clock=(0.0,) if any(surface.moves for surface in self.surfaces) else (),
            bristles=tuple(ZERO3_DATA for _ in range(self.meeting_count)),
            carried=tuple(carrier.start() for carrier in self.carriers),
            grips=tuple(gripper.start() for gripper in self.grippers),
            turns=(STRAIGHT,) * sum(each.kind == "fixed" for each in self.grasps),
            places=tuple(Vec3(*map(data, each.place)) for each in self.grasps if each.closes),
        )

    def advance(
        self, memory: ContactMemory, t: Scalar, dt: float, state: State, draws: Sequence[Scalar]
    ) -> ContactMemory:
        """Internal state of the contact model at the start of a control period."""
        if not memory.clock and not memory.carried:
            return memory
        carried = tuple(each.advance(body) for each, body in zip(self.carriers, memory.carried, strict=True))
        return replace(memory, clock=(t,) if memory.clock else (), carried=carried)

    def meetings(self, memory: ContactMemory, motion: PointMotion) -> list[Meeting]:
        """Contact state of every contact pair for the vehicle's current motion."""
        step = self.largest_step if motion.step is None else motion.step
        moving, clock = moving_points(self.points, motion), (*memory.clock, 0.0)[0]
        return meetings_of(self, memory.carried, moving, clock, memory.bristles, step, motion.step)

    def on_points(self, memory: ContactMemory, motion: PointMotion) -> Sequence[Touch]:
        """Contact states of all pairs of a surface and a contact point of the vehicle, ordered by surface."""
        return [each.touch for each in self.meetings(memory, motion)[: self.logged_pairs]]

    def on_carriers(
        self, memory: ContactMemory, motion: PointMotion, meetings: Sequence[Meeting], t: Scalar
    ) -> list[tuple[Vec3, Vec3]]:
        """Force (N) and torque (N m) of contacts and grasps on each movable body, about the body's origin."""
        pulls: list[tuple[Vec3, Vec3] | None] = [None] * len(self.carriers)
        if self.grippers:
            pulls = [*self.gripping.on_bodies(memory.grips, memory.carried, motion)]
        for _, index, pull, _ in self.pulls(memory, motion, t):
            origin = self.carriers[index].frame(memory.carried[index]).position
            turning = pull.torque + (pull.place - origin).cross(pull.force)
            force, torque = pulls[index] or (ZERO3, ZERO3)
            pulls[index] = force + pull.force, torque + turning
        loads = []
        for i, (carrier, body, grasped) in enumerate(zip(self.carriers, memory.carried, pulls, strict=True)):
            origin, force, torque = carrier.frame(body).position, ZERO3, ZERO3
            for each in meetings:
                if i in (each.of, each.by):
                    push = each.touch.force if each.by == i else -each.touch.force
                    force, torque = force + push, torque + (each.place - origin).cross(push)
            loads.append((force, torque) if grasped is None else (force + grasped[0], torque + grasped[1]))
        return loads

    def pulls(
        self, memory: ContactMemory, motion: PointMotion, t: Scalar
    ) -> list[tuple[Grasp, int, Pull, CarriedFrame]]:
        """Each grasp with the number of its body, its pull on the body, and the vehicle's frame."""
        names, turns, rows = [each.name for each in self.carriers], iter(memory.turns), []
        places = iter(memory.places)
        for grasp, constraint in zip(self.grasps, memory.constraints or (None,) * len(self.grasps), strict=True):
            index, frame = names.index(grasp.body), grasp.frame_of(motion)
            body = self.carriers[index].frame(memory.carried[index])
            turn = next(turns) if grasp.kind == "fixed" else ()
            place = next(places) if grasp.closes else None
            rows.append((grasp, index, grasp.pull(turn, frame, body, t, constraint, place), frame))
        return rows

    def slope(
        self, memory: ContactMemory, t: Scalar, motion: PointMotion, rotor_speeds: Sequence[Scalar]
    ) -> ContactMemory:
        """Time derivative of the contact model's internal state."""
        meetings = self.meetings(memory, motion)
        rows = zip(self.carriers, memory.carried, self.on_carriers(memory, motion, meetings, t), strict=True)
        return ContactMemory(
            finer=tuple(0.0 for _ in memory.finer),
            clock=tuple(1.0 for _ in memory.clock),
            bristles=tuple(Vec3(*map(data, each.touch.bristle_rate)) for each in meetings),
            carried=tuple(carrier.slope(body, *push, motion.gravity) for carrier, body, push in rows),
            grips=tuple(UNCHANGED for _ in memory.grips),
            turns=tuple(UNCHANGED.turn for _ in memory.turns),
            places=tuple(UNCHANGED.place for _ in memory.places),
            constraints=memory.constraints,  # zeros within a plant that exerts them itself
        )

    def before_euler_step(self, memory: ContactMemory, slope: ContactMemory, dt: Scalar) -> ContactMemory:
        """Internal state of the contact model with friction bristles advanced, for a semi-implicit Euler step."""
        rows = zip(self.carriers, memory.carried, slope.carried, strict=True)
        carried = tuple(carrier.before_euler_step(body, rate, dt) for carrier, body, rate in rows)
        return replace(memory, bristles=moved_by(memory.bristles, slope.bristles, dt), carried=carried)

    def push(
        self, memory: ContactMemory, t: Scalar, motion: PointMotion, rotor_speeds: Sequence[Scalar], dt: Scalar,
        felt: ContactMemory | None = None,
    ) -> ContactMemory:  # fmt: skip
        """Internal state of the contact model after forces accelerated the movable bodies for ``dt`` (s)."""
        felt = memory if felt is None else felt
        pushes = self.on_carriers(felt, motion, self.meetings(felt, motion), t)
        rows = zip(self.carriers, memory.carried, pushes, strict=True)
        carried = tuple(carrier.after_push(body, *push, motion.gravity, dt) for carrier, body, push in rows)
        return replace(memory, carried=carried)

    def drift(self, memory: ContactMemory, dt: Scalar) -> ContactMemory:
        """Internal state of the contact model after ``dt`` (s) with constant velocities of the movable bodies."""
        carried = tuple(each.drift(body, dt) for each, body in zip(self.carriers, memory.carried, strict=True))
        return replace(memory, clock=tuple(t + dt for t in memory.clock), carried=carried)

    def euler_step(self, memory: ContactMemory, slope: ContactMemory, dt: Scalar) -> ContactMemory:
        """Internal state of the contact model after a semi-implicit Euler step of ``dt`` (s)."""
        rows = zip(self.carriers, memory.carried, slope.carried, strict=True)
        return self.drift(replace(memory, carried=tuple(each.kick(body, rate, dt) for each, body, rate in rows)), dt)

    def wrenches(
        self, memory: ContactMemory, t: Scalar, motion: PointMotion, rotor_speeds: Sequence[Scalar]
    ) -> Sequence[Wrench]:
        """Forces and torques of all contacts and grasps on the vehicle's bodies."""
        touches, pushes = self.on_points(memory, motion), []
        for i in range(len(self.points)):
            force = torque = ZERO3
            for each in touches[i :: len(self.points)]:
                force, torque = force + each.force, torque + each.torque
            pushes.append((force, torque))
        on_points = wrenches_on(self.points, motion, pushes)
        grasped = []
        for grasp, _, pull, frame in self.pulls(memory, motion, t):
            at = motion.of(grasp.agent).vehicle.frame(grasp.frame or None)
            torque = -pull.torque - (pull.place - frame.position).cross(pull.force)
            grasped.append(
                Wrench(force_W=-pull.force, torque_W=torque, point=at.position, body=at.link, agent=grasp.agent)
            )
        return [*on_points, *self.gripping.on_vehicle(memory.grips, memory.carried, motion), *grasped]

    def settle(self, memory: ContactMemory, motion: PointMotion, vehicle: bool) -> ContactMemory:
        """Internal state of the contact model in which friction balances the weight of bodies that start at rest."""
        memory = replace(memory, turns=self._turns(memory, motion)) if memory.turns else memory
        weights = {i: each.mass * motion.gravity for i, each in enumerate(self.objects) if each.standing}
        if vehicle and len(motion.agents) == 1:
            weights[NOBODY] = motion.vehicle.mass * motion.gravity
        if not weights:
            return memory
        materials = {each.name: each.material for _, each in self.every_surface}
        meetings = self.meetings(memory, motion)
        return replace(memory, bristles=standing_bristles(meetings, memory.bristles, weights, materials))

    def _turns(self, memory: ContactMemory, motion: PointMotion) -> tuple[Mat3, ...]:
        """Attitudes that fixed grasps keep: those in which frame and body are to each other at the start."""
        bodies = {each.name: each.frame(body) for each, body in zip(self.carriers, memory.carried, strict=True)}
        turns = [each.turn(motion, bodies[each.body]) for each in self.grasps if each.kind == "fixed"]
        return tuple(Mat3(*(Vec3(*map(data, row)) for row in turn.rows)) for turn in turns)

    def act(self, memory: ContactMemory, t: Scalar, dt: float, motion: PointMotion) -> ContactMemory:
        """Internal state of the contact model after grippers and grasps close, open or slip at a control instant."""
        if self.grippers:
            memory = replace(memory, grips=self.gripping.after(memory.grips, memory.carried, t, motion))
        # a grasp closes by the flight's time, by which the plant pulls, however long a reference waits
        now = t if motion.time is None else motion.time
        return replace(memory, **self._closing_poses(memory, now - 0.5 * dt, motion)) if memory.places else memory

    def _closing_poses(self, memory: ContactMemory, t: Scalar, motion: PointMotion) -> dict[str, tuple[Any, ...]]:
        """Places and attitudes of grasps: those of the frames for grasps that were open at ``t`` (s)."""
        bodies = {each.name: each.frame(body) for each, body in zip(self.carriers, memory.carried, strict=True)}
        turned = iter(zip(memory.turns, self._turns(memory, motion), strict=True))
        closing, places, turns = iter(memory.places), list[Vec3](), list[Mat3]()
        for each in self.grasps:
            opened = t < each.close
            if each.kind == "fixed":
                before, turn = next(turned)
                turns.append(blend(opened, turn, before) if each.closes else before)
            if each.closes:
                body = bodies[each.body]
                here = body.rotation.apply_T(each.frame_of(motion).position - body.position)
                places.append(blend(opened, here, next(closing)))
        return {"places": tuple(places), "turns": tuple(turns)}

    def holds(self, memory: ContactMemory, frame: str, agent: str = "") -> Scalars:
        """Grasp sensor signal of each gripper at a vehicle frame: 1 while the gripper holds a body, else 0."""
        grips = zip(self.grippers, memory.grips, strict=True)
        ours = [grip for own, grip in grips if own.frame in ("", frame) and own.agent in ("", agent)]
        return tuple(where(grip.taken > 0.5, 1.0, 0.0) for grip in ours)

    def far(self, memory: ContactMemory, motion: PointMotion, seconds: Scalar) -> Scalar:
        """True if nothing can touch a surface within ``seconds`` and no gripper holds anything.

        Its whole speed counts, and not only what brings it nearer to the nearest place: force may still act where it
        leaves, and in a hole another wall may be in its way. What a gripper holds is near.
        """
        if self.grasps:
            return False
        apart = [grip.taken < 0.5 for grip in memory.grips]
        apart += [misses(each.touch, seconds) for each in self.meetings(memory, motion)]
        return reduce(logical_and, apart) if apart else True

    def calm(self, memory: ContactMemory, motion: PointMotion, seconds: Scalar) -> Scalar:
        """True if nothing can touch a surface within ``CALM_FOR`` times ``seconds``, and no impact was just before.

        The force of a grasp can be larger than what ``far`` reckons with, hence the longer time.
        """
        apart = [steps <= 1.0 for steps in memory.finer]
        apart += [misses(each.touch, CALM_FOR * seconds) for each in self.meetings(memory, motion)]
        return reduce(logical_and, apart) if apart else True

    @property
    def most_hit_steps(self) -> int:  # type: ignore[override]
        """Largest number of substeps into which an integration step is divided during an impact."""
        return self.hit_steps

    def hurry(self, memory: ContactMemory, motion: PointMotion, seconds: Scalar) -> tuple[ContactMemory, Scalar]:
        """Internal state of the contact model, and number of substeps: 1 in slow contact, ``hit_steps`` in hard impact.

        They stay nearly as fine through a hit, or the change of the step itself would be felt as energy.
        """
        fastest: Scalar = 0.0
        for each in self.meetings(memory, motion):
            slip = each.touch.slip
            fastest = maximum(fastest, where(misses(each.touch, seconds), 0.0, slip.dot(slip)))
        asked = sqrt(fastest) * (self.hit_steps / HIT)
        finer = clip(maximum(asked, memory.finer[0] * exp(-seconds / REGROWTH)), 1.0, float(self.hit_steps))
        return replace(memory, finer=(finer,)), finer

    def alone(self, memory: ContactMemory, seconds: Scalar, rounds: int, gravity: Scalar) -> ContactMemory:
        """Internal state of the contact model after ``seconds`` without any contact."""
        left = exp(-RECOVERY * seconds)
        bodies = zip(self.carriers, memory.carried, strict=True)
        return replace(
            memory,
            clock=tuple(t + seconds for t in memory.clock),
            bristles=tuple(bristle * left for bristle in memory.bristles),
            carried=tuple(untouched_after(each, body, seconds / rounds, rounds, gravity) for each, body in bodies),
        )

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns of contact forces, movable bodies and grippers."""
        labels = [f"{surface.name}/{point.name}" for _, surface in self.every_surface for point in self.points]
        columns = [Column(f"contact_{array}", label, *words) for label in labels for array, *words in LOGGED]
        columns += [column for carrier in self.carriers for column in carrier.columns]
        columns += [column for gripper in self.grippers for column in gripper.columns]
        return (*columns, *(column for grasp in self.grasps for column in grasp.columns))

    @property
    def constants(self) -> Mapping[str, Scalars]:
        """Hinge axis of the first mechanism, for metrics: a point (m) and a unit vector; empty for a slide."""
        return {"mechanism_hinge": self.mechanisms[0].hinge} if self.mechanisms else {}

    def logged(self, memory: ContactMemory, motion: PointMotion) -> Scalars:
        """Logged contact forces (N) and penetrations (m), states of movable bodies, and gripper forces."""
        numbers = [number for each in self.on_points(memory, motion) for number in each.logged]
        for carrier, body in zip(self.carriers, memory.carried, strict=True):
            numbers += carrier.logged(body)
        numbers += self.gripping.logged(memory.grips, memory.carried, motion)
        for _, _, pull, _ in self.pulls(memory, motion, motion.task_time):
            numbers += [sqrt(pull.force.dot(pull.force)), *pull.force]
        return tuple(numbers)

    def shapes(self, seen: Instants) -> Scene:
        """Shapes of surfaces and movable bodies, and arrows of contact forces, for pictures."""
        from skyarm.world.contact.contact_scene import contact_scene

        return contact_scene(seen, self.surfaces, self.points, self.objects, self.mechanisms, self.grasps)

    def warnings(self, vehicle: Vehicle, step: float) -> Sequence[str]:
        """Warnings about contact that needs very short steps, and about ball grippers that hold objects tilted."""
        pairs = product(self.grippers, self.objects)
        tilted = [line for hand, it in pairs for line in hand.tilt_warning(it.name, it.mass, it.half_width)]
        if not self.steps:
            return tuple(tilted)
        what, bound = min(self.steps, key=lambda each: float(each[1]))
        least = float(bound)
        if not MUCH_SHORTER * least < step:
            return tilted
        return (
            *tilted,
            f"{what} asks for integration steps of {1e3 * least:.2g} ms in contact; they are taken by themselves, "
            f"about {step / least:.0f} in place of each of rates.physics, and cost that much more; "
            "is it so light, or its contact so stiff?",
        )


def _vehicle_of(agent: str, vehicles: Mapping[str, Vehicle], where: str) -> Vehicle:
    """Vehicle that a point, gripper or grasp is on.

    Raises:
        RecordError: one line: there is no such vehicle, or none is named of several.
    """
    if agent in vehicles:
        return vehicles[agent]
    if (not agent and len(vehicles) == 1) or "" in vehicles:
        return next(iter(vehicles.values()))
    if not agent:
        raise RecordError(f"{where}.agent: is missing; must be one of {', '.join(vehicles)}")
    raise RecordError(f"{where}.agent = {shown(agent)}: {must_be_one_of(vehicles, agent)}")
