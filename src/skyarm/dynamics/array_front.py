"""The NumPy front of the dynamics: stable, array in, array out, leading axes broadcast.

Generalized velocity is [v_W, w_B, joint rates]: velocity of the base *origin* in world axes, angular velocity in base
axes, joint rates. ``acceleration`` is its plain time derivative; ``force`` is its dual: world force at, and base-axes
torque about, the base origin, then joint torques. Rigid body only: no rotors, damping or friction.
"""

from __future__ import annotations

import numpy as np

from skyarm import dynamics
from skyarm.algebra import Force, Mat3, Vec3
from skyarm.dynamics.broadcast import (
    Array,
    ArrayLike,
    components,
    leading_axes,
    one_number,
    stacked,
    unit_quaternion,
    unit_rotation,
)
from skyarm.dynamics.kinematics import IDENTITY, Pose, frame_pose, jacobian_columns
from skyarm.dynamics.state import State, coordinate_acceleration, proper_acceleration
from skyarm.scalars import add
from skyarm.vehicle.check import refuse
from skyarm.vehicle.vehicle_records import Vehicle


def _joint_count(vehicle: Vehicle) -> int:
    """Number of joints of what must be a vehicle."""
    if not isinstance(vehicle, Vehicle):
        refuse("vehicle", vehicle, "must be a Vehicle")
    return vehicle.n


def inverse_dynamics(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    *,
    gravity: float = 9.81,
) -> Array:
    """Return the generalized force (..., 6+n) that gives ``acceleration`` at this state: M a + C v + G.

    Args:
        vehicle: the rigid bodies.
        position: (..., 3) base origin in the world, m; rigid-body forces do not depend on it.
        quaternion_wxyz: (..., 4) base to world, unit to 1e-6.
        joints: (..., n) rad or m.
        velocity: (..., 6+n), of which forces use the rates only.
        acceleration: (..., 6+n) plain time derivative of ``velocity``.
        gravity: m/s^2 along world -z.

    Raises:
        ValueError: no Vehicle, a wrong shape, numbers that are not finite, or a quaternion off unit length by more than
            1e-6. As everywhere in this module, the message names the argument.
    """
    n = _joint_count(vehicle)
    components("position", position, 3)
    R, q = unit_rotation(quaternion_wxyz), components("joints", joints, n)
    v = components("velocity", velocity, 6 + n)
    a = components("acceleration", acceleration, 6 + n)
    lead = leading_axes(position, quaternion_wxyz, joints, velocity, acceleration)
    base = proper_acceleration(R, Vec3(*a[:3]), Vec3(*a[3:6]), one_number("gravity", gravity))
    force, torques = dynamics.inverse_dynamics(vehicle, q, Vec3(*v[3:6]), v[6:], base, a[6:])
    return stacked([*R.apply(force.force), *force.torque, *torques], lead)


def forward_dynamics(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    velocity: ArrayLike,
    force: ArrayLike,
    *,
    gravity: float = 9.81,
) -> Array:
    """Return the acceleration (..., 6+n) under a generalized force (..., 6+n); as :func:`inverse_dynamics`."""
    n = _joint_count(vehicle)
    components("position", position, 3)
    R, q = unit_rotation(quaternion_wxyz), components("joints", joints, n)
    v, f = components("velocity", velocity, 6 + n), components("force", force, 6 + n)
    lead = leading_axes(position, quaternion_wxyz, joints, velocity, force)
    applied = Force(Vec3(*f[3:6]), R.apply_T(Vec3(*f[:3])))
    base, qdd = dynamics.forward_dynamics(vehicle, q, Vec3(*v[3:6]), v[6:], applied, f[6:])
    linear, angular = coordinate_acceleration(R, base, one_number("gravity", gravity))
    return stacked([*linear, *angular, *qdd], lead)


def mass_matrix(
    vehicle: Vehicle, position: ArrayLike, quaternion_wxyz: ArrayLike, joints: ArrayLike, *, gravity: float = 9.81
) -> Array:
    """Return the mass matrix (..., 6+n, 6+n); ``gravity`` is accepted for symmetry, without effect."""
    n = _joint_count(vehicle)
    one_number("gravity", gravity)
    components("position", position, 3)
    R, q = unit_rotation(quaternion_wxyz), components("joints", joints, n)
    lead = leading_axes(position, quaternion_wxyz, joints)
    return stacked(dynamics.mass_matrix(vehicle, R, q), lead)


