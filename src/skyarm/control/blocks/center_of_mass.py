"""Centre of mass, locked inertia, arm reaction, and inverse dynamics under a thrust along body z."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm import dynamics
from skyarm.algebra import ZERO3, Force, Motion, SpatialInertia, Sym3, Vec3
from skyarm.algebra.scalars import Scalar, divide
from skyarm.dynamics.kinematics import jacobian_columns, link_poses
from skyarm.dynamics.link_axes import spatial_inertia
from skyarm.vehicle.vehicle_records import Frame, Vehicle


def locked_inertia(vehicle: Vehicle, joints: Sequence[Scalar]) -> SpatialInertia:
    """Spatial inertia of the whole vehicle with its joints locked: about the base origin, base axes."""
    total = spatial_inertia(vehicle.base)
    for link, pose in zip(vehicle.moving, link_poses(vehicle, joints), strict=True):
        total = total + spatial_inertia(link.body).into_parent(pose.R, pose.p)
    return total


def central_inertia(locked: SpatialInertia) -> tuple[Vec3, Sym3]:
    """Centre of mass (base frame, m) and rotational inertia about it (base axes, kg m^2): Steiner backwards."""
    center: Vec3 = locked.moment * divide(1.0, locked.mass)
    return center, locked.inertia - Sym3.parallel_axis(locked.mass, center)


def center_velocity(vehicle: Vehicle, joints: Sequence[Scalar], joint_rates: Sequence[Scalar]) -> Vec3:
    """Velocity of the centre of mass against the base, base axes, m/s: what the joint rates give it."""
    total: Vec3 = ZERO3
    for i, link in enumerate(vehicle.moving):
        columns = jacobian_columns(vehicle, Frame(name="com", link=i, position=link.body.com), joints)
        for column, rate in zip(columns, joint_rates, strict=True):
            total = total + column.linear * rate * link.body.mass
    velocity: Vec3 = total * divide(1.0, vehicle.mass)
    return velocity


def arm_reaction(
    vehicle: Vehicle, joints: Sequence[Any], rate: Vec3, joint_rates: Sequence[Any], joint_accelerations: Sequence[Any]
) -> Force:
    """Force and torque at the base origin that the arm's motion and the velocity products need, base axes.

    With the base's origin and its rate unaccelerated; at rate zero the force is the mass times the acceleration of the
    centre of mass against the base.
    """
    still = Motion(ZERO3, ZERO3)
    return dynamics.inverse_dynamics(vehicle, joints, rate, joint_rates, still, joint_accelerations)[0]


def forces_under_thrust(
    vehicle: Vehicle,
    joints: Sequence[Any],
    rate: Vec3,
    joint_rates: Sequence[Any],
    *,
    applied: Vec3,
    angular: Vec3,
    joint_accelerations: Sequence[Any],
) -> tuple[Force, tuple[Any, ...], Vec3]:
    """Torque on the base and joint torques for desired angular and joint accelerations under a given force.

    The translational block of the mass matrix is m 1: the proper acceleration that follows is (f - F0) / m, with F0
    the force that the wanted accelerations need while the base's origin does not accelerate.

    Args:
        vehicle: the model.
        joints: rad or m.
        rate: of the base, base axes, rad/s.
        joint_rates: rad/s or m/s.
        applied: force at the base origin that is really there, base axes, N: thrust, wind.
        angular: wanted angular acceleration, base axes, rad/s^2.
        joint_accelerations: wanted.

    Returns:
        Force on the base (its force equals ``applied``), joint torques, proper acceleration of the base origin (m/s^2).
    """
    held = Motion(angular, ZERO3)
    alone, _ = dynamics.inverse_dynamics(vehicle, joints, rate, joint_rates, held, joint_accelerations)
    follows = (applied - alone.force) * divide(1.0, vehicle.mass)
    base = Motion(angular, follows)
    force, torques = dynamics.inverse_dynamics(vehicle, joints, rate, joint_rates, base, joint_accelerations)
    return force, torques, follows
