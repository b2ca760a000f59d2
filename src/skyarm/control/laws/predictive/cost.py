"""Cost of predictive control: residuals of states and inputs, with the predicted
contact force.

While the tip touches, the plan's tip has along the estimated outward normal n no motion
of its own but that

    n . a = -c n . v,

and the surface gives what this takes: with a(f) the tip's acceleration under a force f
of the surface along n, which is affine in f,

    f = (-c n.v - n.a(0)) / (n.a(1) - n.a(0)).

f depends on rotors and joint torques of the stage, and the cost weighs its difference
from the desired force. c is the damping of a tip that bounces: where the surface gives
the desired force and no more, the real tip has n . a = -c n . v.

Source: Featherstone 2008, section 11.1 (single point contact); Baumgarte 1972
(damping); Neunert et al. 2018 (contact forces in a whole-body plan). A force of one
sign is not enforced: the cost keeps it near the desired one.
"""

from __future__ import annotations

from typing import Annotated, Any

from skyarm.algebra import E_Z, Quaternion, Scalar, Scalars, Vec3, differences
from skyarm.algebra.scalars import cos, divide, mul, sin, sub
from skyarm.control.blocks.attitude import derivative, moving, posture
from skyarm.control.blocks.prediction import Disturbance
from skyarm.control.blocks.tip_force import levers
from skyarm.control.laws.predictive.prediction import (
    StageInputs,
    accelerations,
    integrate_stage,
)
from skyarm.control.model import Model
from skyarm.dynamics import State, frame_pose
from skyarm.records.immutable import immutable
from skyarm.records.units import nonnegative
from skyarm.vehicle import BASE, Vehicle


@immutable
class ContactGoal:
    """Desired contact of the tip with a surface at one stage of the horizon.

    Attributes:
        normal: out of the surface as estimated, world axes.
        touching: 1 where the surface holds the tip along the normal, 0 in free flight.
        force: desired force, N. damping: 1/s, c above.
    """

    normal: Vec3
    touching: Scalar
    force: Scalar
    damping: Scalar


def tip_acceleration(
    model: Model, state: State, linear: Vec3, angular: Vec3, joints: Scalars
) -> Vec3:
    """Tip acceleration (m/s^2, world axes) from base accelerations (world and base
    axes) and joint accelerations.
    """
    tip = posture(model.vehicle, moving(state.joints, state.joint_rates, joints), 2).tip
    p, v, a = (derivative(tip, k) for k in range(3))
    w = state.rate
    return linear + state.rotation.apply(
        a + angular.cross(p) + w.cross(v * 2.0 + w.cross(p))
    )


def tip_velocity(model: Model, state: State) -> Vec3:
    """Velocity of the tip (m/s, world axes)."""
    tip = posture(model.vehicle, moving(state.joints, state.joint_rates), 1).tip
    p, v = derivative(tip, 0), derivative(tip, 1)
    return state.velocity + state.rotation.apply(v + state.rate.cross(p))


def under_contact(
    model: Model,
    state: State,
    efforts: Scalars,
    disturbance: Disturbance,
    dry_rates: Scalars | None,
    contact: ContactGoal | tuple[()],
) -> tuple[Disturbance, Scalar]:
    """Disturbance with the predicted contact force added, and that force (N), 0 without
    contact.

    Args:
        model: the controller's model.
        state: state of that model.
        efforts: joint efforts, N m or N.
        disturbance: without the surface's force along the normal.
        dry_rates: joint rates at which dry friction is taken.
        contact: desired contact.
    """
    if not contact:
        return disturbance, 0
    n = contact.normal
    unit = levers(model.vehicle, state.rotation, state.joints).disturbance(n)

    def along(pushed: Disturbance) -> Any:
        return n.dot(
            tip_acceleration(
                model, state, *accelerations(model, state, efforts, pushed, dry_rates)
            )
        )

    # the acceleration is affine in the force, so two evaluations give the whole line
    free, moved = along(disturbance), along(disturbance + unit)
    damped = -contact.damping * n.dot(tip_velocity(model, state))
    force = divide(damped - free, moved - free) * contact.touching
    return disturbance + unit * force, force


MODES = ("tool", "joints", "plan")


@immutable
class PlannedGoal:
    """Planned attitude of one stage and its motion: attitude, rate (rad/s, body axes)
    and rotor accelerations.
    """

    attitude: Quaternion
    rate: Vec3
    rotor_accelerations: Scalars


