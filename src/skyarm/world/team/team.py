"""Team of vehicles whose tips hold one body: members, desired motion of the body, what
a log has of them.

A team's law says to the law of every member what its tip is about to bear and how its
reference is shifted (:class:`skyarm.reference.carry.Carry`), once in a control period,
from the motion of the body and the forces that the members estimate at their tips. This
base class says nothing: every member flies its own path.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Protocol, Self

import numpy as np

from skyarm.algebra import (
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Quaternion,
    Scalar,
    Scalars,
    Sym3,
    Vec3,
)
from skyarm.algebra.scalars import clip, data, divide, maximum, where
from skyarm.algebra.scalars.philox import normals
from skyarm.dynamics.actuators.load_limits import LoadLimits
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records import coerce
from skyarm.records.coerce import RecordError
from skyarm.records.field_rules import accept_fields
from skyarm.records.files import must_be_one_of, shown
from skyarm.records.immutable import field_if_any, immutable
from skyarm.records.leaves import Tree, as_data
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.carry import Carry
from skyarm.reference.object_motion import BodyMotion, PoseTrajectory
from skyarm.reference.splines import BEYOND, sampled_curve
from skyarm.reference.trajectory import Trajectory
from skyarm.vehicle import Vehicle
from skyarm.world.component import Column, Component
from skyarm.world.contact.carrier import CarriedFrame
from skyarm.world.contact.contact import Contact
from skyarm.world.contact.contact_memory import ContactMemory
from skyarm.world.team.virtual_masses import FLOOR, SMALL, Member, VirtualMasses

NEAREST = 0.01
"""Least distance (m) between the grasps of two members: at one place they have no line
along which they pull."""

LIGHTEST = 1e-6
"""Least virtual mass of a member, below which shares are lost to rounding."""

LEAST = 1e-3
"""Weight (N) of a body, at least, of which shares are taken."""

NO_TILT = Sym3(0, 0, 0)
"""Shares of tilting of a tip that needs none."""

STEP = 0.05
"""Time (s) between the instants at which the end of a cable is planned."""


LOGGED = (
    ("team_position_error", "m", "distance of the body from its desired position"),
    ("team_turn_error", "rad", "angle of the body from its desired attitude"),
    ("team_pull", "N", "internal force along the line of two grasps"),
    ("team_pull_reference", "N", "desired internal force along that line"),
    ("load_share", "", "vertical force of a member over the weight of the body"),
)
"""Logged quantities of a team: array, unit, meaning."""


def columns_of_labels(
    quantities: Sequence[tuple[str, str, str]], labels: Sequence[Sequence[str]]
) -> tuple[Column, ...]:
    """Log columns of some quantities, each with one column for each of its labels."""
    columns = list[Column]()
    for (array, unit, meaning), own in zip(quantities, labels, strict=True):
        columns += [Column(array, label, unit, meaning) for label in own]
    return tuple(columns)


@immutable
class TeamInputs:
    """Inputs of a team's law in a control period, world axes.

    Attributes:
        time: s. desired: desired motion of the body. body: its measured motion,
            ``pose_age`` old.
        gravity: m/s^2.
        holding: 1 while the members hold the body, else 0.
        limits, moment_limits: largest weight (N) and moment (N m) that each member
            bears; () for any.
        drawn: uniform random numbers of the messages.
        forces, moments: force (N) and moment (N m) of each member on the body, as that
            member estimates them.
        behind: tracking error (m) of each member's tip, as that member measures it.
        tilting: share of each horizontal direction in which only a tilt moves a
            member's tip; () for none.
    """

    time: Scalar
    holding: Scalar
    desired: BodyMotion
    body: CarriedFrame
    gravity: Scalar
    forces: Sequence[Vec3]
    moments: Sequence[Vec3]
    behind: Sequence[Vec3] = ()
    limits: Sequence[Scalar] = ()
    moment_limits: Sequence[Scalar] = ()
    drawn: Scalars = ()
    tilting: Sequence[Sym3] = ()


class Borne(Protocol):
    """Interface (typing.Protocol) of a law's estimate of the load at its tip, world
    axes.
    """

    @property
    def force(self) -> Vec3:
        """Force of the load on the tip, N."""
        ...

    @property
    def moment(self) -> Vec3:
        """Moment of the load on the tip, N m."""
        ...

    @property
    def behind(self) -> Vec3:
        """Shifted reference of the tip less the measured tip, m."""
        ...

    @property
    def limits(self) -> LoadLimits:
        """Largest load in the measured pose of the vehicle."""
        ...

    @property
    def tilting(self) -> Sym3:
        """Share of each horizontal direction, world axes, in which only a tilt of the
        vehicle moves its tip.
        """
        ...


@immutable
class NothingBorne:
    """Load of a member whose law estimates none: no force, no moment, no error of its
    tip.
    """

    force: Vec3 = ZERO3
    moment: Vec3 = ZERO3
    behind: Vec3 = ZERO3
    limits: LoadLimits = LoadLimits()
    tilting: Sym3 = NO_TILT


@immutable
class TeamMemory:
    """Internal state of a team: that of its law, instructions to the members, and
    numbers for the log.

    Attributes:
        seen: measured motions of the body that are not old enough for the law yet,
            newest first.
    """

    own: Tree = ()
    seen: tuple[CarriedFrame, ...] = ()
    carries: tuple[Scalars, ...] = ()
    drawn: Scalars = ()
    logged: Scalars = ()


@immutable
class Team(VirtualMasses, Component[TeamMemory]):
    """Team whose members fly their own paths to carry a body (``own_paths``), and base
    class of the team's laws.

    Attributes:
        object: name of the body. members: vehicles that hold it; left out, those of its
            grasps.
        motion: desired motion of the body.
    """

    registered_as = "team"

    shared = True

    object: Annotated[str, Unit("", "object that the team carries", rule=coerce.name)]
    members: tuple[Member, ...] = ()
    motion: PoseTrajectory | None = field_if_any(default=None)
    take: Annotated[
        Scalar,
        nonnegative(
            "s",
            "time from which the members hold the body; 0: when the last grasp closes",
        ),
    ] = 0.0
    mass: Annotated[
        Scalar, nonnegative("kg", "supposed mass of the body; 0: that of the object")
    ] = 0
    inertia: Annotated[
        Vec3,
        nonnegative(
            "kg m^2", "supposed moments of inertia of the body; 0: those of the object"
        ),
    ] = ZERO3
    com: Annotated[
        Vec3,
        Unit(
            "m",
            "supposed centre of mass from the middle of the body, its axes; 0: that of"
            " the object",
            folds=True,
        ),
    ] = ZERO3
    position_noise: Annotated[
        Scalar,
        nonnegative(
            "m", "standard deviation of the body's measured position, each axis"
        ),
    ] = 0
    attitude_noise: Annotated[
        Scalar,
        nonnegative(
            "rad", "standard deviation of the body's measured attitude, each axis"
        ),
    ] = 0
    velocity_noise: Annotated[
        Scalar,
        nonnegative(
            "m/s",
            "standard deviation of the body's measured velocity, each axis, which swing"
            " alone uses",
        ),
    ] = 0
    rate_noise: Annotated[
        Scalar,
        nonnegative(
            "rad/s",
            "standard deviation of the body's measured angular velocity, each axis",
        ),
    ] = 0
    pose_age: Annotated[
        float,
        nonnegative(
            "s",
            "age of the body's measured motion, a whole number of control periods,"
            " known to the law",
            high=1.0,
            fixed=True,
        ),
    ] = 0.0

    steers = False
    """True of a law that says something to the members, whose laws must then have the
    option ``carrying``."""

    def __post_init__(self) -> None:
        accept_fields(self, "team")

    def require_vehicles(
        self, vehicles: Mapping[str, Vehicle], period: float, gravity: Scalar
    ) -> None:
        """Refuse members that are not among the vehicles, and a law that does not fit
        the control period (s).
        """
        self.require_members(vehicles, period)

    def of_agent(self, name: str) -> Self:
        """Team as one member's own flight contains it: without the other members."""
        return replace(
            self, members=tuple(each for each in self.members if each.agent == name)
        )

    def path_of(
        self, member: Member, vehicle: Vehicle, gravity: float, duration: float
    ) -> Trajectory:
        """Path of a member's tip that carries the body; of a vehicle without joints
        that of its base.

        A cable has the direction of the member's force. Its end is planned at instants
        of a flight of ``duration`` (s) under ``gravity`` (m/s^2), joined by curves with
        four derivatives.
        """
        assert self.motion is not None
        path = member.path(self.motion, self.take)
        if coerce.absent(member.length):
            return path
        # sampled_curve takes BEYOND samples more at both ends
        t = np.arange(-BEYOND, math.ceil(duration / STEP) + 1 + BEYOND) * STEP
        desired = self.motion.at(t)
        forces = self.load(desired, gravity, t)
        force = forces[self.members.index(member)]
        along = force * (member.length / np.sqrt(force.dot(force) + SMALL))
        ends = (
            desired.position
            + self._hanging_arm(member, desired.R, sum(forces, ZERO3))
            + along
        )
        # the base carries its hook level, turned by the heading alone
        if vehicle.end_effector and not vehicle.n:
            heading = path.yaw.derivatives(t)[0]
            hook = vehicle.frame().position
            ends = ends - Vec3(
                np.cos(heading) * hook.x - np.sin(heading) * hook.y,
                np.sin(heading) * hook.x + np.cos(heading) * hook.y,
                hook.z,
            )
        x, y, z = (
            sampled_curve(np.broadcast_to(each, t.shape).tolist(), STEP)
            for each in ends
        )
        return replace(path, x=x, y=y, z=z)

    def _hanging_arm(self, member: Member, R: Mat3, force: Vec3) -> Vec3:
        """Place of a grasp from the middle of the body (m, world axes) under the force
        (N) of all members.

        A body on two cables turns freely about the line of its grasps: its middle hangs
        below it along the force.
        """
        arm = R.apply(member.place)
        if len(self.members) != 2 or any(
            coerce.absent(each.length) for each in self.members
        ):
            return arm
        (line,) = self.lines(self.arms(R))
        across, pull = (each - line * each.dot(line) for each in (arm, force))
        # as far from the line of the grasps as the place is, but along the force
        hung: Vec3 = pull * np.sqrt(across.dot(across) / (pull.dot(pull) + SMALL))
        turned: Vec3 = arm + (hung - across) * where(across.dot(pull) > 0.0, 1.0, 0.0)
        return turned

    def require_members(self, names: Collection[str], period: float) -> None:
        """Refuse members that are not among the names of vehicles, or twice one of
        them.

        Raises:
            RecordError: one line that begins with a field of the team.
        """
        require_whole_periods("pose_age", self.pose_age, period)
        agents = [each.agent for each in self.members]
        for i, name in enumerate(agents):
            if name not in names:
                raise RecordError(
                    f"members[{i}].agent = {shown(name)}: {must_be_one_of(names, name)}"
                )
            if name in agents[:i]:
                raise RecordError(
                    f"members[{i}].agent = {shown(name)}: must be of one member only"
                )
            mass = self.members[i].mass
            if coerce.concrete(mass) and 0.0 < mass < LIGHTEST:
                raise RecordError(
                    f"members[{i}].mass = {mass:g}: must be 0 or at least {LIGHTEST:g}"
                )
            place = self.members[i].place
            if any(
                (place - each.place).norm() < NEAREST
                for each in self.members[:i]
                if coerce.concrete(*place, *each.place)
            ):
                raise RecordError(
                    f"members[{i}].place = {shown([*place])}: must be {NEAREST:g} m or"
                    " more from others"
                )

    @property
    def _measured_by(self) -> int:
        """Number of random numbers of the body's measured motion in a control
        period.
        """
        pose = (self.position_noise, self.attitude_noise)
        # rates are drawn behind the pose, whose numbers are then drawn in any case
        rates = (self.velocity_noise, self.rate_noise)
        if not all(map(coerce.absent, rates)):
            return 12
        return 0 if all(map(coerce.absent, pose)) else 6

    @property
    def uniforms(self) -> int:
        """Number of random numbers in a control period: of the measured motion, and of
        the messages.
        """
        return self._measured_by + self.message_draws

    @property
    def message_draws(self) -> int:
        """Number of random numbers of the members' messages in a control period."""
        return 0

    def measured_motion(self, body: CarriedFrame, drawn: Scalars) -> CarriedFrame:
        """Measured motion of the body: the true one with noise, by uniform random
        numbers.
        """
        if not self._measured_by:
            return body
        numbers = normals(drawn[: self._measured_by])
        place, turn, *rates = (
            Vec3(*numbers[i : i + 3]) for i in range(0, len(numbers), 3)
        )
        # world axes: the error turns the measured attitude from the left
        off = Quaternion.of_rotation_vector(turn * self.attitude_noise).rotation()
        velocity, turning = rates or (ZERO3, ZERO3)
        return CarriedFrame(
            position=body.position + place * self.position_noise,
            rotation=off @ body.rotation,
            velocity=body.velocity + velocity * self.velocity_noise,
            turning=body.turning + turning * self.rate_noise,
        )

    def first(self, period: float) -> Tree:
        """Initial state of the team's law."""
        return ()

    def lead(
        self, own: Tree, inputs: TeamInputs, dt: float
    ) -> tuple[Tree, tuple[Scalars, ...]]:
        """Next state of the team's law, and its instructions to each member; () for
        none.
        """
        return own, ()

    def start(self, period: float, draws: Sequence[Scalar]) -> TeamMemory:
        """Initial internal state of the team."""
        carries = (Carry.none().numbers,) * (len(self.members) if self.steers else 0)
        logged = (0.0,) * len(self.columns)
        drawn = tuple(draws[: self.uniforms])
        seen: tuple[CarriedFrame, ...] = ()
        if self.motion is not None and self.pose_age:
            begin = self.motion.at(0.0)
            still = CarriedFrame(
                position=begin.position, rotation=begin.R, velocity=ZERO3, turning=ZERO3
            )
            # require_members found whole periods; round takes off the rounding
            seen = (as_data(still),) * round(self.pose_age / period)
        return TeamMemory(
            own=self.first(period),
            seen=seen,
            carries=carries,
            drawn=drawn,
            logged=logged,
        )

    def advance(
        self,
        memory: TeamMemory,
        t: Scalar,
        dt: float,
        state: State,
        draws: Sequence[Scalar],
    ) -> TeamMemory:
        """Internal state with the random numbers of the control period that begins."""
        return replace(memory, drawn=tuple(draws[: self.uniforms]))

    def instructions(self, memory: TeamMemory) -> dict[str, Scalars]:
        """Instructions of the law to each member, by its name."""
        return dict(
            # a team that steers by nothing has no instructions
            zip((each.agent for each in self.members), memory.carries, strict=False)
        )

    def direct(
        self,
        memory: TeamMemory,
        t: Scalar,
        dt: float,
        motion: PointMotion,
        contact: Contact,
        touching: ContactMemory,
        borne: Mapping[str, Borne],
    ) -> TeamMemory:
        """Internal state of the team after its law has spoken to the members, at the
        start of a control period.

        Args:
            memory: internal state before.
            t: s.
            dt: control period, s.
            motion: motion of all vehicles.
            contact: contact model in which the body moves.
            touching: its internal state.
            borne: load of each member by the estimate of its own law, by its name.
        """
        if self.motion is None:
            return memory
        index = [each.name for each in contact.carriers].index(self.object)
        body = contact.carriers[index].frame(touching.carried[index])
        ours = [
            (grasp, by.force)
            for grasp, of, by, _ in contact.gripping.pulls(touching, motion, t)
            if of == index
        ]
        by_agent = {grasp.agent: force for grasp, force in ours}
        closed = {grasp.agent: where(t < grasp.release, 1.0, 0.0) for grasp, _ in ours}
        # files give each member a grasp; one made in Python without it pulls nothing
        pulls = [by_agent.get(each.agent, ZERO3) for each in self.members]
        loads = [borne[each.agent] for each in self.members]
        limits = [each.limits.weight for each in loads]
        rows = zip(self.members, limits, strict=True)
        masses = (
            where(m.mass > 0.0, m.mass, self.usual_mass(limit))
            * closed.get(m.agent, 1.0)
            for m, limit in rows
        )
        team = self.with_masses(list(masses))
        desired = self.motion.at(t)
        # noise of the instant of the measurement, which ages with it
        seen = (self.measured_motion(body, memory.drawn), *memory.seen)
        inputs = TeamInputs(
            time=t,
            holding=where(t < self.take, 0.0, 1.0),
            desired=desired,
            body=seen[-1],
            gravity=motion.gravity,
            forces=[-each.force for each in loads],
            moments=[-each.moment for each in loads],
            behind=[each.behind for each in loads],
            tilting=[each.tilting for each in loads],
            limits=limits,
            moment_limits=[each.limits.moment for each in loads],
            drawn=memory.drawn[self._measured_by :],
        )
        own, carries = team.lead(memory.own, inputs, dt)
        arms = self.arms(body.rotation)
        tensions = team.tensions(team.internal(pulls, arms), arms)
        mass = next(each.mass for each in contact.objects if each.name == self.object)
        # shares of no weight would divide by 0
        weight = maximum(mass * motion.gravity, LEAST)
        off = body.position - desired.position
        turn = team.turn_error(body.rotation, desired.R)
        shares = (divide(f.z, weight) for f in pulls)
        errors = off.norm(), turn.norm()
        logged = (
            *errors,
            *tensions,
            *team.desired_tensions(t),
            *shares,
            *self.further_logged(own),
        )
        return TeamMemory(
            own=own,
            seen=as_data(seen[: len(memory.seen)]),
            carries=carries,
            drawn=memory.drawn,
            logged=as_data(logged),
        )

    def usual_mass(self, limit: Scalar) -> Scalar:
        """Virtual mass of a member that states none, by the largest weight (N) at its
        tip.
        """
        return limit

    def with_masses(self, masses: Sequence[Scalar]) -> Self:
        """Team with other virtual masses; 0 for a member that has lost its grasp."""
        rows = zip(self.members, masses, strict=True)
        return replace(
            self, members=tuple(replace(each, mass=data(m)) for each, m in rows)
        )

    def further_columns(self) -> tuple[Column, ...]:
        """Log columns of the team's law alone."""
        return ()

    def further_logged(self, own: Tree) -> Scalars:
        """Numbers of these columns, from the state of the law."""
        return ()

    def desired_tensions(self, t: Scalar) -> list[Scalar]:
        """Desired pull (N) along the line of each pair of grasps at a time (s)."""
        return [0.0] * len(self.pairs)

    def load(self, desired: BodyMotion, gravity: Scalar, t: Scalar) -> list[Vec3]:
        """Force (N) of each member on the body in a motion of it at a time (s), with
        the desired pulls.
        """
        arms = self.arms(desired.R)
        shares = self.shares(*weight_of(self, desired, gravity), arms)
        return [
            f + pull
            for f, pull in zip(
                shares, self.along(self.desired_tensions(t), arms), strict=True
            )
        ]

    @property
    def columns(self) -> tuple[Column, ...]:  # type: ignore[override]
        """Log columns: error of the body's pose, internal pull, and the share of the
        load of each member.
        """
        body = (self.object,)
        agents = [each.agent for each in self.members]
        pairs = [f"{agents[i]}_{agents[j]}" for i, j in self.pairs]
        labels = (body, body, pairs, pairs, agents)
        own = columns_of_labels(LOGGED, labels)
        return (*own, *self.further_columns())

    def columns_of(self, agent: str) -> Sequence[Column]:
        """Log columns without those of other members than ``agent``: pulls are of two
        of them.
        """
        # the label of a pull names two members: none of the others' names equals it
        others = {each.agent for each in self.members} - {agent}
        return [each for each in self.columns if each.label not in others]

    def logged(self, memory: TeamMemory, motion: PointMotion) -> Scalars:
        """Numbers of the log, as of the start of the period."""
        return memory.logged


