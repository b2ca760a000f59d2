"""Grippers of a vehicle: grasp and release of movable bodies.

A grasp is a stiff spring with damping between a frame of the vehicle and the body: the pose in which they are to each
other when the gripper takes hold is kept. The law of the spring is the same for all kinds; they differ in what they
hold and where they give way:

* ``magnet`` and ``suction`` hold the whole pose. They give way to a pull beyond their force along the outward normal of
  the skin at which they took hold, to more shear than friction holds under what is left of that force, and to a torque;
* ``jaw``, two fingers that close on a body, holds the whole pose, up to a force in any direction and a torque;
* ``ball``, which a magnet or a spring draws into a socket, holds a place: the body turns about it against dry friction
  in the socket, freely without;
* ``hook`` takes hold when it rises past a body within its reach, carries it from below, and lets go when it is lowered
  out of it. It has no command.

A mechanism is held at a place by all of them: its attitude is its own, and no torque loads the grasp.

Taking hold and giving way happen at control instants. What gave way takes hold again only after it was opened.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Annotated

from skyarm.algebra import ZERO3, Mat3, Quaternion, Scalar, Vec3
from skyarm.algebra.scalars import asin, divide, logical_and, logical_or, maximum, minimum, sqrt, where
from skyarm.dynamics.point_motion import PointMotion
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, absent
from skyarm.records.field_rules import accept_fields, checked
from skyarm.records.files.toml import Entry
from skyarm.records.immutable import field_if_any, immutable, positional
from skyarm.records.leaves import Tree
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.signals import Constant, Signal, signal_from
from skyarm.world.component import Column, Wrench, select
from skyarm.world.contact.carrier import AnyCarrier, CarriedFrame, both
from skyarm.world.contact.grasp import frame_of
from skyarm.world.contact.material import BRISTLE_STEP, LIGHTEST, NORMAL_STEP, ROUGHEST, euler_step_of

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
        """Read a gripper command from a value of a scenario file; raises a one-line ValueError if invalid."""
        return cls(signal_from(entry, where))

    def at(self, t: Scalar) -> Scalar:
        """True if the gripper is commanded closed at time ``t`` (s)."""
        closed: Scalar = self.signal.derivatives(t)[0] > 0.5
        return closed


@immutable
class Grip:
    """Internal state of a gripper: index of the held body, pose of the grasp, and number of slips.

    Attributes:
        taken: number of the carrier that it holds, from 1; 0 for none.
        ready: 1 where it may take hold: it was opened since it last held something. lost: number of slips.
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
class Hold:
    """Force and torque of a grasp on the grasped body, world axes.

    Attributes:
        force: N, at ``place`` (m). torque: N m, beside that of the force.
        twist: rad, world axes, from the body's attitude to that of the grasp, as much of it as friction in the socket
            of a ball bears; None of what has no friction.
    """

    force: Vec3
    torque: Vec3
    place: Vec3
    twist: Vec3 | None = None


