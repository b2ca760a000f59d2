"""Team law ``object_wrench``: the body's wrench shared in advance, and its pose and
internal force controlled.

The members bear the wrench of the body's desired motion by shares without internal
forces, and beside it a stated pull T_d along the lines of the grasps; each compensates
its part in advance. The error of the body's measured position and attitude, and its
slow integral, shift and turn all tip references together:

    xi' = k (x_d - x - e),
    zeta' = k (rotation R -> R_d, less that of e)   while the body is off its support.

Here e is the tracking error of the tips, a rigid displacement that fits those of all
members: their own loops remove it. What an integral of the whole error adds while a
gust moves them would come off slowly, and excite a heavy body. Both errors are taken at
the grasps and at one time: a body that swings about the line of two ball grasps moves
its middle, and the tips cannot hold that. With a misfit d of the grasps the integrals
follow xi' = -k (xi + d), whatever the loops of the members; the proportional part h
leaves d / (1 + h) of a misfit that comes and goes faster, such as that of a late clock.
Below h = 1 this loop is stable with any age of the pose that is small against 1 / k
(small gain). e is left out of ball grasps only: a moment in a fixed grasp, or the tilt
of a vehicle on a cable, is an error of the tip that lasts, and the integrals have to
remove it. There the proportional part would act on the members' own loops, and is 0.
The integral feeds the sway of a body on cables of length l at the rate k / 2; its
velocity damps the sway, by ``swing``, from k l / g on (Routh).

Observers of members that hold one body stiffly fight: each compensates the pull of the
others, so that the pull grows by about 90 N/s for each metre that the grasps are
misplaced, until a joint is at its limit. Here the observers forget the internal part of
the members' forces at the rate w. For two equal members of mass m, damping c, stiffness
k with observers of bandwidth w_o on a grasp of stiffness K, the internal mode is

    m p^3 + (c + m W) p^2 + (k + c W + K) p + k W + K w,   W = w_o + w,

and stable for every K and w >= 0 (Routh: W > w). An integral of the difference in the
places of the tips, in the axes of the body, removes the rest. Over messages that are
late by L in the mean, both act through a delay: w is divided by 1 + w L, and the rate
of the integral by its square, so that w L stays below 1. Both are slowed down in the
same way where a tip moves only as its vehicle leans, across the plane of an arm of
parallel axes. All shifts pass (p + filter)^2, of which the members get value, rate and
acceleration; the proportional part passes one pole more, so that noise of the pose does
not shake the rotors.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import reduce
from typing import Annotated, cast

from skyarm.algebra import E_Z, ZERO3, ZERO3_DATA, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import (
    clip,
    data,
    divide,
    logical_or,
    maximum,
    minimum,
    mul,
    where,
)
from skyarm.records import coerce
from skyarm.records.coerce import RecordError, absent
from skyarm.records.immutable import immutable
from skyarm.records.leaves import Tree, as_data
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference.carry import Carry
from skyarm.reference.object_motion import BodyMotion
from skyarm.world.component import Column, shorten
from skyarm.world.team.team import (
    NO_TILT,
    Sharing,
    TeamInputs,
    TipShift,
    columns_of_labels,
    require_whole_periods,
    weight_of,
)
from skyarm.world.team.virtual_masses import SMALL

FARTHEST, MOST = 0.3, 0.1
"""Largest shift (m, and rad) of all tips together, and of each against the others."""

LIFTED = 0.01
"""Desired height (m) above the start from which the pose of the body is corrected."""

STANDING = 4.0
"""Factor, less one, on the rate at which all force on a body that stands is forgotten:
its support bears it."""

EASING, LEAST_EASE, SLACK = 5.0, 0.02, 0.1
"""Rate (1/s) at which an overloaded member passes load to others, its least part, and a
negligible load (N)."""

PATIENCE, TOLERANCE, SINKING = 1.0, 0.02, 0.15
"""Time (s) and share of an overload, after a member was lost, that the others bear
before they stop within 1 s and set the body down; speed (m/s) of that.