@immutable
class StageGoal:
    """Reference at one stage of the horizon: base (world axes, m, rad) and joints (rad
    or m).

    Attributes:
        position, velocity, yaw, joints, joint_rates, joint_accelerations: desired ones.
        shift: m, world axes, of the base, which keeps the tip where a level base would
            carry it.
        contact: desired contact of the tip; empty where none is ever requested.
        planned: the rest of a planned state; empty but in mode "plan".
    """

    position: Vec3
    velocity: Vec3
    yaw: Scalar
    joints: Scalars
    joint_rates: Scalars
    joint_accelerations: Scalars
    shift: Vec3
    contact: ContactGoal | tuple[()] = ()
    planned: PlannedGoal | tuple[()] = ()


@immutable
class Weights:
    """Cost weights of predictive control, each the reciprocal of the error that costs 1
    per second.

    Attributes:
        position: 1/m. velocity: s/m. heading: 1/rad. rate: s/rad, of the base.
        joints: 1/rad or 1/m. joint_rates: per second of that. joint_accelerations: per
            second squared.
        tool: 1/m.
        rotor_accelerations: s^2/rad.
        final: s, time for which the errors at the end of the horizon count.
        force: 1/N, of the surface's force while the tip presses.
    """

    position: Annotated[
        Scalar,
        nonnegative(
            "1/m",
            "weight of the position error of the base: reciprocal of the error that"
            " adds 1 to the cost in a second",
            effect=(
                "higher values hold the position more tightly at the cost of the other"
                " errors"
            ),
        ),
    ] = 10.0
    velocity: Annotated[
        Scalar,
        nonnegative(
            "s/m",
            "weight of the velocity error of the base",
            effect="higher values damp the base more",
        ),
    ] = 2.0
    heading: Annotated[
        Scalar,
        nonnegative(
            "1/rad",
            "weight of the heading error",
            effect="higher values hold the heading more tightly",
        ),
    ] = 2.0
    rate: Annotated[
        Scalar,
        nonnegative(
            "s/rad",
            "weight of the body rate",
            effect="higher values turn the base more gently",
        ),
    ] = 0.2
    joints: Annotated[
        Scalar,
        nonnegative(
            "1/rad or 1/m",
            "weight of the joint position errors",
            effect=(
                "higher values hold the joints on their references, lower ones let them"
                " help the tip"
            ),
        ),
    ] = 5.0
    joint_rates: Annotated[
        Scalar,
        nonnegative(
            "s/rad or s/m",
            "weight of the joint rate errors",
            effect="higher values damp the joints more",
        ),
    ] = 0.2
    joint_accelerations: Annotated[
        Scalar,
        nonnegative(
            "s^2/rad or s^2/m",
            "weight of the joint accelerations",
            effect="higher values move the arm more smoothly and later",
        ),
    ] = 0.005
    tool: Annotated[
        Scalar,
        nonnegative(
            "1/m",
            "weight of the tip position error",
            effect=(
                "higher values hold the tip more tightly at the cost of base and joints"
            ),
        ),
    ] = 50.0
    rotor_accelerations: Annotated[
        Scalar,
        nonnegative(
            "s^2/rad",
            "weight of the rotor accelerations",
            effect="higher values use the rotors more gently and respond later",
        ),
    ] = 3e-4
    final: Annotated[
        Scalar,
        nonnegative(
            "s",
            "time for which the errors at the end of the horizon count",
            effect="higher values settle more surely and look less at the way there",
        ),
    ] = 0.2
    force: Annotated[
        Scalar,
        nonnegative(
            "1/N",
            "weight of the contact force error while the tip presses",
            effect=(
                "higher values hold the force more tightly at the cost of the position"
            ),
        ),
    ] = 2.5


def state_residuals(
    model: Model, weights: Weights, state: State, goal: StageGoal, mode: str
) -> Scalars:
    """Weighted errors of a predicted vehicle state against the reference, as
    least-squares residuals.

    In mode "joints" the joints follow their references. In mode "tool" the tip is where
    a level base would carry it; the joints next to the base compensate its tilt, so
    that for parallel axes the links keep their absolute angles, and the base moves by
    the remainder: about any axis across which no joint turns, the whole of the tip's
    way. A tip that touches has no place along the surface's normal. In mode "plan"
    every error is that from the planned state, at any tilt; the tip is where this state
    carries it.
    """
    if goal.planned:
        return planned_residuals(model, weights, state, goal, goal.planned)
    vehicle, R = model.vehicle, state.rotation
    c, s = cos(goal.yaw), sin(goal.yaw)
    # heading taken off, what is left of a small attitude is its tilt about the body's
    # own horizontal axes
    up = R.apply_T(E_Z)
    tilt = Vec3(up.y, -up.x, 0)
    joints = given_way(vehicle, goal.joints, tilt) if mode == "tool" else goal.joints
    # the base stands where it carries the tip home once it leans as it must
    residuals = [*((state.position - goal.position - goal.shift) * weights.position)]
    residuals += [*((state.velocity - goal.velocity) * weights.velocity)]
    ahead = R.column(0)
    residuals.append(weights.heading * (c * ahead.y - s * ahead.x))
    residuals += [*(state.rate * weights.rate)]
    residuals += _joint_residuals(weights, state, joints, goal.joint_rates)
    if mode == "tool" and vehicle.end_effector:
        frame = vehicle.frame()
        tip = state.position + R.apply(frame_pose(vehicle, frame, state.joints).p)
        arm = frame_pose(vehicle, frame, goal.joints).p
        tip_goal = goal.position + arm.about_z(goal.yaw)
        off = tip - tip_goal
        if goal.contact:
            off = off - goal.contact.normal * (
                goal.contact.normal.dot(off) * goal.contact.touching
            )
        residuals += [*(off * weights.tool)]
    return tuple(residuals)


