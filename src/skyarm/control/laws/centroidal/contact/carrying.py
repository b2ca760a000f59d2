"""Part of a load at the tip: its wrench is compensated in advance, and the force on the
tip is estimated.

The reference says which wrench h the load is about to exert on the tip
(:class:`skyarm.reference.carry.Carry`). Its effect J^T h on base and joints, at the
pose of the reference, is a feed-forward beside the observer, which never sees it. Taken
at the observed pose, it would swing the arm in its plane.

The force and moment at the tip are the weighted least squares (lengths as in
:mod:`skyarm.control.blocks.tip_force`) of what feed-forward and observer have together,
beyond a bias that follows them until the load is taken and then stands.

A load of which only wrenches are known has no inertia in the model: the feedback of the
tip is too weak for it, and a heavy one swings after a gust. So the model can have a
part of its mass, at the tip. Weight and planned acceleration of this part are then not
in the known wrench, as each counts once. The whole mass would be too much: a grasp has
compliance, and at frequencies above its own the tip moves alone.

Members of a team pull each other: an observer that compensates this pull integrates it,
and so does that of the other member. Hence the observer forgets such a force at the
rate that the reference says. Where no joint moves the tip, the vehicle leans about its
held hand: with the force f there it would forget the torque l f, too (hand l below the
centre of mass), and fall over, since the loop of the attitude counts on the inertia of
a free base. There it forgets f alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, cast

from skyarm.algebra import (
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Scalar,
    Scalars,
    Sym3,
    Vec3,
    axis_rotation,
    sums,
)
from skyarm.algebra.scalars import (
    add,
    clip,
    data,
    divide,
    exp,
    maximum,
    sqrt,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import derivative
from skyarm.control.blocks.center_of_mass import central_inertia, locked_inertia
from skyarm.control.blocks.disturbance_observer import disturbance
from skyarm.control.blocks.filters import low_pass_share
from skyarm.control.blocks.prediction import Disturbance, no_disturbance
from skyarm.control.blocks.tip_force import AXES, ForceErrors, LeastSquares
from skyarm.control.laws.centroidal.parameters import (
    CentroidalParameters,
    OptionalPart,
    Step,
    at_shares,
)
from skyarm.control.laws.centroidal.step_records import Effect, ReferenceMotion
from skyarm.control.laws.centroidal.tip_tasks import turn_by_yaw
from skyarm.dynamics.actuators.load_limits import LoadLimits, largest_load
from skyarm.dynamics.kinematics import frame_pose, jacobian_columns
from skyarm.dynamics.point_motion import PointMotion
from skyarm.dynamics.state import State
from skyarm.records.coerce import absent
from skyarm.records.immutable import immutable
from skyarm.records.leaves import as_data
from skyarm.records.units import Unit, nonnegative, positive
from skyarm.reference import Reference
from skyarm.reference.carry import Carry
from skyarm.reference.preview import Sample
from skyarm.vehicle import BASE, Body, Frame, Vehicle

NO_TILT = Sym3(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Shares of a tip that joints move in every horizontal direction."""

QUICK = 30.0
"""Rate (1/s) at which gains become those of carrying: full gains excite a heavy base
about its held hand by 15 1/s."""

FIRM = 0.18
"""Part of a vehicle's inertia about its held tip that turns it in free flight, below
which the gains of leaning rise.

In drawn teams vehicles of 0.19 and more shake with 0.8 of their gains and fly with 0.6;
five teams with one of 0.12 or less fell over slowly with 0.6 and fly with 0.8.
"""

SLOWEST = 1e-3
"""Bandwidth (rad/s) at which a shift settles at least."""


@immutable
class CarryingMemory:
    """State of the carrying part: the compensated wrench, the bias of the estimate, and
    the estimate.

    Attributes:
        limits: largest load in the measured pose, of which a team's law makes the
            member's share.
        tilting: share of each horizontal direction, world axes, in which only a tilt of
            the base moves the tip.
        ahead: disturbance that is compensated in advance. earlier: the same of the
            periods before, newest first.
        bias: what the observer has without a load.
    """

    share: Annotated[
        Scalar, Unit("", "0 before the load is taken, 1 while it is carried; filtered")
    ] = 0.0
    ahead: Disturbance
    earlier: tuple[Disturbance, ...]
    bias: Disturbance
    force: Annotated[
        Vec3, Unit("N", "estimated force of the load on the tip, world axes")
    ] = ZERO3_DATA
    moment: Annotated[
        Vec3, Unit("N m", "estimated moment of the load on the tip, world axes")
    ] = ZERO3_DATA
    behind: Annotated[
        Vec3,
        Unit(
            "m", "shifted reference of the tip less the tip by measurement, world axes"
        ),
    ] = ZERO3_DATA
    limits: LoadLimits = LoadLimits()
    mass: Annotated[
        Scalar,
        Unit("kg", "part of the load's mass that this tip moves, of the period before"),
    ] = 0.0
    tilting: Sym3 = NO_TILT
    heavy: Annotated[
        Scalar,
        Unit("", "inertia about the held tip over that about the centre of mass"),
    ] = 1.0