def frame_pose_world(
    vehicle: Vehicle, position: ArrayLike, quaternion_wxyz: ArrayLike, joints: ArrayLike, *, frame: str | None = None
) -> tuple[Array, Array]:
    """Return world position (..., 3) and rotation R_WF (..., 3, 3) of a frame (the tip by default)."""
    n = _joint_count(vehicle)
    base = Pose(unit_rotation(quaternion_wxyz), Vec3(*components("position", position, 3)))
    named = vehicle.frame(frame)
    q = components("joints", joints, n)
    lead = leading_axes(position, quaternion_wxyz, joints)
    pose = base @ frame_pose(vehicle, named, q)
    return stacked(list(pose.p), lead), stacked([list(row) for row in pose.R.rows], lead)


def frame_jacobian(
    vehicle: Vehicle, position: ArrayLike, quaternion_wxyz: ArrayLike, joints: ArrayLike, *, frame: str | None = None
) -> Array:
    """Return the Jacobian (..., 6, 6+n) of a frame: world velocity of its origin, then world angular velocity."""
    n = _joint_count(vehicle)
    components("position", position, 3)
    R, q = unit_rotation(quaternion_wxyz), components("joints", joints, n)
    lead = leading_axes(position, quaternion_wxyz, joints)
    named = vehicle.frame(frame)
    turning = R @ Mat3.cross(-frame_pose(vehicle, named, q).p)
    columns = jacobian_columns(vehicle, named, q)
    linear = [tuple(R.apply(column.linear)) for column in columns]
    angular = [tuple(R.apply(column.angular)) for column in columns]
    rows = [[*IDENTITY.R.rows[i], *turning.rows[i], *(c[i] for c in linear)] for i in range(3)]
    rows += [[0, 0, 0, *R.rows[i], *(c[i] for c in angular)] for i in range(3)]
    return stacked(rows, lead)


def _state(
    vehicle: Vehicle, position: ArrayLike, quaternion: ArrayLike, joints: ArrayLike, velocity: ArrayLike
) -> tuple[State, tuple[int, ...]]:
    """State as scalars, and the leading axes of its arrays."""
    n = _joint_count(vehicle)
    v = components("velocity", velocity, 6 + n)
    state = State(
        position=Vec3(*components("position", position, 3)),
        quaternion=unit_quaternion(quaternion),
        velocity=Vec3(*v[:3]),
        rate=Vec3(*v[3:6]),
        joints=components("joints", joints, n),
        joint_rates=v[6:],
    )
    return state, leading_axes(position, quaternion, joints, velocity)


def energy(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    velocity: ArrayLike,
    *,
    gravity: float = 9.81,
) -> Array:
    """Return kinetic plus potential energy (...), J."""
    state, lead = _state(vehicle, position, quaternion_wxyz, joints, velocity)
    g = one_number("gravity", gravity)
    total = add(dynamics.kinetic_energy(vehicle, state), dynamics.potential_energy(vehicle, state, g))
    return stacked(total, lead)


def center_of_mass(vehicle: Vehicle, position: ArrayLike, quaternion_wxyz: ArrayLike, joints: ArrayLike) -> Array:
    """Return the centre of mass in the world (..., 3), m."""
    still = np.zeros(6 + _joint_count(vehicle))
    state, lead = _state(vehicle, position, quaternion_wxyz, joints, still)
    return stacked(list(dynamics.center_of_mass(vehicle, state)), lead)


def momentum(
    vehicle: Vehicle, position: ArrayLike, quaternion_wxyz: ArrayLike, joints: ArrayLike, velocity: ArrayLike
) -> Array:
    """Return linear and angular momentum about the centre of mass (..., 6), world axes."""
    state, lead = _state(vehicle, position, quaternion_wxyz, joints, velocity)
    found = dynamics.momentum(vehicle, state)
    return stacked([*found.linear, *found.angular], lead)