def planned_residuals(
    model: Model, weights: Weights, state: State, goal: StageGoal, planned: PlannedGoal
) -> Scalars:
    """Weighted errors of a predicted vehicle state against a planned one."""
    vehicle, R = model.vehicle, state.rotation
    turned = planned.attitude.conjugate() * state.quaternion
    # times w, so that both signs of the quaternion give one error
    turn = Vec3(turned.x, turned.y, turned.z) * (2.0 * turned.w)
    residuals = [*((state.position - goal.position) * weights.position)]
    residuals += [*((state.velocity - goal.velocity) * weights.velocity)]
    residuals += [*(turn * weights.heading)]
    residuals += [*((state.rate - planned.rate) * weights.rate)]
    residuals += _joint_residuals(weights, state, goal.joints, goal.joint_rates)
    if vehicle.end_effector:
        frame, S = vehicle.frame(), planned.attitude.rotation()
        tip = state.position + R.apply(frame_pose(vehicle, frame, state.joints).p)
        tip_goal = goal.position + S.apply(frame_pose(vehicle, frame, goal.joints).p)
        residuals += [*((tip - tip_goal) * weights.tool)]
    return tuple(residuals)


def _joint_residuals(
    weights: Weights, state: State, joints: Scalars, rates: Scalars
) -> list[Scalar]:
    """Weighted errors of the joint positions, then of the joint rates."""
    off = differences(state.joints, joints)
    drift = differences(state.joint_rates, rates)
    return [
        *(mul(each, weights.joints) for each in off),
        *(mul(each, weights.joint_rates) for each in drift),
    ]


def given_way(vehicle: Vehicle, joints: Scalars, tilt: Vec3) -> Scalars:
    """Joint positions at which the joints next to the base compensate a base tilt (sine
    of angle, body axes).
    """
    turned = []
    for link, q in zip(vehicle.links, joints, strict=True):
        axis = link.joint.rotation.apply(link.joint.motion_subspace.angular)
        turned.append(sub(q, axis.dot(tilt)) if link.parent == BASE else q)
    return tuple(turned)


def input_residuals(
    model: Model,
    weights: Weights,
    state: State,
    inputs: StageInputs,
    disturbance: Disturbance,
    goal: StageGoal,
) -> Scalars:
    """Weighted residuals of one stage's joint and rotor accelerations, and of the
    contact force if there is one.

    Accelerations of the joints, not their torques, are kept near the wanted ones, and
    the rates of the rotor speeds, not the speeds, small: what holds against a constant
    disturbance costs nothing, so that it leaves no offset. Where a contact may be, the
    last one is of the surface's force.
    """
    pushed, force = under_contact(
        model, state, inputs.efforts, disturbance, goal.joint_rates, goal.contact
    )
    _, _, qdd = accelerations(model, state, inputs.efforts, pushed, goal.joint_rates)
    arm = [
        mul(each, weights.joint_accelerations)
        for each in differences(qdd, goal.joint_accelerations)
    ]
    pressed: Scalars = ()
    if goal.contact:
        pressed = (
            (force - goal.contact.force * goal.contact.touching) * weights.force,
        )
    rotors = inputs.rotor_accelerations
    if goal.planned:
        rotors = tuple(map(sub, rotors, goal.planned.rotor_accelerations))
    return (*arm, *(weights.rotor_accelerations * u for u in rotors), *pressed)


def predict_stage(
    model: Model,
    state: State,
    inputs: StageInputs,
    disturbance: Disturbance,
    goal: StageGoal,
    dt: Scalar,
) -> State:
    """State after a stage of ``dt`` seconds under a constant contact force."""
    # dry friction is that of the goal's joint rates: that of the state's own would make
    # the stage as stiff as tanh is steep (prediction.accelerations)
    pushed, _ = under_contact(
        model, state, inputs.efforts, disturbance, goal.joint_rates, goal.contact
    )
    return integrate_stage(model, state, inputs, pushed, dt, goal.joint_rates)
