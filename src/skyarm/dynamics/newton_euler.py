"""Inverse dynamics: the recursive Newton-Euler algorithm for a floating base.

Source: Luh, Walker, Paul 1980; Featherstone 2008, section 5.3, with classical
accelerations at link origins.

What passes from link to link is the *proper acceleration* of its origin in base axes,
the second derivative of the position minus gravity. The spatial accelerations of
textbooks bring the attitude and the velocities of base and links into the formulas;
these do not, so they take fewer operations. The cost: tests must compare them with
another library, since no textbook has them in this form.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Force, Motion, Scalar, Scalars, Vec3, centripetal
from skyarm.algebra.scalars import add, mul
from skyarm.dynamics.kinematics import (
    Pose,
    every_joint,
    every_rate,
    joint_placement,
    onto_leaders,
)
from skyarm.dynamics.link_axes import members, spatial_inertia
from skyarm.dynamics.state import State
from skyarm.records.immutable import positional
from skyarm.vehicle import BASE, Body, Joint, Vehicle


@positional
class JointMotion:
    """Angular velocity of a link, and the velocity-product (centripetal and Coriolis)
    terms of its acceleration.
    """

    rate: Vec3
    products: Motion


def joint_motion(
    joint: Joint, placement: Pose, parent_rate: Vec3, joint_rate: Scalar
) -> JointMotion:
    """Angular velocity of a link from that of its parent, and the velocity-product
    terms of the link's acceleration.

    With w the rates and s the joint's own motion: angular w x s; linear R^T (w_P x (w_P
    x p)), and the Coriolis term 2 w x s of a sliding joint.
    """
    carried = placement.R.apply_T(parent_rate)
    own = joint.motion_subspace * joint_rate
    inward = placement.R.apply_T(centripetal(parent_rate, placement.p))
    products = Motion(
        carried.cross(own.angular), inward + carried.cross(own.linear) * 2.0
    )
    return JointMotion(carried + own.angular, products)


def motions(
    vehicle: Vehicle, places: Sequence[Pose], rate: Vec3, joint_rates: Sequence[Scalar]
) -> list[JointMotion]:
    """Angular velocities of all links, and the velocity-product terms of their
    accelerations.
    """
    moving: list[JointMotion] = []
    for link, place, joint_rate in zip(vehicle.links, places, joint_rates, strict=True):
        parent_rate = rate if link.parent == BASE else moving[link.parent].rate
        moving.append(joint_motion(link.joint, place, parent_rate, joint_rate))
    return moving


def inverse_dynamics(
    vehicle: Vehicle,
    joints: Sequence[Scalar],
    rate: Vec3,
    joint_rates: Sequence[Scalar],
    base: Motion,
    joint_accelerations: Sequence[Scalar],
) -> tuple[Force, Scalars]:
    """Base force and joint torques that a motion requires (inverse dynamics): M a + C
    v + G.

    Args:
        vehicle: the rigid bodies.
        joints: rad or m.
        rate: base angular velocity, base axes, rad/s.
        joint_rates: time derivative of ``joints``.
        base: proper acceleration of the base, base axes
            (:func:`skyarm.dynamics.proper_acceleration`).
        joint_accelerations: second time derivative of ``joints``.

    Returns:
        Force on the base (torque about and force at its origin, base axes) and the
        joint torques or forces.
    """
    if vehicle.followers:
        force, efforts = inverse_dynamics(
            vehicle.with_free_followers,
            every_joint(vehicle, joints),
            rate,
            every_rate(vehicle, joint_rates),
            base,
            every_rate(vehicle, joint_accelerations),
        )
        return force, onto_leaders(vehicle, efforts)
    bodies = members(vehicle, joints)
    places = [body.place for body in bodies]
    moving = motions(vehicle, places, rate, joint_rates)
    inertia = spatial_inertia(vehicle.base)
    accelerations = _accelerations(vehicle, places, moving, base, joint_accelerations)
    forces = [
        body.inertia.apply(a) + body.inertia.velocity_force(motion.rate)
        for body, motion, a in zip(bodies, moving, accelerations, strict=True)
    ]
    # the base is the last, where its index of -1 finds it
    forces.append(inertia.apply(base) + inertia.velocity_force(rate))
    torques: list[Scalar] = [0] * vehicle.n
    # children have larger indices than their parents
    for i in reversed(range(vehicle.n)):
        link = vehicle.links[i]
        # the armature resists its joint, but moves no body of the tree
        own = mul(link.joint.armature, joint_accelerations[i])
        torques[i] = add(link.joint.motion_subspace.dot(forces[i]), own)
        forces[link.parent] += forces[i].into_parent(places[i].R, places[i].p)
    return forces[BASE], tuple(torques)


def load_forces(
    vehicle: Vehicle,
    loads: Sequence[tuple[int, Body]],
    state: State,
    base: Motion,
    joint_accelerations: Sequence[Scalar],
) -> list[Force]:
    """Force and torque that carry each load in a motion: m (a + g) at its centre of
    mass, and what turns it.

    Args:
        vehicle: its joints.
        loads: link (``BASE`` for the base) and body of each, in that link's axes.
        state: joints and rates.
        base: proper acceleration of the base, base axes.
        joint_accelerations: second time derivative of the joints.

    Returns:
        Torque about and force at the origin of each load's link, link axes.
    """
    joints = every_joint(vehicle, state.joints)
    joint_rates = every_rate(vehicle, state.joint_rates)
    joint_accelerations = every_rate(vehicle, joint_accelerations)
    vehicle = vehicle.with_free_followers
    places = [
        # own axes of the links, not working axes: loads are given in these
        joint_placement(joint, q)
        for joint, q in zip(vehicle.joints, joints, strict=True)
    ]
    moving = motions(vehicle, places, state.rate, joint_rates)
    # by their index, of which the base's is the last
    accelerations = [
        *_accelerations(vehicle, places, moving, base, joint_accelerations),
        base,
    ]
    rates = [*(each.rate for each in moving), state.rate]
    inertias = ((link, spatial_inertia(load)) for link, load in loads)
    return [
        inertia.apply(accelerations[link]) + inertia.velocity_force(rates[link])
        for link, inertia in inertias
    ]


def _accelerations(
    vehicle: Vehicle,
    places: Sequence[Pose],
    moving: Sequence[JointMotion],
    base: Motion,
    joint_accelerations: Sequence[Scalar],
) -> list[Motion]:
    """Proper acceleration of each link at its origin, in the axes of its place."""
    accelerations: list[Motion] = []
    for link, place, motion, qdd in zip(
        vehicle.links, places, moving, joint_accelerations, strict=True
    ):
        parent = base if link.parent == BASE else accelerations[link.parent]
        own = link.joint.motion_subspace * qdd
        accelerations.append(
            parent.into_child(place.R, place.p) + motion.products + own
        )
    return accelerations