@immutable
class Gripper:
    """Gripper of the vehicle (magnet, suction cup, jaw, ball or hook) that can hold one movable body.

    Attributes:
        name: name in messages, logs and paths. kind: one of ``KINDS``.
        frame: frame of the vehicle; empty for its tip. closed: command, a signal of time.
        agent: name of the vehicle; empty for the only one.
    """

    name: Annotated[str, Unit("", "name of the gripper, for messages, logs and paths", rule=coerce.name)]
    kind: Annotated[str, Unit("", "kind of the gripper", rule=coerce.word_of(KINDS))] = "magnet"
    frame: str = ""
    closed: Command = field(default_factory=Command)
    reach: Annotated[Scalar, positive("m", "largest distance from the gripper's frame to a body that it can take")] = (
        0.01
    )
    force: Annotated[
        Scalar,
        positive("N", "force at which the grasp opens", effect="higher values hold heavier loads"),
    ] = 10.0
    torque: Annotated[
        Scalar,
        positive("N m", "torque at which the grasp opens", effect="higher values hold loads farther off their centre"),
    ] = 0.5
    friction: Annotated[
        Scalar,
        nonnegative(
            "",
            "friction coefficient of a magnet or cup against shear, or of a ball in its socket",
            high=ROUGHEST,
            effect="higher values slip later",
        ),
    ] = 0.5
    radius: Annotated[Scalar, nonnegative("m", "radius of a ball in its socket; 0 turns without friction")] = 0.005
    stiffness: Annotated[
        Scalar,
        positive(
            "N/m",
            "stiffness of the grasp",
            effect="higher values hold the body more rigidly and need smaller integration steps",
        ),
    ] = 5000.0
    damping_ratio: Annotated[
        Scalar,
        nonnegative(
            "",
            "damping ratio of the grasp with less than 20 g",
            high=2.0,
            effect="higher values let the held body swing less in the grasp",
        ),
    ] = 0.5
    agent: str = field_if_any(default="")

    def __post_init__(self) -> None:
        accept_fields(self, "gripper")
        coerce.fold_zeros(self, "radius")
        if self.kind == "hook" and self.closed != Command():
            raise RecordError("gripper.closed: must be left out of a hook, which has no command")

    @property
    def columns(self) -> tuple[Column, ...]:
        """Log columns of the gripper: held body, grasp force, and number of slips."""
        pull = (Column("gripper_pull", f"{self.name}/{axis}", "N", "on what is held") for axis in "xyz")
        return (
            Column("gripper_taken", self.name, "", "number of the object that is held, from 1; 0 for none"),
            Column("gripper_force", self.name, "N", "of the grasp"),
            Column("gripper_lost", self.name, "", "how often a grasp has given way"),
            *pull,
        )

    def step_of(self, mass: Scalar, moved: Scalar, *, euler: bool = False) -> Scalar:
        """Longest stable integration step (s) of the spring and damper that model a grasp.

        Args:
            mass: mass (kg) that it moves at least where it holds at the skin; its damping follows from that.
            moved: mass (kg) that it moves at least at the end of its reach.
            euler: True for the semi-implicit Euler method.
        """
        square, decay = self.stiffness / moved, self.damping(mass) / moved
        bound = euler_step_of(square, decay)
        if not euler:  # the faster of the two poles of an overdamped grasp, or the frequency
            half = 0.5 * decay
            fastest = maximum(half, sqrt(square)) + sqrt(maximum(half * half - square, 0.0))
            bound = BRISTLE_STEP / fastest
        return minimum(NORMAL_STEP * sqrt(mass / self.stiffness), bound)

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
        """Friction torque (N m) in the socket of a ball gripper under a preload equal to the gripper's pull-off force.

        M = mu F r: the frictional moment of a spherical plain bearing under a load F (SKF, Spherical plain bearings and
        rod ends, catalogue 4407: M = 0.5 mu P d). mu: 0.5 dry, 0.1 to 0.2 greased steel.
        """
        return self.friction * self.force * self.radius

    def tilt_warning(self, name: str, mass: Scalar, half_width: Scalar) -> Iterator[str]:
        """Warning if a ball gripper has too little friction to hold a mass (kg) level when gripped off its centre."""
        level = self.socket_torque / (mass * EARTH)
        if self.kind == "ball" and level < half_width:
            torque, off = float(self.socket_torque), 1e3 * float(level)
            yield (
                f"grippers.{self.name}.radius = {float(self.radius):g}: friction of this ball gives {torque:.2g} N m "
                f"and holds {name!r} level up to {off:.2g} mm beside its centre of mass; further off it hangs tilted "
                "and lands on an edge"
            )

    def start(self) -> Grip:
        """Initial state of the gripper: open and ready to grasp."""
        return replace(UNCHANGED, ready=1.0)

    def hold(self, grip: Grip, frame: CarriedFrame, body: CarriedFrame, mass: Scalar, gyration: Scalar) -> Hold:
        """Force and torque that the gripper would exert on a body if it held that body.

        Args:
            grip: memory of the gripper.
            frame: gripper's frame.
            body: axes of the held body.
            mass: mass that the grasp moves at least, kg.
            gyration: square of a radius of gyration of the body, m^2: of an attitude's stiffness by a place's.
        """
        place = body.position + body.rotation.apply(grip.place)
        damping = self.damping(mass)
        stretch, speed = frame.position - place, frame.velocity_at(place) - body.velocity_at(place)
        force = stretch * self.stiffness + speed * damping
        if self.kind == "hook":  # it carries, and does not press down
            force = Vec3(force.x, force.y, maximum(force.z, 0.0))
        torque, twist = ZERO3, None
        if self.holds_attitude and not absent(gyration):
            aim, has = frame.rotation @ grip.turn, body.rotation
            error = ZERO3
            for i in range(3):
                error = error + has.column(i).cross(aim.column(i)) * 0.5
            torque = (error * self.stiffness + (frame.turning - body.turning) * damping) * gyration
            if self.kind == "ball":
                most = self.socket_torque
                torque = _within_length(torque, most)
                # the angle, of which the error is the sine: what friction bears alone does not creep
                sine = minimum(sqrt(error.dot(error) + TINY), 1.0)
                angle = error * divide(asin(sine), sine)
                twist = _within_length(angle, divide(most, self.stiffness * gyration))
        return Hold(force=force, torque=torque, place=place, twist=twist)

    def is_overloaded(self, grip: Grip, hold: Hold, body: CarriedFrame) -> Scalar:
        """True if the load of a grasp exceeds the gripper's limits."""
        force, torque = hold.force, hold.torque
        twisted = False if self.kind == "ball" else torque.dot(torque) > self.torque * self.torque
        if self.kind not in ADHESIVE:
            return _any(force.dot(force) > self.force * self.force, twisted)
        normal = body.rotation.apply(grip.normal)
        pull = force.dot(normal)
        shear = force - normal * pull
        left = self.friction * maximum(self.force - pull, 0.0)
        return logical_or(logical_or(pull > self.force, shear.dot(shear) > left * left), twisted)

    def after(
        self, grip: Grip, t: Scalar, frame: CarriedFrame, bodies: tuple[tuple[CarriedFrame, Scalar, Vec3, Hold], ...]
    ) -> Grip:
        """State of the gripper for the next control period: it keeps its grip, opens, slips, or grasps a body.

        Args:
            grip: state in this period.
            t: s.
            frame: gripper's frame.
            bodies: axes of each carrier, the distance of the gripper's frame from its skin (m), the outward normal
                there (world axes), and what the grasp does to it if it is held.
        """
        closed = True if self.kind == "hook" else self.closed.at(t)
        holding: Scalar = grip.taken > 0.5
        broken: Scalar = False
        out: Scalar = False
        near: Scalar = False
        for i, (body, distance, _, hold) in enumerate(bodies):
            this = is_taken(grip.taken, i + 1.0)
            broken = _any(broken, _both(this, self.is_overloaded(grip, hold, body)))
            above = hold.place.z - frame.position.z > self.reach
            out = _any(out, _both(this, above)) if self.kind == "hook" else out
            near = _any(near, distance <= self.reach)
        keeps = _both(holding, _both(closed, _both(_not(broken), _not(out))))
        free = _both(_both(closed, grip.ready > 0.5), _not(holding))
        taken, place, normal, turn = where(keeps, grip.taken, 0.0), grip.place, grip.normal, grip.turn
        for i, (body, distance, outward, hold) in enumerate(bodies):
            takes = _both(_both(free, distance <= self.reach), taken < 0.5)
            if self.kind == "hook":
                rising = frame.velocity.z - body.velocity_at(frame.position).z
                takes = _both(takes, rising > 0.0)
            taken = where(takes, i + 1.0, taken)
            place = select(takes, body.rotation.apply_T(frame.position - body.position), place)
            normal = select(takes, body.rotation.apply_T(outward), normal)
            now = frame.rotation.T @ body.rotation
            if hold.twist is not None:  # the ball has turned in its socket by what friction did not bear
                slipped = frame.rotation.T @ Quaternion.of_small_rotation(hold.twist).rotation() @ body.rotation
                turn = _select_rows(is_taken(grip.taken, i + 1.0), slipped, turn)
            turn = _select_rows(takes, now, turn)
        opened = _not(near) if self.kind == "hook" else _not(closed)
        used = _any(holding, taken > 0.5)
        return Grip(
            taken=taken, ready=where(opened, 1.0, where(used, 0.0, grip.ready)),
            lost=grip.lost + where(_both(holding, _both(closed, broken)), 1.0, 0.0),
            place=place, normal=normal, turn=turn,
        )  # fmt: skip


