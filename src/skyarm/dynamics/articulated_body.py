"""Forward dynamics: the O(n) articulated-body algorithm for a floating base.

Source: Featherstone 2008, sections 7.3 and 9.4, with classical accelerations at link
origins.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import (
    ZERO3,
    ArticulatedInertia,
    Force,
    Mat3,
    Motion,
    Scalar,
    Scalars,
    Vec3,
    differences,
    ldl_solve,
)
from skyarm.algebra.scalars import add, divide, mul, same, sub
from skyarm.dynamics.composite_body import mass_matrix
from skyarm.dynamics.link_axes import members, spatial_inertia
from skyarm.dynamics.newton_euler import inverse_dynamics, motions
from skyarm.vehicle import BASE, Vehicle


def forward_dynamics(
    vehicle: Vehicle,
    joints: Sequence[Scalar],
    rate: Vec3,
    joint_rates: Sequence[Scalar],
    applied: Force,
    joint_torques: Sequence[Scalar],
) -> tuple[Motion, Scalars]:
    """Forward dynamics: base and joint accelerations under applied forces.

    Args:
        vehicle: the rigid bodies.
        joints: rad or m.
        rate: base angular velocity, base axes, rad/s.
        joint_rates: time derivative of ``joints``.
        applied: torque about and force at the base origin, base axes; gravity is not
            part of it.
        joint_torques: N m or N.

    Returns:
        Proper acceleration of the base (base axes) and the joint accelerations.
    """
    # a follower shares its leader's coordinate: the recursion takes independent joints
    if vehicle.followers:
        return _by_mass_matrix(
            vehicle, joints, rate, joint_rates, applied, joint_torques
        )
    n, links = vehicle.n, vehicle.links
    bodies = members(vehicle, joints)
    places = [body.place for body in bodies]
    moving = motions(vehicle, places, rate, joint_rates)
    # the base is the last, where its index of -1 finds it
    rigid = [*(body.inertia for body in bodies), spatial_inertia(vehicle.base)]
    rates = [*(motion.rate for motion in moving), rate]
    inertias = [body.as_articulated() for body in rigid]
    biases = [body.velocity_force(own) for body, own in zip(rigid, rates, strict=True)]
    U = [Force(ZERO3, ZERO3)] * n
    inverse_d: list[Scalar] = [0] * n
    u: list[Scalar] = [0] * n
    # inwards, children before their parents, which have smaller indices
    for i in reversed(range(n)):
        S = links[i].joint.motion_subspace
        U[i] = inertias[i].apply(S)
        armature = links[i].joint.armature
        # the armature turns with the joint alone, so it adds to this diagonal only
        inverse_d[i] = divide(1.0, add(S.dot(U[i]), armature))
        u[i] = sub(joint_torques[i], S.dot(biases[i]))
        # without armature nothing is left along the axis: exact zeros of structure
        reduced = inertias[i].without(S, U[i], inverse_d[i], free=same(armature, 0))
        bias = (
            biases[i]
            + reduced.apply(moving[i].products)
            + U[i] * mul(u[i], inverse_d[i])
        )
        inertias[links[i].parent] += reduced.into_parent(places[i].R, places[i].p)
        biases[links[i].parent] += bias.into_parent(places[i].R, places[i].p)
    base_acceleration = _solve_base(inertias[BASE], applied - biases[BASE])
    accelerations: list[Motion] = []
    joint_accelerations: list[Scalar] = []
    for i in range(n):
        parent = (
            base_acceleration
            if links[i].parent == BASE
            else accelerations[links[i].parent]
        )
        a = parent.into_child(places[i].R, places[i].p) + moving[i].products
        qdd = mul(sub(u[i], a.dot(U[i])), inverse_d[i])
        joint_accelerations.append(qdd)
        accelerations.append(a + links[i].joint.motion_subspace * qdd)
    return base_acceleration, tuple(joint_accelerations)


def _by_mass_matrix(
    vehicle: Vehicle,
    joints: Sequence[Scalar],
    rate: Vec3,
    joint_rates: Sequence[Scalar],
    applied: Force,
    joint_torques: Sequence[Scalar],
) -> tuple[Motion, Scalars]:
    """Forward dynamics of a vehicle with coupled joints, by solving M a = f - bias."""
    # at zero proper acceleration only the velocity terms are left
    still = Motion(ZERO3, ZERO3)
    bias, holding = inverse_dynamics(
        vehicle, joints, rate, joint_rates, still, (0,) * vehicle.n
    )
    pushed = applied - bias
    efforts = differences(joint_torques, holding)
    x = ldl_solve(
        # identity: all in base axes, as the forces are
        mass_matrix(vehicle, Mat3.identity(), joints),
        [*pushed.force, *pushed.torque, *efforts],
    )
    # linear rows come first in M, angular parts first in a Motion
    return Motion(Vec3(*x[3:6]), Vec3(*x[:3])), tuple(x[6:])


def _solve_base(inertia: ArticulatedInertia, force: Force) -> Motion:
    """Acceleration of the floating base from its articulated inertia and the force on
    it.
    """
    M, J, H = inertia.M.full().rows, inertia.J.full().rows, inertia.H
    # H couples rate and force: linear rows first, as in the mass matrix
    A = [[*row, *H.column(i)] for i, row in enumerate(M)] + [
        [*left, *row] for left, row in zip(H.rows, J, strict=True)
    ]
    x = ldl_solve(A, [*force.force, *force.torque])
    return Motion(Vec3(*x[3:]), Vec3(*x[:3]))