@immutable
class TipShift:
    """Filtered shift of a tip's reference: value and rate, world axes."""

    offset: Annotated[Vec3, Unit("m", "shift of the tip's reference, world axes")] = (
        ZERO3_DATA
    )
    rate: Annotated[Vec3, Unit("m/s", "rate of the shift, world axes")] = ZERO3_DATA


@immutable
class Sharing(Team):
    """Base class of laws that instruct the members, with a desired pull and the time in
    which they take the load.
    """

    steers = True

    internal_force: Annotated[
        Scalar,
        Unit("N", "desired pull along the lines of the grasps, positive in tension"),
    ] = 0.0
    rise: Annotated[
        Scalar, positive("s", "time before the lift in which the members take the load")
    ] = 1.3
    internal_forces: Annotated[
        Scalars,
        Unit(
            "N",
            "desired pulls of members 0 and 1, 0 and 2, 1 and 2 and so on; left out:"
            " all internal_force",
        ),
    ] = ()

    def require_members(self, names: Collection[str], period: float) -> None:
        """Refuse members as the base class does, and a wrong number of desired
        pulls.
        """
        Team.require_members(self, names, period)
        if len(self.internal_forces) not in (0, len(self.pairs)):
            words = (
                f"{len(self.internal_forces)} numbers: must be {len(self.pairs)}, one"
                " of each two members"
            )
            raise RecordError(f"internal_forces = {words}")
        if (
            self.internal_forces
            and coerce.concrete(self.internal_force)
            and self.internal_force != 0.0
        ):
            raise RecordError(
                f"internal_force = {self.internal_force:g}: must be left out beside"
                " internal_forces"
            )

    def fraction(self, t: Scalar) -> Scalar:
        """Fraction of the load that the members bear at a time (s): 1 from lift to
        place.
        """
        return 0.0 if self.motion is None else load_fraction(self.motion, t, self.rise)

    def masses_moved(self, share: Scalar) -> list[Scalar]:
        """Mass (kg) of the body that each tip moves, where the members bear a ``share``
        of the load.
        """
        masses = [each.mass for each in self.members]
        whole = divide(self.mass * share, maximum(sum(masses, 0.0), FLOOR))
        return [whole * each for each in masses]

    def desired_tensions(self, t: Scalar) -> list[Scalar]:
        """Desired pull (N) along the line of each pair of grasps at a time (s)."""
        return [
            pull * self.fraction(t)
            for pull in self.internal_forces or [self.internal_force] * len(self.pairs)
        ]