def is_taken(taken: Scalar, number: float) -> Scalar:
    """True if a gripper holds the movable body with a given index, counted from 1."""
    return logical_and(taken > number - 0.5, taken < number + 0.5)


def _not(condition: Scalar) -> Scalar:
    """Logical not of a Boolean constant or of a traced condition."""
    return not condition if isinstance(condition, bool) else where(condition, 0.0, 1.0) > 0.5


def _both(a: Scalar, b: Scalar) -> Scalar:
    """Logical and of two conditions; a constant True is dropped."""
    return b if a is True else a if b is True else logical_and(a, b)


def _any(a: Scalar, b: Scalar) -> Scalar:
    """Logical or of two conditions; a constant False is dropped."""
    return b if a is False else a if b is False else logical_or(a, b)


def _select_rows(condition: Scalar, a: Mat3, b: Mat3) -> Mat3:
    return Mat3(*(select(condition, x, y) for x, y in zip(a.rows, b.rows, strict=True)))


def _within_length(vector: Vec3, most: Scalar) -> Vec3:
    """Vector scaled down to a given length if it is longer; zero for a length of zero."""
    return vector * divide(most, maximum(sqrt(vector.dot(vector) + TINY), most))


TINY = 1e-24
"""Squared length added in a quotient to avoid division by zero."""

