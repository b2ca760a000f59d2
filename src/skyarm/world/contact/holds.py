"""Grippers and grasps of a world together with the bodies that they can hold: their
forces, and when they close.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from skyarm.algebra import ZERO3, Mat3, Scalar, Vec3
from skyarm.algebra.scalars import where
from skyarm.algebra.vector import select
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, as_data, blend
from skyarm.world.component import Column, Wrench
from skyarm.world.contact.carrier import AnyCarrier, CarriedFrame, reduced_mass
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.contact.grasp import Grasp
from skyarm.world.contact.gripper import Grip, Gripper, is_taken
from skyarm.world.contact.hold import Hold, frame_of
from skyarm.world.contact.material import LIGHTEST


@positional
class Holds:
    """Grippers and grasps of the vehicles together with the bodies that they can hold.

    Attributes:
        grippers, grasps: of the vehicles. carriers: bodies of the world.
    """

    grippers: tuple[Gripper, ...]
    grasps: tuple[Grasp, ...]
    carriers: tuple[AnyCarrier, ...]

    def steps(self, *, euler: bool = False) -> Iterator[tuple[str, Scalar]]:
        """Longest stable integration step (s) of every possible hold, with a text that
        names gripper or grasp.
        """
        for gripper in self.grippers:
            for carrier in self.carriers:
                mass = reduced_mass(LIGHTEST, 1.0 / carrier.mobility)
                moved = reduced_mass(LIGHTEST, 1.0 / carrier.mobility_at(gripper.reach))
                yield (
                    f"gripper {gripper.name!r}",
                    gripper.step_of(mass, moved, euler=euler),
                )
        bodies = {each.name: each for each in self.carriers}
        for grasp in self.grasps:
            # a wrong name is refused elsewhere, with its own message
            if grasp.body in bodies:
                together = [other for other in self.grasps if other.body == grasp.body]
                yield (
                    f"grasp {grasp.label!r}",
                    grasp.step_of(bodies[grasp.body], together, euler=euler),
                )

    def frames(self, motion: PointMotion) -> list[CarriedFrame]:
        """World pose and velocity of each gripper's frame."""
        return [
            frame_of(motion.of(gripper.agent), gripper.frame)
            for gripper in self.grippers
        ]

    def bodies(self, memories: Sequence[Tree]) -> list[CarriedFrame]:
        """World pose and velocity of each movable body."""
        return [
            carrier.frame(memory)
            for carrier, memory in zip(self.carriers, memories, strict=True)
        ]

    def possible(
        self,
        grips: Sequence[Grip],
        frames: Sequence[CarriedFrame],
        bodies: Sequence[CarriedFrame],
    ) -> list[list[Hold]]:
        """Force and torque of each gripper on each movable body if it held that body,
        as [gripper][body].
        """
        masses = [
            reduced_mass(LIGHTEST, 1.0 / carrier.mobility) for carrier in self.carriers
        ]
        every = list(zip(bodies, masses, self.carriers, strict=True))
        return [
            [
                gripper.hold(grip, frame, body, mass, carrier.gyration)
                for body, mass, carrier in every
            ]
            for gripper, grip, frame in zip(self.grippers, grips, frames, strict=True)
        ]

    def actual(
        self, memory: ContactMemory, frames: Sequence[CarriedFrame]
    ) -> list[list[Hold]]:
        """Force and torque of each gripper on each movable body, zero for bodies not
        held, as [gripper][body].
        """
        # of all bodies: which one is held is a number of the memory, by which no trace
        # branches
        possible = self.possible(memory.grips, frames, self.bodies(memory.carried))
        return [
            [
                hold * where(is_taken(grip.taken, i + 1.0), 1.0, 0.0)
                for i, hold in enumerate(row)
            ]
            for grip, row in zip(memory.grips, possible, strict=True)
        ]

    def pulls(
        self, memory: ContactMemory, motion: PointMotion, t: Scalar
    ) -> list[tuple[Grasp, int, Hold, CarriedFrame]]:
        """Each grasp with the number of its body, its pull on the body, and the
        vehicle's frame.
        """
        turns = iter(memory.turns)
        places = iter(memory.places)
        rows = []
        constraints = memory.constraints or (None,) * len(self.grasps)
        for (grasp, index, body), constraint in zip(
            self._bodies_of_grasps(memory), constraints, strict=True
        ):
            turn = next(turns) if grasp.kind == "fixed" else ()
            place = next(places) if grasp.closes else None
            frame = grasp.frame_of(motion)
            rows.append(
                (
                    grasp,
                    index,
                    grasp.pull(turn, frame, body, t, constraint, place),
                    frame,
                )
            )
        return rows

    def _bodies_of_grasps(
        self, memory: ContactMemory
    ) -> list[tuple[Grasp, int, CarriedFrame]]:
        """Each grasp with number and axes of its body."""
        names = [each.name for each in self.carriers]
        bodies = self.bodies(memory.carried)
        indices = [names.index(each.body) for each in self.grasps]
        return [
            (each, i, bodies[i]) for each, i in zip(self.grasps, indices, strict=True)
        ]

    def on_bodies(
        self, memory: ContactMemory, motion: PointMotion, t: Scalar
    ) -> list[tuple[Vec3, Vec3]]:
        """Total force (N) and torque (N m, about the body's origin) of all holds on
        each movable body.
        """
        bodies = self.bodies(memory.carried)
        loads = []
        gripped = self.actual(memory, self.frames(motion)) if self.grippers else []
        for i, body in enumerate(bodies):
            force = torque = ZERO3
            for row in gripped:
                hold = row[i]
                force = force + hold.force
                torque = (
                    torque
                    + hold.torque
                    + (hold.place - body.position).cross(hold.force)
                )
            loads.append((force, torque))
        for _, i, pull, _ in self.pulls(memory, motion, t):
            force, torque = loads[i]
            turning = pull.torque + (pull.place - bodies[i].position).cross(pull.force)
            loads[i] = force + pull.force, torque + turning
        return loads

    def wrenches(
        self, memory: ContactMemory, motion: PointMotion, t: Scalar
    ) -> Iterator[Wrench]:
        """Reaction forces and torques of all holds on the vehicles, those of the
        grippers first.
        """
        frames = self.frames(motion)
        rows: list[tuple[Gripper | Grasp, CarriedFrame, list[Hold]]] = []
        rows += zip(self.grippers, frames, self.actual(memory, frames), strict=True)
        rows += (
            (grasp, frame, [pull])
            for grasp, _, pull, frame in self.pulls(memory, motion, t)
        )
        for holder, frame, holds in rows:
            force = torque = ZERO3
            for hold in holds:
                force = force - hold.force
                torque = (
                    torque
                    - hold.torque
                    - (hold.place - frame.position).cross(hold.force)
                )
            at = motion.of(holder.agent).vehicle.frame(holder.frame or None)
            yield Wrench(
                force_W=force,
                torque_W=torque,
                point=at.position,
                body=at.link,
                agent=holder.agent,
            )

    def act(
        self, memory: ContactMemory, t: Scalar, dt: float, motion: PointMotion
    ) -> ContactMemory:
        """Internal state of the contact model after grippers and grasps close, open or
        slip at a control instant.
        """
        if self.grippers:
            memory = replace(memory, grips=tuple(self._following(memory, t, motion)))
        # a grasp closes by the flight's time, by which the plant pulls, however long a
        # reference waits
        now = t if motion.time is None else motion.time
        # half a period before, so that at the instant of closing the place is still
        # taken
        return self._close(memory, now - 0.5 * dt, motion) if memory.places else memory

    def _following(
        self, memory: ContactMemory, t: Scalar, motion: PointMotion
    ) -> Iterator[Grip]:
        """States of all grippers for the next control period, after possible grasps,
        releases and slips.
        """
        frames = self.frames(motion)
        bodies = self.bodies(memory.carried)
        possible = self.possible(memory.grips, frames, bodies)
        for gripper, grip, frame, row in zip(
            self.grippers, memory.grips, frames, possible, strict=True
        ):
            skins = [
                _skin(carrier, body, frame.position)
                for carrier, body in zip(self.carriers, bodies, strict=True)
            ]
            seen = tuple(
                (body, *skin, hold)
                for body, skin, hold in zip(bodies, skins, row, strict=True)
            )
            # a gripper of a named vehicle follows that vehicle's reference
            now = motion.of(gripper.agent).task_time if gripper.agent else t
            yield gripper.after(grip, now, frame, seen)

    def turns(self, memory: ContactMemory, motion: PointMotion) -> tuple[Mat3, ...]:
        """Attitudes to each other of body and frame of each fixed grasp, which it keeps
        while it is closed.
        """
        grasped = self._bodies_of_grasps(memory)
        return as_data(
            tuple(
                each.turn(motion, body)
                for each, _, body in grasped
                if each.kind == "fixed"
            )
        )

    def _close(
        self, memory: ContactMemory, t: Scalar, motion: PointMotion
    ) -> ContactMemory:
        """Internal state with places and attitudes of the frames for grasps that were
        open at ``t`` (s).
        """
        turned = iter(zip(memory.turns, self.turns(memory, motion), strict=True))
        closing = iter(memory.places)
        places = list[Vec3]()
        turns = list[Mat3]()
        for each, _, body in self._bodies_of_grasps(memory):
            opened = t < each.close
            if each.kind == "fixed":
                before, turn = next(turned)
                turns.append(blend(opened, turn, before) if each.closes else before)
            if each.closes:
                here = body.rotation.apply_T(
                    each.frame_of(motion).position - body.position
                )
                places.append(blend(opened, here, next(closing)))
        return replace(memory, places=tuple(places), turns=tuple(turns))

    @property
    def columns(self) -> list[Column]:
        """Log columns of the grippers, then of the grasps."""
        holders: tuple[Gripper | Grasp, ...] = (*self.grippers, *self.grasps)
        return [column for each in holders for column in each.columns]

    def logged(self, memory: ContactMemory, motion: PointMotion) -> list[Scalar]:
        """Held body, size of the force (N), number of slips and force (N) of each
        gripper; size and force of grasps.

        The forces are those on what is held, world axes.
        """
        numbers: list[Scalar] = []
        for grip, row in zip(
            memory.grips, self.actual(memory, self.frames(motion)), strict=True
        ):
            total = sum((hold.force for hold in row), ZERO3)
            numbers += [grip.taken, total.norm(), grip.lost, *total]
        # of a motion to be logged that is the plant's time (Stages.motions)
        for _, _, pull, _ in self.pulls(memory, motion, motion.task_time):
            numbers += [pull.force.norm(), *pull.force]
        return numbers


def _skin(carrier: AnyCarrier, body: CarriedFrame, place: Vec3) -> tuple[Scalar, Vec3]:
    """Distance (m) of a point from the nearest surface of a movable body, and the
    outward normal there.
    """
    depths = [body.depth(surface, place, 0) for surface in carrier.surfaces]
    deepest, normal = depths[0]
    for depth, outward in depths[1:]:
        nearer = depth > deepest
        deepest = where(nearer, depth, deepest)
        normal = select(nearer, outward, normal)
    return -deepest, normal
