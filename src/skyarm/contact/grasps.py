"""What all grippers of a vehicle do to the bodies of the world, and these to the vehicle."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ZERO3, Mat3, Vec3
from skyarm.contact.carried_contact import both
from skyarm.contact.carrier import CarriedFrame, Carrier
from skyarm.contact.gripper import Grip, Gripper, Hold, is_taken
from skyarm.contact.material import LIGHTEST
from skyarm.dynamics.point_motion import PointMotion
from skyarm.environment.component import Wrench
from skyarm.scalars import sqrt, where

_NOTHING = Vec3(0.0, 0.0, 0.0)

UNCHANGED = Grip(
    taken=0.0, ready=0.0, lost=0.0, place=_NOTHING, normal=_NOTHING, turn=Mat3(_NOTHING, _NOTHING, _NOTHING)
)  # fmt: skip
"""Rate of a grip's memory: it changes at control instants only."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Grasps:
    """Grippers and what they may hold.

    Attributes:
        grippers: of the vehicle. carriers: bodies of the world.
    """

    grippers: tuple[Gripper, ...]
    carriers: tuple[Carrier, ...]

    def steps(self, *, euler: bool = False) -> Iterator[tuple[str, Any]]:
        """What asks for a step, in words, and the longest integration step (s), of each grasp."""
        for gripper in self.grippers:
            for carrier in self.carriers:
                mobilities = carrier.mobility, carrier.mobility_at(gripper.reach)
                masses = [both(LIGHTEST, 1.0 / each) for each in mobilities]
                yield f"gripper {gripper.name!r}", gripper.step_of(*masses, euler=euler)

    def frames(self, motion: PointMotion) -> list[CarriedFrame]:
        """Place and motion of the grippers' frames."""
        found = []
        for gripper in self.grippers:
            at = motion.vehicle.frame(gripper.frame or None)
            columns = [motion.turned(at.rotation.column(i), at.link) for i in range(3)]
            found.append(
                CarriedFrame(
                    position=motion.position(at.position, at.link),
                    rotation=Mat3.columns(*columns),
                    velocity=motion.velocity(at.position, at.link),
                    turning=motion.turned(motion.angular_velocity(at.link), at.link),
                )
            )
        return found

    def bodies(self, memories: Sequence[Any]) -> list[CarriedFrame]:
        """Place and motion of the carriers."""
        return [carrier.frame(memory) for carrier, memory in zip(self.carriers, memories, strict=True)]

    def possible(
        self, grips: Sequence[Grip], frames: Sequence[CarriedFrame], bodies: Sequence[CarriedFrame]
    ) -> list[list[Hold]]:
        """What each grasp does to each body if that is the one that is held: [gripper][carrier]."""
        masses = [both(LIGHTEST, 1.0 / carrier.mobility) for carrier in self.carriers]
        every = list(zip(bodies, masses, self.carriers, strict=True))
        return [
            [gripper.hold(grip, frame, body, mass, carrier.gyration) for body, mass, carrier in every]
            for gripper, grip, frame in zip(self.grippers, grips, frames, strict=True)
        ]

    def holds(self, memory: Any, frames: Sequence[CarriedFrame]) -> list[list[Hold]]:
        """What each grasp does to each body: nothing to those that are not held."""
        possible = self.possible(memory.grips, frames, self.bodies(memory.carried))
        return [
            [_shared(hold, where(is_taken(grip.taken, i + 1.0), 1.0, 0.0)) for i, hold in enumerate(row)]
            for grip, row in zip(memory.grips, possible, strict=True)
        ]

    def on_bodies(self, memory: Any, motion: PointMotion) -> list[tuple[Vec3, Vec3]]:
        """Force (N) on each carrier and torque (N m) about the origin of its axes, world axes."""
        holds, bodies = self.holds(memory, self.frames(motion)), self.bodies(memory.carried)
        found = []
        for i, body in enumerate(bodies):
            force = torque = ZERO3
            for row in holds:
                hold = row[i]
                force = force + hold.force
                torque = torque + hold.torque + (hold.place - body.position).cross(hold.force)
            found.append((force, torque))
        return found

    def on_vehicle(self, memory: Any, motion: PointMotion) -> list[Wrench]:
        """The opposite on the vehicle, at the same places."""
        frames, found = self.frames(motion), []
        for gripper, frame, row in zip(self.grippers, frames, self.holds(memory, frames), strict=True):
            at = motion.vehicle.frame(gripper.frame or None)
            force = torque = ZERO3
            for hold in row:
                force = force - hold.force
                torque = torque - hold.torque - (hold.place - frame.position).cross(hold.force)
            found.append(Wrench(force_W=force, torque_W=torque, point=at.position, body=at.link))
        return found

    def after(self, memory: Any, t: Any, motion: PointMotion) -> tuple[Grip, ...]:
        """The grips after a control instant (s), at which grippers take hold, let go and give way."""
        frames, bodies = self.frames(motion), self.bodies(memory.carried)
        possible = self.possible(memory.grips, frames, bodies)
        found = []
        for gripper, grip, frame, row in zip(self.grippers, memory.grips, frames, possible, strict=True):
            skins = [_skin(carrier, body, frame.position) for carrier, body in zip(self.carriers, bodies, strict=True)]
            seen = tuple((body, *skin, hold) for body, skin, hold in zip(bodies, skins, row, strict=True))
            found.append(gripper.after(grip, t, frame, seen))
        return tuple(found)

    def logged(self, memory: Any, motion: PointMotion) -> list[Any]:
        """Of each gripper the number of what it holds, the force of the grasp (N), how often it gave way, its pull.

        The pull is the force on what it holds, N, world axes.
        """
        numbers: list[Any] = []
        for grip, row in zip(memory.grips, self.holds(memory, self.frames(motion)), strict=True):
            total = ZERO3
            for hold in row:
                total = total + hold.force
            numbers += [grip.taken, sqrt(total.dot(total)), grip.lost, *total]
        return numbers


def _skin(carrier: Carrier, body: CarriedFrame, place: Vec3) -> tuple[Any, Vec3]:
    """Distance (m) of a place from what a carrier carries, and the outward normal there, world axes."""
    depths = [body.depth(surface, place, 0) for surface in carrier.surfaces]
    deepest, normal = depths[0]
    for depth, outward in depths[1:]:
        nearer = depth > deepest
        deepest = where(nearer, depth, deepest)
        normal = Vec3(*(where(nearer, a, b) for a, b in zip(outward, normal, strict=True)))
    return -deepest, normal


def _shared(hold: Hold, share: Any) -> Hold:
    """A part of what a grasp does."""
    return Hold(force=hold.force * share, torque=hold.torque * share, place=hold.place)
