"""Grippers of a vehicle: grasp and release of movable bodies.

A grasp is a stiff spring with damping between a frame of the vehicle and the body: the
pose in which they are to each other when the gripper takes hold is kept. The law of the
spring is the same for all kinds; they differ in what they hold and where they give way:

* ``magnet`` and ``suction`` hold the whole pose. They give way to a pull beyond their
  force along the outward normal of the skin at which they took hold, to more shear than
  friction holds under what is left of that force, and to a torque;
* ``jaw``, two fingers that close on a body, holds the whole pose, up to a force in any
  direction and a torque;
* ``ball``, which a magnet or a spring draws into a socket, holds a place: the body
  turns about it against dry friction in the socket, freely without;
* ``hook`` takes hold when it rises past a body within its reach, carries it from below,
  and lets go when it is lowered out of it. It has no command.

A mechanism is held at a place by all of them: its attitude is its own, and no torque
loads the grasp.

Taking hold and giving way happen at control instants. What gave way takes hold again
only after it was opened.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from typing import Annotated

from skyarm.algebra import ZERO3, ZERO3_DATA, Mat3, Quaternion, Scalar, Vec3
from skyarm.algebra.scalars import (
    asin,
    divide,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    sqrt,
    where,
)
from skyarm.algebra.vector import select
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, absent
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import field_if_any, immutable, positional
from skyarm.records.leaves import as_data, blend
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.signals import Constant, Signal, signal_from
from skyarm.world.component import Column, shorten
from skyarm.world.contact.carrier import CarriedFrame
from skyarm.world.contact.hold import Hold, Spring, Stiffness, longest_step
from skyarm.world.contact.material import NORMAL_STEP, ROUGHEST

KINDS = ("magnet", "suction", "jaw", "ball", "hook")

POSE = ("magnet", "suction", "jaw")
"""Kinds of grippers that also hold the attitude."""

EARTH = 9.81
"""Standard gravity (m/s^2), for weights in warnings."""

ADHESIVE = ("magnet", "suction")
"""Kinds of grippers that adhere and open under a pull along the normal."""


@positional
@checked("command")
class Command:
    """Command of a gripper over time: closed while its signal is above one half."""

    signal: Signal = Constant(1)

    @classmethod
    def from_table(cls, entry: Entry, where: str) -> Command:
        """Read a gripper command from a value of a scenario file; raises a one-line
        ValueError if invalid.
        """
        return cls(signal_from(entry, where))

    def at(self, t: Scalar) -> Scalar:
        """True if the gripper is commanded closed at time ``t`` (s)."""
        closed: Scalar = self.signal.derivatives(t)[0] > 0.5
        return closed


@immutable
class Grip:
    """Internal state of a gripper: index of the held body, pose of the grasp, and
    number of slips.

    Attributes:
        taken: number of the carrier that it holds, from 1; 0 for none.
        ready: 1 where it may take hold: it was opened since it last held something.
            lost: number of slips.
        place: origin of the gripper's frame in the axes of the held body, m.
        normal: outward normal of the skin there, these axes.
        turn: rotation from the axes of the held body to the gripper's.
    """

    taken: Scalar
    ready: Scalar
    lost: Scalar
    place: Vec3
    normal: Vec3
    turn: Mat3


@immutable
class Gripper:
    """Gripper of the vehicle (magnet, suction cup, jaw, ball or hook) that can hold one
    movable body.

    Attributes:
        name: name in messages, logs and paths. kind: one of ``KINDS``.
        frame: frame of the vehicle; empty for its tip. closed: command, a signal of
            time.
        agent: name of the vehicle; empty for the only one.
    """

    name: Annotated[
        str,
        Unit("", "name of the gripper, for messages, logs and paths", rule=coerce.name),
    ]
    kind: Annotated[
        str, Unit("", "kind of the gripper", rule=coerce.word_of(KINDS))
    ] = "magnet"
    frame: str = ""
    closed: Command = field(default_factory=Command)
    reach: Annotated[
        Scalar,
        positive(
            "m", "largest distance from the gripper's frame to a body that it can take"
        ),
    ] = 0.01
    force: Annotated[
        Scalar,
        positive(
            "N",
            "force at which the grasp opens",
            effect="higher values hold heavier loads",
        ),
    ] = 10.0
    torque: Annotated[
        Scalar,
        positive(
            "N m",
            "torque at which the grasp opens",
            effect="higher values hold loads farther off their centre",
        ),
    ] = 0.5
    friction: Annotated[
        Scalar,
        nonnegative(
            "",
            "friction coefficient of a magnet or cup against shear, or of a ball in its"
            " socket",
            high=ROUGHEST,
            effect="higher values slip later",
        ),
    ] = 0.5
    radius: Annotated[
        Scalar,
        nonnegative("m", "radius of a ball in its socket; 0 turns without friction"),
    ] = 0.005
    stiffness: Stiffness = 5000.0
    damping_ratio: Annotated[
        Scalar,
        nonnegative(
            "",
            "damping ratio of the grasp, computed for a tip of 20 g",
            high=2.0,
            effect="higher values let the held body swing less in the grasp",
        ),
    ] = 0.5
    agent: str = field_if_any(default="")

    def __post_init__(self) -> None:
        accept_fields(self, "gripper")
        coerce.fold_zeros(self, "radius")
        if self.kind == "hook" and self.closed != Command():
            raise RecordError(
                "gripper.closed: must be left out of a hook, which has no command"
            )

    @property
    def columns(self) -> tuple[Column, ...]:
        """Log columns of the gripper: held body, grasp force, and number of slips."""
        pull = (
            Column("gripper_pull", f"{self.name}/{axis}", "N", "on what is held")
            for axis in "xyz"
        )
        return (
            Column(
                "gripper_taken",
                self.name,
                "",
                "number of the object that is held, from 1; 0 for none",
            ),
            Column("gripper_force", self.name, "N", "of the grasp"),
            Column("gripper_lost", self.name, "", "how often a grasp has given way"),
            *pull,
        )

    def step_of(self, mass: Scalar, moved: Scalar, *, euler: bool = False) -> Scalar:
        """Longest stable integration step (s) of the spring and damper that model a
        grasp.

        Args:
            mass: mass (kg) that it moves at least where it holds at the skin; its
                damping follows from that.
            moved: mass (kg) that it moves at least at the end of its reach.
            euler: True for the semi-implicit Euler method.
        """
        square = self.stiffness / moved
        decay = self.damping(mass) / moved
        return minimum(
            NORMAL_STEP * sqrt(mass / self.stiffness),
            longest_step(square, decay, euler=euler),
        )

    def damping(self, mass: Scalar) -> Scalar:
        """Damping coefficient (N s/m) of a grasp that moves a mass (kg)."""
        return 2.0 * self.damping_ratio * sqrt(self.stiffness * mass)

    @property
    def holds_attitude(self) -> bool:
        """True if the grasp resists rotation of the held body."""
        free = absent(self.radius)
        return self.kind in POSE or (self.kind == "ball" and not free)

    @property
    def socket_torque(self) -> Scalar:
        """Friction torque (N m) in the socket of a ball gripper under a preload equal
        to the gripper's pull-off force.

        M = mu F r: the frictional moment of a spherical plain bearing under a load F
        (SKF, Spherical plain bearings and rod ends, catalogue 4407: M = 0.5 mu P d).
        mu: 0.5 dry, 0.1 to 0.2 greased steel.
        """
        return self.friction * self.force * self.radius

    def tilt_warning(
        self, name: str, mass: Scalar, half_width: Scalar
    ) -> Iterator[str]:
        """Warning if a ball gripper has too little friction to hold a mass (kg) level
        when gripped off its centre.
        """
        level = self.socket_torque / (mass * EARTH)
        if self.kind == "ball" and level < half_width:
            torque = float(self.socket_torque)
            off = 1e3 * float(level)
            yield (
                f"grippers.{self.name}.radius = {float(self.radius):g}: friction of"
                f" this ball gives {torque:.2g} N m and holds {name!r} level up to"
                f" {off:.2g} mm beside its centre of mass; further off it hangs tilted"
                " and lands on an edge"
            )

    def start(self) -> Grip:
        """Initial state of the gripper: open and ready to grasp."""
        return Grip(
            taken=0.0,
            ready=1.0,
            lost=0.0,
            place=ZERO3_DATA,
            normal=ZERO3_DATA,
            turn=Mat3(ZERO3_DATA, ZERO3_DATA, ZERO3_DATA),
        )

    def hold(
        self,
        grip: Grip,
        frame: CarriedFrame,
        body: CarriedFrame,
        mass: Scalar,
        gyration: Scalar,
    ) -> Hold:
        """Force and torque that the gripper would exert on a body if it held that body.

        Args:
            grip: memory of the gripper.
            frame: gripper's frame.
            body: axes of the held body.
            mass: mass that the grasp moves at least, kg.
            gyration: square of a radius of gyration of the body, m^2: of an attitude's
                stiffness by a place's.
        """
        place = body.position + body.rotation.apply(grip.place)
        spring = Spring(self.stiffness, self.damping(mass), frame, body)
        force = spring.force(place)
        # it carries from below, and does not press down
        if self.kind == "hook":
            force = Vec3(force.x, force.y, maximum(force.z, 0.0))
        torque, twist = ZERO3, None
        if self.holds_attitude and not absent(gyration):
            error = spring.error(grip.turn)
            torque = spring.torque(error, gyration)
            if self.kind == "ball":
                most = self.socket_torque
                torque = shorten(torque, most)
                # the angle, of which the error is the sine: what friction bears alone
                # does not creep
                sine = minimum(error.smooth_norm(), 1.0)
                angle = error * divide(asin(sine), sine)
                twist = shorten(angle, divide(most, self.stiffness * gyration))
        return Hold(force=force, torque=torque, place=place, twist=twist)

    def is_overloaded(self, grip: Grip, hold: Hold, body: CarriedFrame) -> Scalar:
        """True if the load of a grasp exceeds the gripper's limits."""
        force, torque = hold.force, hold.torque
        # a ball slips in its socket, and does not give way by a torque
        twisted = (
            False
            if self.kind == "ball"
            else torque.dot(torque) > self.torque * self.torque
        )
        # fingers hold in all directions, so the size of the force counts
        if self.kind not in ADHESIVE:
            return logical_or(force.dot(force) > self.force * self.force, twisted)
        normal = body.rotation.apply(grip.normal)
        pull = force.dot(normal)
        shear = force - normal * pull
        # what the pull takes of the adhesive force presses no more
        left = self.friction * maximum(self.force - pull, 0.0)
        return logical_or(
            logical_or(pull > self.force, shear.dot(shear) > left * left), twisted
        )

    def after(
        self,
        grip: Grip,
        t: Scalar,
        frame: CarriedFrame,
        bodies: tuple[tuple[CarriedFrame, Scalar, Vec3, Hold], ...],
    ) -> Grip:
        """State of the gripper for the next control period: it keeps its grip, opens,
        slips, or grasps a body.

        Args:
            grip: state in this period.
            t: s.
            frame: gripper's frame.
            bodies: axes of each carrier, the distance of the gripper's frame from its
                skin (m), the outward normal there (world axes), and what the grasp does
                to it if it is held.
        """
        closed = True if self.kind == "hook" else self.closed.at(t)
        holding: Scalar = grip.taken > 0.5
        broken: Scalar = False
        out: Scalar = False
        near: Scalar = False
        for i, (body, distance, _, hold) in enumerate(bodies):
            this = is_taken(grip.taken, i + 1.0)
            broken = logical_or(
                broken, logical_and(this, self.is_overloaded(grip, hold, body))
            )
            above = hold.place.z - frame.position.z > self.reach
            out = (
                logical_or(out, logical_and(this, above))
                if self.kind == "hook"
                else out
            )
            near = logical_or(near, distance <= self.reach)
        keeps = logical_and(
            holding, logical_and(closed, logical_not(logical_or(broken, out)))
        )
        free = logical_and(logical_and(closed, grip.ready > 0.5), logical_not(holding))
        taken = where(keeps, grip.taken, 0.0)
        place = grip.place
        normal = grip.normal
        turn = grip.turn
        for i, (body, distance, outward, hold) in enumerate(bodies):
            # the first body within reach, in the order of the file: a gripper holds one
            takes = logical_and(logical_and(free, distance <= self.reach), taken < 0.5)
            if self.kind == "hook":
                rising = frame.velocity.z - body.velocity_at(frame.position).z
                takes = logical_and(takes, rising > 0.0)
            taken = where(takes, i + 1.0, taken)
            place = select(
                takes, body.rotation.apply_T(frame.position - body.position), place
            )
            normal = select(takes, body.rotation.apply_T(outward), normal)
            now = frame.rotation.T @ body.rotation
            # the ball has turned in its socket by what friction did not bear
            if hold.twist is not None:
                slipped = (
                    frame.rotation.T
                    @ Quaternion.of_small_rotation(hold.twist).rotation()
                    @ body.rotation
                )
                turn = blend(is_taken(grip.taken, i + 1.0), as_data(slipped), turn)
            turn = blend(takes, as_data(now), turn)
        # a hook has no command: it is ready again once no body is within its reach
        opened = logical_not(near) if self.kind == "hook" else logical_not(closed)
        used = logical_or(holding, taken > 0.5)
        return Grip(
            taken=taken,
            ready=where(opened, 1.0, where(used, 0.0, grip.ready)),
            lost=grip.lost
            + where(logical_and(holding, logical_and(closed, broken)), 1.0, 0.0),
            place=place,
            normal=normal,
            turn=turn,
        )


def is_taken(taken: Scalar, number: float) -> Scalar:
    """True if a gripper holds the movable body with a given index, counted from 1."""
    return logical_and(taken > number - 0.5, taken < number + 0.5)
