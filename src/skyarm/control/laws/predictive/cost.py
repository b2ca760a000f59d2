"""What a predictive controller wants: residuals whose squares it adds up over the horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skyarm.algebra import Vec3
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.laws.predictive.contact_force import Contact, under_contact
from skyarm.control.laws.predictive.motion_plan import Inputs, accelerations, carried
from skyarm.control.model import Model
from skyarm.dynamics import State, frame_pose
from skyarm.scalars import Scalar, cos, mul, sin, sub
from skyarm.vehicle.linkage import BASE
from skyarm.vehicle.vehicle_records import Vehicle

MODES = ("tool", "joints")


@dataclass(frozen=True, kw_only=True, slots=True)
class Goal:
    """Wanted motion at a stage, of base (world axes, m, rad) and joints (rad or m).

    Attributes:
        position, velocity, yaw, joints, joint_rates, joint_accelerations: those.
        shift: m, world axes: way of the base that leaves the tip where a level base would carry it.
        contact: of the tip with a surface; empty where none is ever asked for.
    """

    position: Vec3
    velocity: Vec3
    yaw: Scalar
    joints: tuple[Scalar, ...]
    joint_rates: tuple[Scalar, ...]
    joint_accelerations: tuple[Scalar, ...]
    shift: Vec3
    contact: Contact | tuple[()] = ()


@dataclass(frozen=True, kw_only=True, slots=True)
class Weights:
    """Weight of each residual: one over the error that costs 1 per second.

    Attributes:
        position: 1/m. velocity: s/m. heading: 1/rad. rate: s/rad, of the base.
        joints: 1/rad or 1/m. joint_rates: per second of that. joint_accelerations: per second squared.
        tool: 1/m.
        rotor_accelerations: s^2/rad.
        final: s, time for which the errors at the end of the horizon count.
        force: 1/N, of the surface's force while the tip presses.
    """

    position: Scalar
    velocity: Scalar
    heading: Scalar
    rate: Scalar
    joints: Scalar
    joint_rates: Scalar
    joint_accelerations: Scalar
    tool: Scalar
    rotor_accelerations: Scalar
    final: Scalar
    force: Scalar = 2.5


def state_residuals(model: Model, weights: Weights, state: State, goal: Goal, mode: str) -> tuple[Any, ...]:
    """Weighted errors of a state.

    In mode "joints" the joints follow their references. In mode "tool" the tip is where a level base would carry it;
    the joints next to the base give way to its tilt, so that for parallel axes the links keep their absolute angles,
    and the base gives way by what that leaves: about any axis across which no joint turns, the whole of the tip's way.
    A tip that touches has no place along the surface's normal.
    """
    vehicle, R = model.vehicle, state.quaternion.rotation()
    c, s = cos(goal.yaw), sin(goal.yaw)
    # heading taken off, what is left of a small attitude is its tilt about the body's own horizontal axes
    up = R.apply_T(Vec3(0, 0, 1))
    tilt = Vec3(up.y, -up.x, 0)
    held = given_way(vehicle, goal.joints, tilt) if mode == "tool" else goal.joints
    # the base stands where it carries the tip home once it leans as it must
    found = [*((state.position - goal.position - goal.shift) * weights.position)]
    found += [*((state.velocity - goal.velocity) * weights.velocity)]
    ahead = R.column(0)
    found.append(weights.heading * (c * ahead.y - s * ahead.x))
    found += [*(state.rate * weights.rate)]
    found += [mul(sub(q, q_d), weights.joints) for q, q_d in zip(state.joints, held, strict=True)]
    found += [mul(sub(a, b), weights.joint_rates) for a, b in zip(state.joint_rates, goal.joint_rates, strict=True)]
    if mode == "tool" and vehicle.end_effector:
        frame = vehicle.frame(vehicle.end_effector)
        tip = state.position + R.apply(frame_pose(vehicle, frame, state.joints).p)
        arm = frame_pose(vehicle, frame, goal.joints).p
        wanted = goal.position + Vec3(c * arm.x - s * arm.y, s * arm.x + c * arm.y, arm.z)
        off = tip - wanted
        if isinstance(goal.contact, Contact):
            off = off - goal.contact.normal * (goal.contact.normal.dot(off) * goal.contact.touching)
        found += [*(off * weights.tool)]
    return tuple(found)


def given_way(vehicle: Vehicle, joints: tuple[Any, ...], tilt: Vec3) -> tuple[Any, ...]:
    """Joints whose first ones take back a tilt of the base (body axes, sine): what follows keeps its own angle."""
    return tuple(
        sub(q, link.joint.rotation.apply(link.joint.axis).dot(tilt))
        if link.parent == BASE and link.joint.kind == "revolute"
        else q
        for link, q in zip(vehicle.links, joints, strict=True)
    )


def input_residuals(
    model: Model, weights: Weights, state: State, inputs: Inputs, disturbance: Disturbance, goal: Goal
) -> tuple[Any, ...]:
    """Weighted costs of the inputs.

    Accelerations of the joints, not their torques, are kept near the wanted ones, and the rates of the rotor speeds,
    not the speeds, small: what holds against a constant disturbance costs nothing, so that it leaves no offset. Where
    a contact may be, the last one is of the surface's force.
    """
    pushed, force = under_contact(model, state, inputs.efforts, disturbance, goal.joint_rates, goal.contact)
    _, _, found = accelerations(model, state, inputs.efforts, pushed, goal.joint_rates)
    arm = [mul(sub(a, b), weights.joint_accelerations) for a, b in zip(found, goal.joint_accelerations, strict=True)]
    pressed: tuple[Any, ...] = ()
    if isinstance(goal.contact, Contact):
        pressed = ((force - goal.contact.force * goal.contact.touching) * weights.force,)
    return (*arm, *(weights.rotor_accelerations * u for u in inputs.rotor_accelerations), *pressed)


def foreseen(model: Model, state: State, inputs: Inputs, disturbance: Disturbance, goal: Goal, dt: Any) -> State:
    """State after a stage of ``dt`` seconds, the surface's force at its beginning held over it."""
    pushed, _ = under_contact(model, state, inputs.efforts, disturbance, goal.joint_rates, goal.contact)
    return carried(model, state, inputs, pushed, dt, goal.joint_rates)
