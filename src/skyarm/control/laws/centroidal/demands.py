"""Desired thrust, angular acceleration and joint accelerations of the centroidal
law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from skyarm.algebra import (
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Mat3,
    Scalar,
    Scalars,
    Vec3,
    inner_product,
)
from skyarm.algebra.scalars import (
    add,
    clip,
    divide,
    maximum,
    minimum,
    mul,
    neg,
    sqrt,
    sub,
    where,
)
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.control.blocks.attitude import (
    DesiredAttitude,
    Posture,
    angular_acceleration,
    attitude,
    derivative,
    moving,
    posture,
    upright,
)
from skyarm.control.blocks.prediction import reference_drag
from skyarm.control.laws.centroidal import com_tracking as center_of_mass
from skyarm.control.laws.centroidal import tip_tasks
from skyarm.control.laws.centroidal.base_shift import (
    FIRST_SHIFT,
    Acting,
    Shift,
    bounded_shift,
)
from skyarm.control.laws.centroidal.com_tracking import ArmMotion
from skyarm.control.laws.centroidal.force_trend import Foreseen
from skyarm.control.laws.centroidal.parameters import CentroidalParameters, Step
from skyarm.control.laws.centroidal.step_records import (
    AccelerationDemand,
    Effect,
    Planned,
    RotorForce,
)
from skyarm.control.model import JointGains
from skyarm.dynamics import State
from skyarm.records.immutable import immutable
from skyarm.vehicle import Vehicle


@immutable
class Following:
    """Filter states of base shift and arm motion; empty where the law does not use
    them.
    """

    shift: Shift | tuple[()] = ()
    arm: ArmMotion | tuple[()] = ()


def first_following(par: CentroidalParameters) -> Following:
    """Initial filter states of base shift and arm motion."""
    return Following(
        shift=() if par.tip.preview is None else FIRST_SHIFT,
        arm=ArmMotion(size=0.0, mean=ZERO3_DATA) if par.model.vehicle.n else (),
    )


@immutable(kw_only=False)
class DesiredMotion:
    """Desired motion of base and arm at one instant, with the quasi-static attitude.

    Attributes:
        base: motion of the base origin, value to fourth derivative, world axes.
        still: quasi-static attitude. level: posture of ``turned``, the joints' signals.
        following: filter states, one period later.
        changes: known derivatives of the disturbance, N/s and N/s^2, world axes.
        rotors: force of the rotors. planned: force of the motion, N, if the shift
            answers it, else None.
        goal: tip and link references in tip mode, else None.
    """

    base: list[Vec3]
    still: DesiredAttitude
    level: Posture
    turned: tuple[Taylor, ...]
    following: Following
    changes: tuple[Vec3, Vec3]
    rotors: RotorForce
    planned: Vec3 | None
    goal: tip_tasks.TipGoal | None = None


def demands(
    step: Step, effect: Effect, coming: Foreseen
) -> tuple[AccelerationDemand, Following]:
    """Desired thrust, angular and joint accelerations of one control step, and the next
    filter states.
    """
    par, state, before = step.par, step.state, step.memory.following
    model, pressing = par.model, effect.pressing
    vehicle, mass = model.vehicle, model.vehicle.mass
    yaw = effect.signals[3]
    joints = tuple(effect.signals[4:])
    R = state.rotation
    w = state.rate
    course = plan(step, effect, coming)
    # ints: the accelerations of the joints are what is looked for, and drop out
    now = posture(vehicle, moving(state.joints, state.joint_rates, (0,) * vehicle.n), 2)
    arm = before.arm
    h = [derivative(course.level.com, k) for k in range(5)]
    if arm:
        arm = center_of_mass.update_arm_motion(
            arm, course.level.com, model.gravity, step.dt
        )
        h = center_of_mass.compensated_motion(arm, h)
    target = list(step.motion.center) or center_of_mass.goal(
        course.base, h, course.still, par.tip.preview is not None
    )
    push = center_of_mass.thrust(
        par,
        mass,
        wanted=target,
        position=state.position + R.apply(derivative(now.com, 0)),
        velocity=state.velocity + _velocity(R, w, now.com),
        R=R,
        w=w,
        disturbance=(coming.unknown.force, *course.changes),
        rotors=course.rotors,
    )
    alpha = angular_acceleration(
        par.base,
        wanted_attitude(par, push.force, yaw, course.rotors, course.planned),
        R,
        w,
    )
    preferred = joint_accelerations(par, state, joints)
    missed = ZERO3
    if course.goal is not None:
        present = tip_tasks.PresentMotion(
            R=R,
            rate=w,
            alpha=alpha,
            joints=state.joints,
            joint_rates=state.joint_rates,
            posture=now,
            tip=state.position + R.apply(derivative(now.tip, 0)),
            tip_velocity=state.velocity + _velocity(R, w, now.tip),
            com_acceleration=push.acceleration,
        )
        base = course.base
        goal = tip_tasks.move_goal(
            course.goal,
            [
                state.position - base[0],
                state.velocity - base[1],
                push.acceleration - base[2],
            ],
            par.tip.reach,
        )
        missed = present.tip - course.goal.tip[0]
        if pressing is not None:
            goal = tip_tasks.release_normal(
                pressing, goal, present.tip, present.tip_velocity, par.tip.velocity
            )
        preferred = tip_tasks.joint_accelerations(
            vehicle, par.tip, goal, present, preferred, effect.links
        )
    if par.joint_ends:
        preferred = within_limits(
            vehicle, par.joint_ends, par.joint_gains, state, joints, preferred
        )
    planned = Planned(
        R=course.still.R,
        rate=course.still.rate,
        alpha=course.still.acceleration,
        proper=course.still.R.apply_T(course.base[2] + E_Z * model.gravity),
        joints=course.turned,
    )
    demand = AccelerationDemand(
        thrust=push.along,
        alpha=alpha,
        joints=preferred,
        planned=planned,
        across=push.across,
        force_rate=center_of_mass.planned_rate(
            course.still, target[2:4], mass, model.gravity
        ),
        missed=missed,
    )
    return demand, replace(course.following, arm=arm)


def plan(step: Step, effect: Effect, coming: Foreseen) -> DesiredMotion:
    """Desired motion of base and arm in one step; in tip mode the joints compensate the
    base's tilt.

    Attitude and drag along the path are those of the base as it shifts.
    """
    par, before, dt, signals = step.par, step.memory.following, step.dt, effect.signals
    model, force_rate, steady = par.model, coming.rate, coming.steady
    vehicle, mass = model.vehicle, model.vehicle.mass
    base = [Vec3(*(signal.derivative(k) for signal in signals[:3])) for k in range(5)]
    yaw = signals[3]
    joints = tuple(signals[4:])
    level = posture(vehicle, joints, 4)
    moves, sideways = par.tip.preview is not None, par.center.sideways
    answered = base
    after = before
    moved = list[Vec3]()
    if before.shift:
        # hub drag of a level vehicle per horizontal velocity, N s/m, of the terms that
        # drag_wrench has, too
        drag_rates = [neg(rotor.drag_coefficient) for rotor in vehicle.rotors]
        drag_rate = neg(inner_product(drag_rates, step.state.rotor_speeds))
        acting = Acting(force=steady, rate=force_rate, drag=drag_rate)
        moved, shift = bounded_shift(
            par, before.shift, base, yaw, joints, level, acting, effect.ahead, dt
        )
        after = replace(before, shift=shift)
        answered = [base[0], *(p + u for p, u in zip(base[1:], moved, strict=True))]
    # the planned centre of mass itself says what force it requires
    answered = list(step.motion.center) or answered
    drag = reference_drag(
        model, step.state, answered[:4], sideways=sideways is not None, moving=moves
    )
    force = center_of_mass.quasi_static(
        par, mass, answered, steady + drag[0], (drag[1] + force_rate, drag[2])
    )
    changes = (
        (drag[1] + coming.near_rate, drag[2]) if moved else (coming.near_rate, ZERO3)
    )
    rotors = center_of_mass.ALONG_Z
    if sideways is not None:
        rotors = sideways.rotor_force(
            par.mixer, derivative(level.com, 0), mass * model.gravity
        )
    planned = force if moved else None
    still = wanted_attitude(par, force, yaw, rotors, planned)
    goal = None
    if par.mode == "tip":
        goal = tip_tasks.goal(vehicle, base, yaw, joints, level)
        joints = tip_tasks.turned_joints(
            vehicle, par.tip, goal, still, joints, level, moves
        )
        upright_posture = level
        level = posture(vehicle, joints, 4)
        offset = tip_tasks.needed_shift(upright_posture.tip, yaw, level.tip, still)
        if moved:
            offset = [*offset, *moved[2:]]
        base = [
            *(p + s for p, s in zip(base, offset, strict=False)),
            *base[len(offset) :],
        ]
    return DesiredMotion(
        base, still, level, joints, after, changes, rotors, planned, goal
    )


def joint_accelerations(
    par: CentroidalParameters, state: State, joints: Sequence[Taylor]
) -> Scalars:
    """Desired joint accelerations qdd_d + kd (qd_d - qd) + kp (q_d - q)."""
    gains = par.joint_gains
    return tuple(
        add(
            add(q_d.derivative(2), mul(kd, sub(q_d.derivative(1), qd))),
            mul(kp, sub(q_d.derivative(0), q)),
        )
        for kp, kd, q_d, q, qd in zip(
            gains.stiffness,
            gains.damping,
            joints,
            state.joints,
            state.joint_rates,
            strict=True,
        )
    )


def _velocity(R: Mat3, w: Vec3, point: Vec3) -> Vec3:
    """World velocity of a point of the vehicle relative to the base origin."""
    return R.apply(w.cross(derivative(point, 0)) + derivative(point, 1))


LOW_THRUST = 0.8
"""Vertical force over the weight below which its direction turns the attitude less.
Without, vertical sines of 0.2 m are lost at 1.25 Hz, and a law without an accelerometer
errs by 17 mm for 3 in noise at 1 Hz."""


def wanted_attitude(
    par: CentroidalParameters,
    force: Vec3,
    yaw: Taylor,
    rotors: RotorForce,
    planned: Vec3 | None,
) -> DesiredAttitude:
    """Desired attitude for a force (Taylor series, N, world axes), part of which the
    rotors may give sideways.

    ``planned`` is the force of the motion without errors, whose direction low thrust
    does not change.
    """
    force = upright(
        rotors.leaning(force, yaw),
        par.model.vehicle.mass * par.model.gravity,
        LOW_THRUST,
        planned,
    )
    return attitude(force, yaw.truncate(2))


SHARE, WITH_STOP = 0.5, 0.75
"""Fraction of the distance from a joint's reference to its limit that the barrier
allows, without and with a hard stop; chosen. A light arm that is pushed at its tip
needs the room."""

TURN = 2.2
"""Largest deviation (rad) of a revolute joint without limits from its reference, by the
joint-limit barrier. Chosen. With it and braced joints pushes of 3 N from below
turned them by 2.5 rad, without both by 41."""

QUICKER = 6.0
"""Largest pole, over that of a joint's own loop, by which a joint that is too fast for
that one stops at its limit. A slide with 27 mm to go, whose base is struck by 3 m/s,
passes the limit with 3 and stops from 4 on."""

AT_LIMIT = 1e-9
"""Least distance to a limit (rad or m), as a divisor."""

Ends = tuple[tuple[bool, bool], ...]
"""Flags of the lower and upper limit of each joint, known before compilation."""


def within_limits(
    vehicle: Vehicle,
    ends: Ends,
    gains: JointGains,
    state: State,
    references: Sequence[Taylor],
    accelerations: Sequence[Scalar],
) -> Scalars:
    """Joint accelerations limited by a control barrier function that keeps joints off
    their limits.

    A joint may go a share of the way from its reference to a limit, more where a hard
    stop holds it. With d the way that is left and k the pole of the joint's own loop,
    half of its damping (the root of its stiffness where that is more), d'' + 2 k d' +
    k^2 d >= 0 bounds the acceleration towards the limit; so does the limit itself, at
    rest. What is too fast for that pole is braked (:func:`brake_at_limit`).

    Source: Ames et al. 2019, "Control barrier functions: theory and applications",
    exponential barrier of degree two.
    """
    bounded = []
    for i, (desired, (low, high)) in enumerate(zip(accelerations, ends, strict=True)):
        joint = vehicle.links[i].joint
        # a hard stop bears what overshoots, so less room is kept from it
        share = WITH_STOP if joint.has_stops else SHARE
        # the pole that the joint's own loop brakes with: a slower one would bound
        # ordinary motions
        pole = maximum(0.5 * gains.damping[i], sqrt(gains.stiffness[i]))
        square = pole * pole
        gone = square * state.joints[i] + 2.0 * pole * state.joint_rates[i]
        limited = desired
        if high:
            end = towards(joint.upper, references[i], share, pole)
            limited = minimum(limited, minimum(end, square * joint.upper) - gone)
        if low:
            end = towards(joint.lower, references[i], share, pole)
            limited = maximum(limited, maximum(end, square * joint.lower) - gone)
        if joint.turns and not (low or high):
            asked, room = towards(0.0, references[i], 0.0, pole) - gone, square * TURN
            limited = clip(limited, asked - room, asked + room)
        # the one limit does not let it brake less for the other
        if high:
            limited = brake_at_limit(
                limited, joint.upper - state.joints[i], state.joint_rates[i], pole
            )
        if low:
            limited = -brake_at_limit(
                -limited, state.joints[i] - joint.lower, -state.joint_rates[i], pole
            )
        bounded.append(limited)
    return tuple(bounded)


def brake_at_limit(wanted: Scalar, way: Scalar, speed: Scalar, pole: Scalar) -> Scalar:
    """Acceleration towards a limit at which a fast joint stops at the limit, from a
    ``way`` to go and its ``speed``.

    Faster than k d a joint passes the limit on d'' + 2 k d' + k^2 d = 0. It stops there
    with the pole -d' / d in place of k: d'' = d'^2 / d.
    """
    way = maximum(way, AT_LIMIT)
    braking = mul(speed, minimum(divide(speed, way), QUICKER * pole))
    return where(speed > pole * way, minimum(wanted, -braking), wanted)


def towards(limit: Scalar, reference: Taylor, share: Scalar, pole: Scalar) -> Scalar:
    """Right-hand side q'' + 2 k q' + k^2 q of the joint-limit barrier, for a position
    between reference and limit.
    """
    position, square, twice = reference.derivative(0), mul(pole, pole), mul(2.0, pole)
    # the place where it may go moves with the reference, the limit does not
    moved = mul(
        sub(1.0, share),
        add(reference.derivative(2), mul(twice, reference.derivative(1))),
    )
    return add(mul(square, add(position, mul(share, sub(limit, position)))), moved)