@immutable
class CarryingGains(OptionalPart):
    """Constants of the carrying part.

    Attributes:
        delay_periods: known delay of the measurements, structure.
    """

    bandwidth: Annotated[
        Scalar,
        positive(
            "",
            "factor of all gains while a load is carried; of the rotors' at least",
            effect=(
                "lower values tolerate more inertia of the load and reject wind less"
            ),
        ),
    ]
    inertia: Annotated[
        Scalar,
        nonnegative(
            "",
            "share of the load's mass that the model has at the tip",
            effect=(
                "higher values hold the load more exactly in wind; noise reaches rotors"
                " and pull more"
            ),
        ),
    ] = 0
    moment: Annotated[
        Scalar,
        positive(
            "N m",
            "typical moment between tip and load",
            effect=(
                "higher values suit a fixed grasp and make the estimated force noisier"
            ),
        ),
    ] = 0.1
    settling: Annotated[
        Scalar, Unit("rad/s", "bandwidth of the bias filter before the load is taken")
    ] = 3.0
    errors: ForceErrors = ForceErrors()
    delay_periods: int = 0

    def start(self, joints: int) -> CarryingMemory:
        """Initial state of the carrying part: no load, no bias."""
        none = no_disturbance(joints)
        return CarryingMemory(
            ahead=none, earlier=(none,) * self.delay_periods, bias=none
        )

    def adjust_gains(
        self, memory: CarryingMemory, par: CentroidalParameters, dt: Scalar
    ) -> CentroidalParameters:
        """Gains between those of free flight and those of carrying, and a model whose
        tip has a part of the load.

        Rotors turn a vehicle that leans about its held tip against an inertia that is
        several times as large. There the stiffness stays the same: the factor of their
        gains goes with the root of this inertia, up to 1.
        """
        firm = self.bandwidth * sqrt(FIRM * memory.heavy)
        firm = clip(firm, self.bandwidth, maximum(self.bandwidth, 1.0))
        par = at_shares(
            par, *(1.0 + memory.share * (each - 1.0) for each in (firm, self.bandwidth))
        )
        if absent(self.inertia):
            return par
        vehicle = par.model.vehicle
        frame = held_at(vehicle)
        load = Body(
            mass=self.inertia * memory.mass,
            com=frame.position,
            inertia=Sym3(0.0, 0.0, 0.0),
        )
        model = replace(par.model, vehicle=vehicle.with_body(frame.link, load))
        return replace(par, model=model)

    def feedforward(
        self,
        memory: CarryingMemory,
        par: CentroidalParameters,
        reference: Reference,
        motion: ReferenceMotion,
    ) -> tuple[Disturbance, Disturbance] | None:
        """Effect of the known wrench before the measurement, and now; None if the
        reference carries nothing.
        """
        if not reference.carry:
            return None
        carry = Carry.of(reference.carry)
        # the observer sees a period of the past: what was fed forward then is what
        # acted
        before = memory.earlier[-1] if memory.earlier else memory.ahead
        force = carry.force - self.force_in_model(memory, par, motion, carry)
        return before, planned_effect(
            par.model.vehicle, reference, carry, force, carry.moment
        )

    def force_in_model(
        self,
        memory: CarryingMemory,
        par: CentroidalParameters,
        motion: ReferenceMotion,
        carry: Carry,
    ) -> Vec3:
        """Force (N, world axes) on the planned tip of that part of the load that the
        model has.
        """
        if absent(self.inertia):
            return ZERO3
        proper = (
            planned_acceleration(par.model.vehicle, motion, carry)
            + E_Z * par.model.gravity
        )
        return proper * (-self.inertia * memory.mass)

    def affect(
        self, memory: CarryingMemory, step: Step, effect: Effect
    ) -> tuple[CarryingMemory, Effect]:
        """Shift the tip's reference, let the observer forget, hold adaptation, and
        estimate the wrench at the tip.
        """
        given = self.feedforward(memory, step.par, step.reference, step.motion)
        if given is None:
            return memory, effect
        carry = Carry.of(step.reference.carry)
        observed = step.seen.observed
        vehicle = step.par.model.vehicle
        dt = step.dt
        borne, holding = disturbance(observed) + given[0], carry.held > 0.5
        settled = low_pass_share(self.settling, dt)
        # a bias that followed a held load would take it for its own
        share = where(holding, 0.0, settled)
        bias = memory.bias.blend_towards(borne, share, share)
        R = observed.quaternion.rotation()
        force, moment = tip_wrench(
            self.errors, self.moment, vehicle, R, observed.joints, borne - bias
        )
        force = force + self.force_in_model(memory, step.par, step.motion, carry)
        tilting = shares_of_tilt(vehicle, R, observed.joints, step.par.tip.damping)
        by_tilt = tilting.apply(carry.forgotten_force) * dt
        forgets = planned_effect(
            vehicle,
            step.reference,
            carry,
            carry.forgotten_force * dt - by_tilt,
            carry.forgotten_moment * dt,
        )
        forgets = replace(forgets, force=as_data(forgets.force + by_tilt))
        shift = zip(
            carry.offset, carry.offset_rate, carry.offset_acceleration, strict=True
        )
        heading = effect.signals[3] + Taylor.of_derivatives((*carry.heading, 0, 0))
        planned = [signal.derivative(0) for signal in effect.signals[4:]]
        tip = frame_pose(vehicle, held_at(vehicle), planned, summed=True).p
        before, after = (turn_by_yaw(yaw, tip) for yaw in (effect.signals[3], heading))
        moves = zip(effect.signals[:3], shift, before - after, strict=True)
        moved = [
            s + Taylor.of_derivatives((*by, 0, 0)) + round_tip
            for s, by, round_tip in moves
        ]
        desired = Vec3(
            *(
                (base + arm).derivative(0)
                for base, arm in zip(moved, after, strict=True)
            )
        )
        rate = (given[1].force - memory.ahead.force) * divide(1.0, dt)
        signals = [*moved, heading, *effect.signals[4:]]
        ahead = [
            (time, settling_sample(row, carry, time)) for time, row in effect.ahead
        ]
        effect = replace(
            effect, signals=signals, ahead=ahead, forgets=forgets, force_rate=rate
        )
        memory = as_data(
            CarryingMemory(
                share=memory.share
                + (carry.held - memory.share) * low_pass_share(QUICK, dt),
                ahead=given[1],
                earlier=(memory.ahead, *memory.earlier)[: len(memory.earlier)],
                bias=bias,
                force=force,
                moment=moment,
                behind=desired - tip_of(vehicle, step.state),
                limits=largest_load(
                    PointMotion(
                        step.vehicle, step.state, gravity=step.par.model.gravity
                    )
                ),
                mass=carry.mass,
                tilting=tilting,
                heavy=inertia_ratio(step.vehicle, observed.joints),
            )
        )
        return memory, effect.isolating(where(holding, 0.0, 1.0))


