"""Centre of mass, locked inertia, arm reaction, and inverse dynamics under a thrust
along body z.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm import dynamics
from skyarm.algebra import (
    ZERO3,
    Force,
    Mat3,
    Motion,
    Scalar,
    Scalars,
    SpatialInertia,
    Sym3,
    Vec3,
    inner_product,
    ldl_solve,
)
from skyarm.algebra.scalars import add, divide, mul, sub
from skyarm.dynamics.kinematics import Pose, jacobian_columns, link_poses
from skyarm.dynamics.link_axes import spatial_inertia
from skyarm.records.immutable import positional
from skyarm.vehicle import BASE, Frame, Vehicle


def locked_inertia(vehicle: Vehicle, joints: Sequence[Scalar]) -> SpatialInertia:
    """Spatial inertia of the whole vehicle with its joints locked: about the base
    origin, base axes.
    """
    total = spatial_inertia(vehicle.base)
    for link, pose in zip(vehicle.moving, link_poses(vehicle, joints), strict=True):
        total = total + spatial_inertia(link.body).into_parent(pose.R, pose.p)
    return total


def central_inertia(locked: SpatialInertia) -> tuple[Vec3, Sym3]:
    """Centre of mass (m, base frame) and rotational inertia about it (kg m^2, base
    axes): parallel-axis theorem.
    """
    center = locked.moment * divide(1.0, locked.mass)
    return center, locked.inertia - Sym3.parallel_axis(locked.mass, center)


def center_velocity(
    vehicle: Vehicle, joints: Sequence[Scalar], joint_rates: Sequence[Scalar]
) -> Vec3:
    """Velocity (m/s, base axes) of the centre of mass relative to the base due to the
    joint rates.
    """
    total = ZERO3
    for i, link in enumerate(vehicle.moving):
        columns = jacobian_columns(
            vehicle, Frame(name="com", link=i, position=link.body.com), joints
        )
        for column, rate in zip(columns, joint_rates, strict=True):
            total = total + column.linear * rate * link.body.mass
    return total * divide(1.0, vehicle.mass)


def axes(vehicle: Vehicle, poses: Sequence[Pose]) -> list[Vec3]:
    """Unit vectors along the joint axes, in base axes."""
    return [
        pose.R.apply(joint.axis)
        # poses of followers come behind those of the joints
        for joint, pose in zip(vehicle.joints, poses, strict=False)
    ]


def com_columns(vehicle: Vehicle, poses: Sequence[Pose]) -> list[Vec3]:
    """Jacobian of the centre of mass with respect to the joints, times the vehicle's
    mass, as columns in base axes.
    """
    if vehicle.followers:
        own = com_columns(vehicle.with_free_followers, poses)
        for each, column in zip(vehicle.followers, own[vehicle.n :], strict=True):
            # the leader moves its follower too: chain rule with the ratio of their
            # rates
            own[each.leader] = own[each.leader] + column * each.ratio
        return own[: vehicle.n]
    masses = [link.body.mass for link in vehicle.links]
    moments = [
        pose.apply(link.body.com) * link.body.mass
        for link, pose in zip(vehicle.links, poses, strict=True)
    ]
    # outer links first, since each hands all that it carries to its parent
    for i in reversed(range(vehicle.n)):
        parent = vehicle.links[i].parent
        if parent != BASE:
            masses[parent] = add(masses[parent], masses[i])
            moments[parent] = moments[parent] + moments[i]
    return [
        (
            axis.cross(moments[i] - poses[i].p * masses[i])
            if vehicle.links[i].joint.turns
            else axis * masses[i]
        )
        for i, axis in enumerate(axes(vehicle, poses))
    ]


def arm_reaction(
    vehicle: Vehicle,
    joints: Sequence[Scalar],
    rate: Vec3,
    joint_rates: Sequence[Scalar],
    joint_accelerations: Sequence[Scalar],
) -> Force:
    """Force and torque at the base origin that the arm's motion and velocity products
    require, base axes.

    With the base's origin and its rate unaccelerated; at rate zero the force is the
    mass times the acceleration of the centre of mass against the base.
    """
    still = Motion(ZERO3, ZERO3)
    return dynamics.inverse_dynamics(
        vehicle, joints, rate, joint_rates, still, joint_accelerations
    )[0]


def forces_under_thrust(
    vehicle: Vehicle,
    joints: Sequence[Scalar],
    rate: Vec3,
    joint_rates: Sequence[Scalar],
    *,
    applied: Vec3,
    angular: Vec3,
    joint_accelerations: Sequence[Scalar],
) -> tuple[Force, Scalars, Vec3]:
    """Inverse dynamics for desired angular and joint accelerations under a given force
    on the base.

    The translational block of the mass matrix is m 1: the proper acceleration that
    follows is (f - F0) / m, with F0 the force that the wanted accelerations need while
    the base's origin does not accelerate.

    Args:
        vehicle: the model.
        joints: rad or m.
        rate: angular velocity of the base, base axes, rad/s.
        joint_rates: rad/s or m/s.
        applied: force at the base origin that is really there, base axes, N: thrust,
            wind.
        angular: desired angular acceleration, base axes, rad/s^2.
        joint_accelerations: desired joint accelerations, rad/s^2 or m/s^2.

    Returns:
        Force on the base (its force equals ``applied``), joint torques, proper
        acceleration of the base origin (m/s^2).
    """
    rotation = Motion(angular, ZERO3)
    alone, _ = dynamics.inverse_dynamics(
        vehicle, joints, rate, joint_rates, rotation, joint_accelerations
    )
    follows = (applied - alone.force) * divide(1.0, vehicle.mass)
    base = Motion(angular, follows)
    force, torques = dynamics.inverse_dynamics(
        vehicle, joints, rate, joint_rates, base, joint_accelerations
    )
    return force, torques, follows


@positional
class Reaction:
    """Mass matrix of the joints of a vehicle whose base translates freely and rotates
    as desired.

    Blocks of the mass matrix: t the base's translation, w its rotation, j the joints;
    the base's origin moves freely.

    Attributes:
        joints: M_jj - M_jt M_tj / m, joint torques per joint acceleration, a row a
            joint.
        base: M_wj - M_wt M_tj / m, body torque (base axes) per joint acceleration,
            three rows.
    """

    joints: list[list[Scalar]]
    base: list[list[Scalar]]

    def torque(self, accelerations: Sequence[Scalar]) -> Vec3:
        """Body torque (N m, base axes) required by joint accelerations."""
        return Vec3(*(inner_product(row, accelerations) for row in self.base))

    def accelerations(self, efforts: Sequence[Scalar]) -> list[Scalar]:
        """Joint accelerations caused by joint torques or forces."""
        return ldl_solve(self.joints, list(efforts)) if self.joints else []


def reaction(vehicle: Vehicle, joints: Sequence[Scalar]) -> Reaction:
    """Mass matrix of the joints with the base free to move, at joint positions (rad or
    m), as a :class:`Reaction`.
    """
    if not joints:
        return Reaction([], [[], [], []])
    # the reduced blocks do not depend on the attitude, so any one serves
    M = dynamics.mass_matrix(vehicle, Mat3.identity(), joints)
    share, n = divide(1.0, vehicle.mass), len(joints)

    # the translation's block is m 1, so that eliminating it takes products and no solve
    def reduced_entry(row: int, column: int) -> Scalar:
        total = M[row][column]
        for k in range(3):
            total = sub(total, mul(mul(M[row][k], M[column][k]), share))
        return total

    return Reaction(
        joints=[[reduced_entry(6 + i, 6 + j) for j in range(n)] for i in range(n)],
        base=[[reduced_entry(k, 6 + j) for j in range(n)] for k in range(3, 6)],
    )