_NOTHING = Vec3(0.0, 0.0, 0.0)

UNCHANGED = Grip(
    taken=0.0, ready=0.0, lost=0.0, place=_NOTHING, normal=_NOTHING, turn=Mat3(_NOTHING, _NOTHING, _NOTHING)
)  # fmt: skip
"""Rate of a grip's internal state: zero, since it changes at control instants only."""


@immutable
class Grasps:
    """Grippers of the vehicle together with the bodies that they can grasp.

    Its methods take the states of both, ``grips`` and ``memories``.

    Attributes:
        grippers: grippers of the vehicle. carriers: bodies of the world.
    """

    grippers: tuple[Gripper, ...]
    carriers: tuple[AnyCarrier, ...]

    def steps(self, *, euler: bool = False) -> Iterator[tuple[str, Scalar]]:
        """Longest stable integration step (s) of every possible grasp, with the name of its gripper."""
        for gripper in self.grippers:
            for carrier in self.carriers:
                mobilities = carrier.mobility, carrier.mobility_at(gripper.reach)
                masses = [both(LIGHTEST, 1.0 / each) for each in mobilities]
                yield f"gripper {gripper.name!r}", gripper.step_of(*masses, euler=euler)

    def frames(self, motion: PointMotion) -> list[CarriedFrame]:
        """World pose and velocity of each gripper's frame."""
        return [frame_of(motion.of(gripper.agent), gripper.frame) for gripper in self.grippers]

    def bodies(self, memories: Sequence[Tree]) -> list[CarriedFrame]:
        """World pose and velocity of each movable body."""
        return [carrier.frame(memory) for carrier, memory in zip(self.carriers, memories, strict=True)]

    def possible(
        self, grips: Sequence[Grip], frames: Sequence[CarriedFrame], bodies: Sequence[CarriedFrame]
    ) -> list[list[Hold]]:
        """Force and torque of each gripper on each movable body if it held that body, as [gripper][body]."""
        masses = [both(LIGHTEST, 1.0 / carrier.mobility) for carrier in self.carriers]
        every = list(zip(bodies, masses, self.carriers, strict=True))
        return [
            [gripper.hold(grip, frame, body, mass, carrier.gyration) for body, mass, carrier in every]
            for gripper, grip, frame in zip(self.grippers, grips, frames, strict=True)
        ]

    def holds(
        self, grips: Sequence[Grip], memories: Sequence[Tree], frames: Sequence[CarriedFrame]
    ) -> list[list[Hold]]:
        """Force and torque of each gripper on each movable body, zero for bodies not held, as [gripper][body]."""
        possible = self.possible(grips, frames, self.bodies(memories))
        return [
            [_scale_hold(hold, where(is_taken(grip.taken, i + 1.0), 1.0, 0.0)) for i, hold in enumerate(row)]
            for grip, row in zip(grips, possible, strict=True)
        ]

    def on_bodies(
        self, grips: Sequence[Grip], memories: Sequence[Tree], motion: PointMotion
    ) -> list[tuple[Vec3, Vec3]]:
        """Total force (N) and torque (N m, about the body's origin) of all grasps on each movable body."""
        holds, bodies = self.holds(grips, memories, self.frames(motion)), self.bodies(memories)
        loads = []
        for i, body in enumerate(bodies):
            force = torque = ZERO3
            for row in holds:
                hold = row[i]
                force = force + hold.force
                torque = torque + hold.torque + (hold.place - body.position).cross(hold.force)
            loads.append((force, torque))
        return loads

    def on_vehicle(self, grips: Sequence[Grip], memories: Sequence[Tree], motion: PointMotion) -> list[Wrench]:
        """Reaction forces and torques of all grasps on the vehicle."""
        frames, wrenches = self.frames(motion), []
        for gripper, frame, row in zip(self.grippers, frames, self.holds(grips, memories, frames), strict=True):
            at = motion.of(gripper.agent).vehicle.frame(gripper.frame or None)
            force = torque = ZERO3
            for hold in row:
                force = force - hold.force
                torque = torque - hold.torque - (hold.place - frame.position).cross(hold.force)
            wrench = Wrench(force_W=force, torque_W=torque, point=at.position, body=at.link, agent=gripper.agent)
            wrenches.append(wrench)
        return wrenches

    def after(
        self, grips: Sequence[Grip], memories: Sequence[Tree], t: Scalar, motion: PointMotion
    ) -> tuple[Grip, ...]:
        """States of all grippers for the next control period, after possible grasps, releases and slips."""
        frames, bodies = self.frames(motion), self.bodies(memories)
        possible = self.possible(grips, frames, bodies)
        following = []
        for gripper, grip, frame, row in zip(self.grippers, grips, frames, possible, strict=True):
            skins = [_skin(carrier, body, frame.position) for carrier, body in zip(self.carriers, bodies, strict=True)]
            seen = tuple((body, *skin, hold) for body, skin, hold in zip(bodies, skins, row, strict=True))
            now = motion.of(gripper.agent).task_time if gripper.agent else t
            following.append(gripper.after(grip, now, frame, seen))
        return tuple(following)

    def logged(self, grips: Sequence[Grip], memories: Sequence[Tree], motion: PointMotion) -> list[Scalar]:
        """Logged values of each gripper: held body, grasp force (N), number of slips, force vector (N).

        The pull is the force on what it holds, N, world axes.
        """
        numbers: list[Scalar] = []
        for grip, row in zip(grips, self.holds(grips, memories, self.frames(motion)), strict=True):
            total = ZERO3
            for hold in row:
                total = total + hold.force
            numbers += [grip.taken, sqrt(total.dot(total)), grip.lost, *total]
        return numbers


def _skin(carrier: AnyCarrier, body: CarriedFrame, place: Vec3) -> tuple[Scalar, Vec3]:
    """Distance (m) of a point from the nearest surface of a movable body, and the outward normal there."""
    depths = [body.depth(surface, place, 0) for surface in carrier.surfaces]
    deepest, normal = depths[0]
    for depth, outward in depths[1:]:
        nearer = depth > deepest
        deepest = where(nearer, depth, deepest)
        normal = select(nearer, outward, normal)
    return -deepest, normal


def _scale_hold(hold: Hold, share: Scalar) -> Hold:
    """Force and torque of a grasp multiplied by a factor."""
    return replace(hold, force=hold.force * share, torque=hold.torque * share)