def shares_of_tilt(vehicle: Vehicle, R: Mat3, joints: Scalars, damping: Scalar) -> Sym3:
    """Share of each horizontal direction, world axes, in which only a tilt of the base
    moves the tip.

    With J the horizontal rows of the tip's Jacobian (m) and d the law's damping of the
    joints (m), joints by damped least squares leave d^2 (J J^T + d^2)^-1 of a motion:
    all of it across the plane of an arm of parallel axes.
    """
    if not vehicle.n:
        return NO_TILT
    least = damping * damping
    xx, xy, yy = least, cast("Scalar", 0.0), least
    for column in jacobian_columns(vehicle, held_at(vehicle), joints, summed=True):
        way = R.apply(column.linear)
        xx, xy, yy = xx + way.x * way.x, xy + way.x * way.y, yy + way.y * way.y
    per = divide(least, xx * yy - xy * xy)
    return Sym3(data(yy * per), data(xx * per), 0.0, data(-xy * per), 0.0, 0.0)


def inertia_ratio(vehicle: Vehicle, joints: Scalars) -> Scalar:
    """Inertia of a vehicle about its tip over that about its centre of mass, in the
    mean of its horizontal axes.
    """
    center, inertia = central_inertia(locked_inertia(vehicle, joints))
    lever = frame_pose(vehicle, held_at(vehicle), joints).p - center
    return 1.0 + divide(2.0 * vehicle.mass * lever.dot(lever), inertia.xx + inertia.yy)