Chosen. With half and twice the time a body of 3 kg is set down 0.5 s sooner and 1 s
later; half and twice the speed take it down at 0.3 and 1.2 m/s^2 at most for 0.6, 3.4 s
later and 1.6 s sooner; half and twice the share change nothing there (measured)."""

LASTING = ("fixed", "cable")
"""Kinds of grasps at which tips may stay behind their references."""

TILTING = 0.1
"""Factor on the rate ``blind``, and its square on ``pull_gain``, where only a tilt of a
member moves its tip."""

LEAST_LEVER = 0.02
"""Lever (m) of the weight, beyond what forces and fixed grasps of the members bear,
from which the body tips."""


MESSAGES = (
    ("message_age", "s", "age of the force that others have of a member"),
    ("messages_lost", "", "number of a member's messages that were lost"),
)
"""Logged quantities of the messages: array, unit, meaning."""


@immutable
class ForceMessage:
    """Force of a member on the body as others have it, and number of lost messages."""

    force: Annotated[Vec3, Unit("N", "estimated force on the body, world axes")] = (
        ZERO3_DATA
    )
    age: Annotated[Scalar, Unit("s", "time since the message")] = 0.0
    lost: Annotated[Scalar, Unit("", "number of lost messages")] = 0.0


@immutable
class PoseErrors:
    """Errors of the body's pose that shift and turn all tips together: their integrals,
    and filtered ones.

    Attributes:
        waiting: errors of the grasps' places on the body or of the tips, newest first,
            until the other ones are as old.
    """

    place: Annotated[
        Vec3, Unit("m", "integral of the body's position error, world axes")
    ] = ZERO3_DATA
    turn: Annotated[
        Vec3, Unit("rad", "integral of the body's attitude error, world axes")
    ] = ZERO3_DATA
    off: Annotated[
        Vec3, Unit("m", "filtered position error, less that of the tips, world axes")
    ] = ZERO3_DATA
    askew: Annotated[
        Vec3, Unit("rad", "filtered attitude error, less that of the tips, world axes")
    ] = ZERO3_DATA
    waiting: tuple[tuple[Vec3, ...], ...] = ()


@immutable
class WrenchMemory:
    """State of the law: errors of the pose, integrals of internal forces, filters, and
    forces on their way to others.

    Attributes:
        inner: integral of each member's internal force, as a shift (m) in the axes of
            the body.
        eases: part of its virtual mass with which each member takes part, less where
            its limits ask for it.
        sent: last message of each member that was not lost. late: those before, newest
            first, as many as it is late by.
        ages: age (s) of the message of each member that the others have.
    """

    pose: PoseErrors = PoseErrors()
    inner: tuple[Vec3, ...]
    eases: Scalars
    overload: Annotated[
        Scalar, Unit("s", "time for which the members have borne more than they can")
    ] = 0.0
    clock: Annotated[
        Scalar,
        Unit("s", "time of the desired motion, which stops when the body is set down"),
    ] = 0.0
    shifts: tuple[TipShift, ...]
    sent: tuple[ForceMessage, ...]
    ages: Scalars
    since: Annotated[Scalar, Unit("s", "time since the members sent messages")] = 1e6
    late: tuple[tuple[ForceMessage, ...], ...] = ()


@immutable
class CarryCourse:
    """Desired motion of the body after losses of members.

    Attributes:
        clock: time (s) of the desired motion that it is at. pace: its rate. desired:
            motion there.
        then: motion at the time of the measured pose.
        lower: displacement from it, m, world axes. share: part of the weight that the
            members bear.
        aloft: 0 after the body was set down, else 1.
        heading: turn (rad) from the desired heading of now, with rate and acceleration.
    """

    clock: Scalar
    pace: Scalar
    desired: BodyMotion
    then: BodyMotion
    lower: Vec3
    share: Scalar
    aloft: Scalar
    heading: Vec3


@immutable
class ObjectWrench(Sharing):
    """Law that shares the wrench of a body and controls its pose and the internal
    forces of the members.
    """

    pose_gain: Annotated[
        Scalar,
        nonnegative(
            "1/s",
            "rate at which all tips shift per error of the body's pose that the errors"
            " of the tips do not explain",
            effect="higher values remove a misplaced grasp sooner and pass more noise",
        ),
    ] = 0.3
    pose_shift: Annotated[
        Scalar,
        nonnegative(
            "",
            "ball grasps: shift of all tips per error of the body's pose that the"
            " errors of the tips do not explain",
            effect=(
                "higher values leave less of an error that comes and goes and pass more"
                " noise"
            ),
        ),
    ] = 0.6
    blind: Annotated[
        Scalar,
        nonnegative(
            "1/s",
            "rate at which the observers' estimates of internal forces decay to the"
            " desired pull",
            effect=(
                "higher values leave less internal force and tolerate less delay of"
                " messages"
            ),
        ),
    ] = 10.0
    blind_moments: Annotated[
        Scalar,
        nonnegative(
            "1/s",
            "fixed grasps: rate at which the observers' estimates of moments between"
            " tip and body decay",
            effect="higher values leave less moment in a fixed grasp",
        ),
    ] = 10.0
    pull_gain: Annotated[
        Scalar,
        nonnegative(
            "m/(N s)",
            "rate at which an internal force moves the tips apart",
            effect=(
                "higher values remove an internal force sooner and oscillate if blind"
                " is low"
            ),
        ),
    ] = 0.12
    swing: Annotated[
        Scalar,
        nonnegative(
            "s",
            "on cables: shift of all tips per sideways error of the body's velocity",
            effect="higher values damp the swing sooner and shift the members more",
        ),
    ] = 0.0
    filter: Annotated[
        Scalar,
        positive(
            "rad/s",
            "bandwidth of the filter of all shifts",
            effect="higher values shift the tips sooner and pass more noise",
        ),
    ] = 10.0
    delay: Annotated[
        float,
        nonnegative(
            "s",
            "age of the other members' forces, a whole number of control periods",
            high=1.0,
            fixed=True,
        ),
    ] = 0.0

    rate: Annotated[
        Scalar,
        nonnegative(
            "Hz",
            "rate at which members send their forces to the others; 0: in every control"
            " period",
        ),
    ] = 0
    loss: Annotated[
        Scalar, nonnegative("", "probability that a message is lost", high=1.0)
    ] = 0
    timeout: Annotated[
        Scalar,
        nonnegative(
            "s",
            "age of a message, without delay, from which internal forces are not"
            " controlled",
        ),
    ] = 0.5

    @property
    def message_draws(self) -> int:
        """One random number a message where messages get lost."""
        return 0 if absent(self.loss) else len(self.members)

    def require_members(self, names: Collection[str], period: float) -> None:
        """Refuse members as the base class does, and messages that are late by no whole
        number of periods (s).
        """
        Sharing.require_members(self, names, period)
        require_whole_periods("delay", self.delay, period)
        if (
            coerce.concrete(self.rate, self.timeout)
            and self.rate * self.timeout < 1.0
            and self.rate > 0.0
        ):
            raise RecordError(
                f"timeout = {self.timeout:g}: must be {1.0 / self.rate:g} s or more,"
                " the period of rate"
            )

    def further_columns(self) -> tuple[Column, ...]:
        """Log columns of the messages."""
        agents = [each.agent for each in self.members]
        return columns_of_labels(MESSAGES, (agents, agents))

    def first(self, period: float) -> WrenchMemory:
        """Initial state of the law: nothing shifted."""
        count = len(self.members)
        sent = (ForceMessage(),) * count
        # members say a period later where their tips were
        waiting = ((ZERO3_DATA,) * count,) * (
            max(round(self.pose_age / period) - 1, 0) if self.pose_age else 1
        )
        return WrenchMemory(
            pose=PoseErrors(waiting=waiting),
            inner=(ZERO3_DATA,) * count,
            eases=(1.0,) * count,
            shifts=(TipShift(),) * count,
            sent=sent,
            ages=(0.0,) * count,
            late=(sent,) * round(self.delay / period),
        )

    def further_logged(self, own: Tree) -> Scalars:
        """Age of the received messages (s), and number of those that were lost."""
        own = cast("WrenchMemory", own)
        return (*own.ages, *(each.lost for each in own.sent))

    def lead(
        self, own: Tree, inputs: TeamInputs, dt: float
    ) -> tuple[WrenchMemory, tuple[Scalars, ...]]:
        """Next state of the law, and to each member its part of the load and the shift
        of its tip.
        """
        own = cast("WrenchMemory", own)
        # a member without a virtual mass has lost its grasp
        holding = [where(each.mass > 0.0, inputs.holding, 0.0) for each in self.members]
        team = self.with_masses(
            [
                each.mass * ease
                for each, ease in zip(self.members, own.eases, strict=True)
            ]
        )
        course = self._course(own, inputs, dt)
        desired, share = course.desired, course.share
        R = desired.R
        arms = self.arms(R)
        standing = 1.0 - share
        loads, moments, ratios, short = team._loads(desired, inputs, arms, holding)
        # a lost member counts from where the others bear a quarter of the load
        after_loss = where(
            (inputs.holding * len(holding) - sum(holding, 0.0)) * share > 0.25, 1.0, 0.0
        )
        # past PATIENCE it only grows: a body that is being set down is set down
        overload = (own.overload + dt) * where(
            own.overload < PATIENCE, after_loss * where(short, 1.0, 0.0), 1.0
        )
        pulls = team.along(
            [each * course.aloft for each in self.desired_tensions(course.clock)], arms
        )
        forces = [load * share + pull for load, pull in zip(loads, pulls, strict=True)]
        sent, since = self._send(own, inputs, dt)
        late = (sent, *own.late)
        received = list(zip(late[-1], holding, strict=True))
        # 0 while a message is too old: internal forces are left as they are
        fresh = reduce(
            mul, (where(m.age * h > self.timeout, 0.0, 1.0) for m, h in received)
        )
        internal = team.internal([m.force * h for m, h in received], arms)
        excess = [
            ((pull - inner) * (share * fresh) + (force - own_force) * standing) * h
            for pull, inner, force, own_force, h in zip(
                pulls, internal, forces, inputs.forces, holding, strict=True
            )
        ]
        pose = team._pose_errors(own.pose, inputs, course, arms, dt)
        ahead = pose.place + pose.off * self.pose_shift
        aslant = pose.turn + pose.askew * self.pose_shift
        missing = course.then.velocity - inputs.body.velocity
        # not its turning: a twist on spread cables is quicker than vehicles that lean,
        # which would feed it
        slip = Vec3(missing.x, missing.y, 0.0)
        prompt = self._promptness
        # half for each of two members: the tips part at pull_gain together
        step = 0.5 * self.pull_gain * prompt * prompt * dt
        tilted = [
            share_of_tilt.apply(each)
            for share_of_tilt, each in zip(
                inputs.tilting or [NO_TILT] * len(excess), excess, strict=True
            )
        ]
        quick = [
            # by its square, as ``step`` by that of ``prompt``
            each - slow * (1.0 - TILTING * TILTING)
            for each, slow in zip(excess, tilted, strict=True)
        ]
        inner = [
            shorten(q + R.apply_T(each) * step, MOST)
            for q, each in zip(own.inner, quick, strict=True)
        ]
        moved_masses = team.masses_moved(share)
        shifts = []
        carries = []
        blind = self.blind * prompt * (1.0 + STANDING * standing)
        for i, (member, shift, h) in enumerate(
            zip(self.members, own.shifts, holding, strict=True)
        ):
            planned = inputs.desired.of_place(member.place)
            target = ahead + aslant.cross(arms[i]) + R.apply(inner[i]) + course.lower
            target = target + slip * self.swing
            w = self.filter
            bend = (target - shift.offset) * (w * w) - shift.rate * (2.0 * w)
            speed = shift.rate + bend * dt
            moved = as_data(TipShift(offset=shift.offset + speed * dt, rate=speed))
            shifts.append(moved)
            aside = zip(
                (moved.offset, moved.rate, bend),
                desired.of_place(member.place),
                planned,
                strict=True,
            )
            offset, rate, acceleration = (
                s + (there - here) for s, there, here in aside
            )
            moment = moments[i] * share
            carry = Carry(
                held=h,
                force=-forces[i] * h,
                moment=-moment,
                forgotten_force=(excess[i] - tilted[i] * (1.0 - TILTING)) * blind,
                forgotten_moment=(moment - inputs.moments[i])
                # only a fixed grasp has a moment that its observer may forget
                * (h * self.blind_moments if member.kind == "fixed" else 0.0),
                offset=offset,
                offset_rate=rate,
                offset_acceleration=acceleration,
                heading=course.heading,
                settling=w,
                mass=moved_masses[i] * h,
            )
            carries.append(carry.numbers)
        eases = (
            ease + (clip(ease * ratio, LEAST_EASE, 1.0) - ease) * (EASING * dt)
            for ease, ratio in zip(own.eases, ratios, strict=True)
        )
        following = WrenchMemory(
            pose=pose,
            inner=as_data(tuple(inner)),
            eases=tuple(map(data, eases)),
            overload=data(overload),
            clock=data(course.clock),
            shifts=tuple(shifts),
            sent=sent,
            ages=tuple(each.age + self.delay for each in late[-1]),
            since=data(since),
            late=late[: len(own.late)],
        )
        return following, tuple(carries)

    def _pose_errors(
        self,
        pose: PoseErrors,
        inputs: TeamInputs,
        course: CarryCourse,
        arms: Sequence[Vec3],
        dt: float,
    ) -> PoseErrors:
        """Next filtered errors of the body's pose and their integrals, while it is off
        its support.
        """
        assert self.motion is not None
        goal = course.desired.position.z + course.lower.z
        # what hangs from the start has no support
        aloft = where(
            where(self.motion.lift > 0.0, goal - self._start, 1.0) > LIFTED, dt, 0.0
        )
        off = course.then.position + course.lower - inputs.body.position
        askew = self.turn_error(inputs.body.rotation, course.then.R)
        near = cast("Scalar", 0.0)
        waiting = pose.waiting
        if inputs.behind and all(each.kind not in LASTING for each in self.members):
            goal_place = course.then.position + course.lower
            places = zip(
                self.arms(course.then.R), self.arms(inputs.body.rotation), strict=True
            )
            apart = tuple(
                (goal_place + a) - (inputs.body.position + b) for a, b in places
            )
            behind = tuple(inputs.behind)
            late = (as_data(behind if self.pose_age else apart), *waiting)
            apart, behind = (apart, late[-1]) if self.pose_age else (late[-1], behind)
            off, askew = self.rigid_shift(
                [a - b for a, b in zip(apart, behind, strict=True)], arms
            )
            near = aloft * self.filter
            waiting = late[:-1]
        errors = PoseErrors(
            place=shorten(pose.place + off * (aloft * self.pose_gain), FARTHEST),
            turn=shorten(pose.turn + askew * (aloft * self.pose_gain), FARTHEST),
            off=shorten(pose.off + (off - pose.off) * near, FARTHEST),
            askew=shorten(pose.askew + (askew - pose.askew) * near, FARTHEST),
            waiting=waiting,
        )
        return as_data(errors)

    @property
    def _promptness(self) -> Scalar:
        """Factor on the rate ``blind``, and its square on ``pull_gain``: 1 if messages
        come at once.

        Their mean age beyond the delay is that of the last one that was not lost.
        """
        # messages of every period that come at once slow nothing down
        if absent(self.rate) and not self.delay:
            return 1.0
        # mean number of intervals since one that arrives
        sent = divide(1.0, maximum(1.0 - self.loss, SMALL)) - 0.5
        return divide(1.0, 1.0 + self.blind * (self.delay + self._interval * sent))

    @property
    def _interval(self) -> Scalar:
        """Time (s) between two messages of a member; 0: it sends one in every control
        period.
        """
        # both branches are evaluated: no division by a rate of 0
        return (
            0.0
            if absent(self.rate)
            else where(self.rate > 0.0, divide(1.0, maximum(self.rate, SMALL)), 0.0)
        )

    @property
    def _start(self) -> Scalar:
        """Height (m) at which the body begins."""
        assert self.motion is not None
        height: Scalar = self.motion.z.derivatives(0.0)[0]
        return height

    def _course(self, own: WrenchMemory, inputs: TeamInputs, dt: float) -> CarryCourse:
        """Desired motion of the body: that of the team, until the members set the body
        down.
        """
        assert self.motion is not None
        pace = clip(1.0 - (own.overload - PATIENCE), 0.0, 1.0)
        clock = where(pace < 1.0, own.clock + pace * dt, inputs.time)
        # the pace falls from 1 to 0 within 1 s, and is constant before and after
        change = where(pace * (1.0 - pace) > 0.0, -1.0, 0.0)
        desired = then = self.motion.at(clock).at_pace(pace, change)
        if self.pose_age:
            then = self.motion.at(clock - pace * self.pose_age).at_pace(pace, 0.0)
        now, there = map(self.motion.yaw.derivatives, (inputs.time, clock))
        down = SINKING * maximum(own.overload - PATIENCE - 1.0, 0.0)
        height = maximum(desired.position.z - self._start, 0.0)
        landed = clip(divide(down - height, SINKING * self.rise), 0.0, 1.0)
        return CarryCourse(
            clock=clock,
            pace=pace,
            desired=desired,
            then=then,
            lower=E_Z * -minimum(down, height),
            share=self.fraction(clock) * (1.0 - landed),
            aloft=1.0 - landed,
            heading=Vec3(
                there[0], there[1] * pace, there[2] * (pace * pace) + there[1] * change
            )
            - Vec3(*now[:3]),
        )

    def _loads(
        self,
        desired: BodyMotion,
        inputs: TeamInputs,
        arms: Sequence[Vec3],
        holding: Sequence[Scalar],
    ) -> tuple[list[Vec3], list[Vec3], list[Scalar], Scalar]:
        """Force (N) and moment (N m) of each member, limits over forces, and whether
        all together bear too little.

        Fixed grasps bear what the forces leave of the moment.
        """
        force, moment = weight_of(self, desired, inputs.gravity)
        loads = self.shares(force, moment, arms)
        # large and finite: members without limits still have a finite ratio
        endless = [SLACK / SMALL] * len(arms)
        # SLACK in both: of a member without a load the ratio is above 1
        ratios = [
            divide(limit + SLACK, load.norm() + SLACK)
            for limit, load in zip(inputs.limits or endless, loads, strict=True)
        ]
        left = moment - sum(
            (arm.cross(load) for arm, load in zip(arms, loads, strict=True)), ZERO3
        )
        rows = zip(self.members, holding, inputs.moment_limits or endless, strict=True)
        most = [
            h * limit if member.kind == "fixed" else 0.0 for member, h, limit in rows
        ]
        whole = sum(most, 0.0)
        tips = left.norm() > whole + LEAST_LEVER * force.norm()
        borne = shorten(left, whole) * divide(1.0, maximum(whole, SMALL))
        short = logical_or(tips, reduce(minimum, ratios) < 1.0 - TOLERANCE)
        return loads, [borne * each for each in most], ratios, short

    def _send(
        self, own: WrenchMemory, inputs: TeamInputs, dt: float
    ) -> tuple[tuple[ForceMessage, ...], Scalar]:
        """Last messages of the members that were not lost, and the time (s) since the
        members sent some.
        """
        since = own.since + dt
        interval = self._interval
        # the time since is a sum of periods, which rounds
        now = (
            1.0
            if absent(self.rate)
            else where(since < interval * (1.0 - 1e-6), 0.0, 1.0)
        )
        sent = []
        for each, force, u in zip(
            own.sent, inputs.forces, inputs.drawn or [1.0] * len(own.sent), strict=True
        ):
            through = now * where(u < self.loss, 0.0, 1.0)
            message = ForceMessage(
                force=each.force + (force - each.force) * through,
                age=(each.age + dt) * (1.0 - through),
                lost=each.lost + now - through,
            )
            sent.append(as_data(message))
        # what is left of the interval stays, so that the mean rate is as stated
        left = 0.0 if absent(self.rate) else since - now * interval
        # after the first message, which is sent at once
        return tuple(sent), where(left > interval, 0.0, left)
