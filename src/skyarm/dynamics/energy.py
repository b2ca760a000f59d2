"""Centre of mass, momentum and energy."""

from __future__ import annotations

from skyarm.algebra import ZERO3, Scalar, Vec3
from skyarm.algebra.scalars import add, divide, mul
from skyarm.dynamics.kinematics import Pose, link_poses, untie_followers
from skyarm.dynamics.state import State
from skyarm.records.immutable import positional
from skyarm.vehicle import Body, Vehicle


@positional
class Momentum:
    """Linear (kg m/s) and angular momentum about the centre of mass (kg m^2/s), world
    axes.
    """

    linear: Vec3
    angular: Vec3


@positional
class _BodyMotion:
    """Motion of a body: world pose and angular velocity of its link, position and
    velocity of its centre of mass.
    """

    body: Body
    pose: Pose
    w: Vec3
    com: Vec3
    velocity: Vec3


def _body_motions(vehicle: Vehicle, state: State) -> list[_BodyMotion]:
    """World poses and velocities of the base and all links."""
    vehicle, state = untie_followers(vehicle, state)
    base = Pose(state.rotation, state.position)
    poses = [base, *(base @ pose for pose in link_poses(vehicle, state.joints))]
    rates = [base.R.apply(state.rate)]
    origins = [state.velocity]
    for i, link in enumerate(vehicle.links):
        # the base comes first, so that an index is one higher here: its -1 is 0
        parent = link.parent + 1
        R = poses[i + 1].R
        own = link.joint.motion_subspace
        rate = state.joint_rates[i]
        carried = origins[parent] + rates[parent].cross(
            poses[i + 1].p - poses[parent].p
        )
        rates.append(rates[parent] + R.apply(own.angular) * rate)
        origins.append(carried + R.apply(own.linear) * rate)
    moving = []
    for body, pose, w, v in zip(vehicle.bodies, poses, rates, origins, strict=True):
        arm = pose.R.apply(body.com)
        moving.append(_BodyMotion(body, pose, w, pose.p + arm, v + w.cross(arm)))
    return moving


def center_of_mass(vehicle: Vehicle, state: State) -> Vec3:
    """Centre of mass of the whole vehicle in the world, m."""
    total = ZERO3
    for motion in _body_motions(vehicle, state):
        total = total + motion.com * motion.body.mass
    return total * divide(1.0, vehicle.mass)


def momentum(vehicle: Vehicle, state: State) -> Momentum:
    """Linear momentum, and angular momentum about the centre of mass, world axes."""
    linear, angular = ZERO3, ZERO3
    com = center_of_mass(vehicle, state)
    for motion in _body_motions(vehicle, state):
        p = motion.velocity * motion.body.mass
        spin = motion.pose.R.apply(
            motion.body.inertia.apply(motion.pose.R.apply_T(motion.w))
        )
        linear = linear + p
        angular = angular + spin + (motion.com - com).cross(p)
    return Momentum(linear, angular)


def kinetic_energy(vehicle: Vehicle, state: State) -> Scalar:
    """Kinetic energy of the vehicle, J."""
    vehicle, state = untie_followers(vehicle, state)
    total: Scalar = 0
    for motion in _body_motions(vehicle, state):
        w = motion.pose.R.apply_T(motion.w)
        body = motion.body
        total = add(
            total,
            add(
                mul(body.mass, motion.velocity.dot(motion.velocity)),
                w.dot(body.inertia.apply(w)),
            ),
        )
    # armature: inertia of motors behind their gears, which is of no body
    for joint, rate in zip(vehicle.joints, state.joint_rates, strict=True):
        total = add(total, mul(joint.armature, mul(rate, rate)))
    return mul(0.5, total)


def potential_energy(vehicle: Vehicle, state: State, gravity: Scalar) -> Scalar:
    """Potential energy of the vehicle in gravity (m/s^2), zero at world z = 0, J."""
    return mul(mul(vehicle.mass, gravity), center_of_mass(vehicle, state).z)