def settling_sample(row: Sequence[Sample], carry: Carry, time: Scalar) -> list[Sample]:
    """Sample of the reference to come, ``time`` (s) from now, with the tip's shift as
    it settles until then.

    The shift is that of a critically damped filter whose input stays. The heading keeps
    its turn.
    """
    # a shift that never settles would divide by zero
    w = maximum(carry.settling, SLOWEST)
    left, moved = exp(-w * time), list[Sample]()
    rows = zip(
        row[:3], carry.offset, carry.offset_rate, carry.offset_acceleration, strict=True
    )
    for planned, value, rate, acceleration in rows:
        slope = acceleration + w * rate
        way = divide(rate * (1.0 - left), w) + divide(
            slope * (1.0 - left * (1.0 + w * time)), w * w
        )
        shift = (
            value + way,
            (rate + slope * time) * left,
            (acceleration - w * slope * time) * left,
        )
        p, v, a = sums(planned, shift)
        moved.append((p, v, a))
    heading = row[3]
    return [
        *moved,
        (add(heading[0], carry.heading.x), heading[1], heading[2]),
        *row[4:],
    ]


def held_at(vehicle: Vehicle) -> Frame:
    """Frame at which a vehicle holds a load: its tip; without one the origin of the
    base.
    """
    return (
        vehicle.frame()
        if vehicle.end_effector
        else Frame(name="base", link=BASE, position=ZERO3)
    )


def tip_of(vehicle: Vehicle, state: State) -> Vec3:
    """Position (m, world axes) of the frame at which a vehicle holds a load."""
    held = frame_pose(vehicle, held_at(vehicle), state.joints, summed=True).p
    return state.position + state.rotation.apply(held)


def planned_acceleration(
    vehicle: Vehicle, motion: ReferenceMotion, carry: Carry
) -> Vec3:
    """Acceleration (m/s^2, world axes) of the planned tip on a level base, without its
    shift.
    """
    signals = motion.signals
    tip = frame_pose(
        vehicle,
        held_at(vehicle),
        [each.truncate(2) for each in signals[4:]],
        summed=True,
    ).p
    arm = turn_by_yaw(
        signals[3].truncate(2) + Taylor.of_derivatives([*carry.heading]), tip
    )
    return Vec3(*(each.derivative(2) for each in signals[:3])) + derivative(arm, 2)


def planned_effect(
    vehicle: Vehicle, reference: Reference, carry: Carry, force: Vec3, moment: Vec3
) -> Disturbance:
    """Disturbance by a wrench at the tip (N, N m, world axes) at the pose of the
    reference, with a level base.
    """
    R = axis_rotation(E_Z, reference.yaw + carry.heading.x)
    f, n, frame = R.apply_T(force), R.apply_T(moment), held_at(vehicle)
    columns = jacobian_columns(vehicle, frame, reference.joints, summed=True)
    tip = frame_pose(vehicle, frame, reference.joints, summed=True).p
    efforts = tuple(add(each.linear.dot(f), each.angular.dot(n)) for each in columns)
    return as_data(Disturbance(force=force, torque=tip.cross(f) + n, efforts=efforts))


def tip_wrench(
    errors: ForceErrors,
    moment: Scalar,
    vehicle: Vehicle,
    R: Mat3,
    joints: Scalars,
    rest: Disturbance,
) -> tuple[Vec3, Vec3]:
    """Force (N) and moment (N m) at the tip, world axes, by weighted least squares from
    a disturbance.

    Args:
        errors: errors of torques and efforts that count as much as 1 N.
        moment: typical moment at the tip, N m.
        vehicle: model.
        R: R_WB.
        joints: rad or m.
        rest: disturbance beyond its bias.
    """
    squares, frame = LeastSquares(6), held_at(vehicle)
    # the base shows the force itself; a moment is only expected to be small
    squares.prefer(R.apply_T(rest.force), 1)
    squares.prefer((0, 0, 0), divide(1.0, moment * moment), 3)
    columns = jacobian_columns(vehicle, frame, joints, summed=True)
    for link, column, effort in zip(vehicle.links, columns, rest.efforts, strict=True):
        squares.require(
            (*column.linear, *column.angular), effort, errors.weight_of(link)
        )
    tip = frame_pose(vehicle, frame, joints, summed=True).p
    turning = zip(
        zip(*(tip.cross(axis) for axis in AXES), strict=True),
        AXES,
        rest.torque,
        strict=True,
    )
    for row, axis, torque in turning:
        squares.require((*row, *axis), torque, divide(1.0, errors.base * errors.base))
    solution = squares.solve()
    return R.apply(Vec3(*solution[:3])), R.apply(Vec3(*solution[3:]))
