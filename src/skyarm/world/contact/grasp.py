"""Grasps: joints that hold a body of the world at a frame of a vehicle from the start
of a flight.

A grasp is a spring with damping of stated numbers, so that the force in it follows from
the flight also where several vehicles hold one body and statics alone does not say who
bears what:

* ``ball`` holds a place: the body turns about it freely;
* ``fixed`` holds the attitude, too, in which frame and body are to each other when the
  flight begins;
* ``cable`` pulls along a line of a length, and never pushes.

A gripper (:mod:`skyarm.world.contact.gripper`) is a grasp that takes hold and gives way
in flight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

from skyarm.algebra import ZERO3, Force, Mat3, Scalar, Vec3
from skyarm.algebra.scalars import divide, maximum, minimum, sqrt, where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, concrete
from skyarm.records.field_rules import accept_fields
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.vehicle import BASE, Vehicle
from skyarm.world.component import Column
from skyarm.world.contact.carrier import AnyCarrier, CarriedFrame
from skyarm.world.contact.hold import Hold, Spring, Stiffness, frame_of, longest_step
from skyarm.world.contact.material import LIGHTEST, NORMAL_STEP

KINDS = ("fixed", "ball", "cable")

TINY = 1e-24
"""Squared length (m^2) added below a root, whose slope is infinite at zero."""


@immutable
class Grasp:
    """Joint between a frame of a vehicle and a body of the world, from the start of the
    flight.

    Attributes:
        agent: name of the vehicle; empty for the only one. frame: frame of the vehicle;
            empty for its tip.
        body: name of the object or of the mechanism's part. kind: one of ``KINDS``.
        name: name in logs; left out, of vehicle and body.
    """

    body: Annotated[
        str, Unit("", "object or mechanism that the grasp holds", rule=coerce.name)
    ]
    agent: str = ""
    frame: str = ""
    place: Annotated[
        Vec3, Unit("m", "place of the grasp, axes of the body from its middle")
    ] = ZERO3
    kind: Annotated[str, Unit("", "kind of the grasp", rule=coerce.word_of(KINDS))] = (
        "ball"
    )
    stiffness: Stiffness = 5000.0
    damping: Annotated[
        Scalar,
        nonnegative(
            "N s/m",
            "damping of the grasp",
            effect="higher values let the body swing less in the grasp",
        ),
    ] = 20.0
    radius: Annotated[
        Scalar,
        positive(
            "m",
            "radius of the patch over which a fixed grasp holds: attitude stiffness is"
            " stiffness times its square",
        ),
    ] = 0.02
    length: Annotated[Scalar, nonnegative("m", "length of a cable without load")] = 0
    close: Annotated[
        Scalar,
        nonnegative(
            "s",
            "time at which the grasp closes, where the frame then is; 0: closed at its"
            " place",
        ),
    ] = field_if_any(default=0)
    release: Annotated[
        Scalar, nonnegative("s", "time at which the grasp opens", infinite=True)
    ] = math.inf
    name: str = field_if_any(default="")

    def __post_init__(self) -> None:
        accept_fields(self, "grasp")
        coerce.fold_zeros(self, "length", "close")
        if self.kind != "cable" and not coerce.absent(self.length):
            raise RecordError(
                f"grasp.length = {self.length!r}: must be left out of a {self.kind}"
                " grasp; cables have one"
            )
        if (
            self.closes
            and coerce.concrete(self.close, self.release)
            and not self.release > self.close
        ):
            raise RecordError(
                f"grasp.release = {self.release:g}: must be after close,"
                f" {self.close:g} s"
            )
        # files of a log write names with / and , between them
        if any(letter in self.name for letter in "/,"):
            coerce.refuse("grasp.name", self.name, "must be without / and ,")

    @property
    def closes(self) -> bool:
        """True if the grasp closes in the course of the flight."""
        return not coerce.absent(self.close)

    @property
    def label(self) -> str:
        """Name of the grasp in a log."""
        return self.name or f"{self.agent}_{self.body}".strip("_")

    @property
    def columns(self) -> tuple[Column, ...]:
        """Log columns of the grasp: force, and pull on the body."""
        pull = (
            Column("grasp_pull", f"{self.label}/{axis}", "N", "of a grasp on the body")
            for axis in "xyz"
        )
        return (Column("grasp_force", self.label, "N", "of a grasp"), *pull)

    def step_of(
        self, carrier: AnyCarrier, together: Sequence[Grasp], *, euler: bool = False
    ) -> Scalar:
        """Longest stable integration step (s) between the lightest tip and a body,
        which several grasps hold.

        Args:
            carrier: the body.
            together: all grasps of it, this one among them.
            euler: of semi-implicit Euler steps.
        """
        # a fixed grasp turns the tip, too: as much again where its radius of gyration
        # is that of the patch
        tip = 1.0 / LIGHTEST * (2.0 if self.kind == "fixed" else 1.0)
        square, decay = self.stiffness * tip, self.damping * tip
        # one body between several springs swings by the sum of their stiffnesses
        for each in together:
            mobility = carrier.mobility_of(each.place)
            # over the patch, on the body's smallest moment of inertia
            if each.kind == "fixed":
                inertia = maximum(
                    divide(carrier.gyration, carrier.mobility_of(ZERO3)), TINY
                )
                mobility = mobility + divide(each.radius * each.radius, inertia)
            square = square + each.stiffness * mobility
            decay = decay + each.damping * mobility
        return minimum(
            NORMAL_STEP / sqrt(square), longest_step(square, decay, euler=euler)
        )

    def require_heavy(self, vehicle: Vehicle) -> None:
        """Refuse a frame that is lighter than the steps of the integration are chosen
        for.

        Raises:
            RecordError: field, value and what is allowed.
        """
        link, mass = vehicle.frame(self.frame or None).link, vehicle.base.mass
        if link != BASE:
            carried = {link}
            for i, each in enumerate(vehicle.moving):
                carried |= {i} if each.parent in carried else set()
            mass = sum((vehicle.moving[i].body.mass for i in carried), 0.0)
        if concrete(mass) and mass < LIGHTEST:
            words = (
                f"its link of {vehicle.name} weighs {1e3 * mass:.3g} g, must be"
                f" {1e3 * LIGHTEST:g} g or more"
            )
            raise RecordError(f"frame = {self.frame!r}: {words}")

    def frame_of(self, motion: PointMotion) -> CarriedFrame:
        """World pose and velocity of the vehicle's frame."""
        return frame_of(motion.of(self.agent), self.frame)

    def turn(self, motion: PointMotion, body: CarriedFrame) -> Mat3:
        """Rotation from the axes of the body to those of the vehicle's frame, which a
        fixed grasp keeps.
        """
        return self.frame_of(motion).rotation.T @ body.rotation

    def pull(
        self,
        turn: Mat3 | tuple[()],
        frame: CarriedFrame,
        body: CarriedFrame,
        t: Scalar,
        constraint: Force | None = None,
        place: Vec3 | None = None,
    ) -> Hold:
        """Force and torque of the grasp on the body.

        Args:
            turn: rotation of :meth:`turn` that a fixed grasp keeps; empty for other
                kinds.
            frame: the vehicle's frame.
            body: the body's frame.
            t: s.
            constraint: force and torque of a constraint in place of the spring, at the
                grasp, world axes.
            place: place at which the grasp has closed, axes of the body; None for that
                of the grasp.
        """
        at = body.position + body.rotation.apply(self.place if place is None else place)
        by = constraint or self._spring(turn, frame, body, at)
        # a constant of infinity: the condition would be in every program for nothing
        opens = not (isinstance(self.release, float) and math.isinf(self.release))
        pull = Hold(force=by.force, torque=by.torque, place=at)
        if not opens and not self.closes:
            return pull
        share = where(t < self.release, 1.0, 0.0) if opens else 1.0
        share = where(t < self.close, 0.0, share) if self.closes else share
        return pull * share

    def _spring(
        self,
        turn: Mat3 | tuple[()],
        frame: CarriedFrame,
        body: CarriedFrame,
        place: Vec3,
    ) -> Force:
        """Force and torque of the spring and damper on the body, world axes; ``place``
        (m) is that of the grasp.
        """
        spring = Spring(self.stiffness, self.damping, frame, body)
        if self.kind == "cable":
            force = self._tension(
                frame.position - place, frame.velocity - body.velocity_at(place)
            )
        else:
            force = spring.force(place)
        if isinstance(turn, tuple):
            return Force(ZERO3, force)
        return Force(
            spring.torque(spring.error(turn), self.radius * self.radius), force
        )

    def _tension(self, line: Vec3, speed: Vec3) -> Vec3:
        """Force of a cable along the line from the body to the frame: it pulls where it
        is taut, and never pushes.
        """
        length = line.smooth_norm()
        along = line * divide(1.0, length)
        stretch = length - self.length
        tension = maximum(
            self.stiffness * stretch + self.damping * speed.dot(along), 0.0
        )
        # damping alone must not pull a slack cable
        return along * where(stretch > 0.0, tension, 0.0)
