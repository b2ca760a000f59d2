"""Demands of the law at one instant: thrust, angular acceleration and joint accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import E_Z, ZERO3, Mat3, Vec3
from skyarm.control.blocks.attitude import Attitude, angular_acceleration, attitude
from skyarm.control.blocks.disturbance import Disturbance
from skyarm.control.blocks.prediction import side_wrench
from skyarm.control.blocks.series_kinematics import Posture, derivative, moving, posture
from skyarm.control.laws.centroidal import com_tracking as center_of_mass
from skyarm.control.laws.centroidal import tip_reference, tip_tasks
from skyarm.control.laws.centroidal.parameters import CentroidalParameters
from skyarm.control.model import Model
from skyarm.dynamics import State
from skyarm.dynamics.kinematics import Pose
from skyarm.scalars import add, mul, sub
from skyarm.scalars.taylor import Taylor


@dataclass(frozen=True, kw_only=True, slots=True)
class Planned:
    """Motion without errors.

    Attributes:
        R: R_WB, quasi-static attitude. rate, alpha: its angular velocity and acceleration, rad/s and rad/s^2.
        proper: acceleration of the base origin less gravity, m/s^2. All in base axes.
        joints: signals, series in time.
    """

    R: Mat3
    rate: Vec3
    alpha: Vec3
    proper: Vec3
    joints: tuple[Taylor, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Demand:
    """Thrust along body z (N), angular acceleration (body axes, rad/s^2), joint accelerations; the planned motion."""

    thrust: Any
    alpha: Vec3
    joints: tuple[Any, ...]
    planned: Planned


def demands(
    par: CentroidalParameters,
    model: Model,
    state: State,
    signals: Sequence[Taylor],
    unknown: Disturbance,
    steady: Vec3,
) -> Demand:
    """Return the demand at this state.

    Args:
        par: constants.
        model: belief.
        state: now.
        signals: x, y, z, yaw and the joints, series in time.
        unknown: disturbance.
        steady: its force without the rotors' own drag, which the posture follows.
    """
    vehicle, mass = model.vehicle, model.vehicle.mass
    base = [Vec3(*(signal.derivative(k) for signal in signals[:3])) for k in range(5)]
    yaw, joints = signals[3], tuple(signals[4:])
    level = posture(vehicle, joints, 4)
    R, w = state.quaternion.rotation(), state.rate
    # drag at the reference's velocity: at the present one it would feed noise and errors into the posture
    drag = R.apply(side_wrench(model, state.rotor_speeds, R.apply_T(base[1]), ZERO3).force)
    still = attitude(center_of_mass.quasi_static(par, mass, base, steady + drag), yaw.truncated(2))
    turned = joints
    now = posture(vehicle, moving(state.joints, state.joint_rates, (0,) * vehicle.n), 2)
    preferred = joint_accelerations(par, state, joints)
    if par.mode == "tip":
        goal = tip_reference.goal(vehicle, base, yaw, joints, level)
        reach = derivative(now.tip, 0)
        turned = _level_links(par, model, goal, still, joints, level)
        upright, level = level, posture(vehicle, turned, 4)
        offset = tip_reference.shift(upright, yaw, level, still, par.tip.shift_limit)
        base = [*(p + s for p, s in zip(base, offset, strict=False)), *base[3:]]
    push = center_of_mass.thrust(
        par,
        mass,
        wanted=center_of_mass.goal(base, level.com, still.R),
        position=state.position + R.apply(derivative(now.com, 0)),
        velocity=state.velocity + _velocity(R, w, now.com),
        R=R,
        w=w,
        disturbance=unknown.force,
    )
    alpha = angular_acceleration(par.base, attitude(push.force, yaw.truncated(2)), R, w)
    if par.mode == "tip":
        present = tip_tasks.Now(
            R=R,
            rate=w,
            alpha=alpha,
            joints=state.joints,
            joint_rates=state.joint_rates,
            posture=now,
            tip=state.position + R.apply(reach),
            tip_velocity=state.velocity + _velocity(R, w, now.tip),
            com_acceleration=push.acceleration,
        )
        goal = tip_reference.move_goal(
            goal, [state.position - base[0], state.velocity - base[1], push.acceleration - base[2]], par.tip.reach
        )
        preferred = tip_tasks.joint_accelerations(vehicle, par.tip, goal, present, preferred)
    plan = Planned(
        R=still.R,
        rate=still.rate,
        alpha=still.acceleration,
        proper=still.R.apply_T(base[2] + E_Z * par.model.gravity),
        joints=turned,
    )
    return Demand(thrust=push.along, alpha=alpha, joints=preferred, planned=plan)


def joint_accelerations(par: CentroidalParameters, state: State, joints: Sequence[Taylor]) -> tuple[Any, ...]:
    """qdd_d + kd (qd_d - qd) + kp (q_d - q)."""
    gains = par.joint_gains
    return tuple(
        add(add(q_d.derivative(2), mul(kd, sub(q_d.derivative(1), qd))), mul(kp, sub(q_d.derivative(0), q)))
        for kp, kd, q_d, q, qd in zip(
            gains.stiffness, gains.damping, joints, state.joints, state.joint_rates, strict=True
        )
    )


def _velocity(R: Mat3, w: Vec3, point: Vec3) -> Vec3:
    """World velocity of a point of the vehicle against the base origin."""
    return R.apply(w.cross(derivative(point, 0)) + derivative(point, 1))


def _level_links(
    par: CentroidalParameters,
    model: Model,
    goal: tip_reference.Goal,
    still: Attitude,
    joints: Sequence[Taylor],
    level: Posture,
) -> tuple[Taylor, ...]:
    """The joints whose links are turned as those of a level base, at the quasi-static attitude."""
    vehicle = model.vehicle
    poses = [Pose(Mat3(*(derivative(row, 0) for row in pose.R.rows)), ZERO3) for pose in level.links]
    change = tip_tasks.level_joints(vehicle, par.tip, goal, still.R, poses)
    return tuple(q + c for q, c in zip(joints, change, strict=True))