def load_fraction(motion: PoseTrajectory, t: Scalar, rise: Scalar) -> Scalar:
    """Share of the load that the members bear at a time (s): 1 from lift to place,
    risen and fallen in ``rise`` (s).
    """
    up, down = (
        clip(divide(t - begin, rise), 0.0, 1.0)
        # at the lift all of it is borne, and from the stop on it is set down
        for begin in (motion.lift - rise, motion.stop)
    )
    return _smooth(up) * (1.0 - _smooth(down))


def _smooth(u: Scalar) -> Scalar:
    # quintic: its first and second derivatives are 0 at both ends
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


def weight_of(team: Team, desired: BodyMotion, gravity: Scalar) -> tuple[Vec3, Vec3]:
    """Force (N) and moment (N m) about its middle that the body's desired motion takes,
    world axes.
    """

    def times_inertia(v: Vec3) -> Vec3:
        return desired.R.apply(team.inertia.hadamard(desired.R.apply_T(v)))

    moment = times_inertia(desired.turning) + desired.rate.cross(
        times_inertia(desired.rate)
    )
    if all(map(coerce.absent, team.com)):
        return (desired.acceleration + E_Z * gravity) * team.mass, moment
    lever = desired.R.apply(team.com)
    of_mass = (
        desired.acceleration
        + desired.turning.cross(lever)
        + desired.rate.cross(desired.rate.cross(lever))
    )
    force = (of_mass + E_Z * gravity) * team.mass
    return force, moment + lever.cross(force)


def require_whole_periods(name: str, value: float, period: float) -> None:
    """Refuse a time (s) of a team's law that is no whole number of control periods (s).

    Raises:
        RecordError: one line that begins with the field's name.
    """
    # decimal fractions are whole multiples up to rounding only
    if abs(round(value / period) * period - value) > 1e-9:
        raise RecordError(
            f"{name} = {value:g}: must be a whole number of control periods of"
            f" {period:g} s"
        )
