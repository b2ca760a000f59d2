"""NumPy interface of the rigid-body dynamics: arrays in, arrays out, leading axes
broadcast.

Generalised velocity is [v_W, w_B, joint rates]: velocity of the base *origin* in world
axes, angular velocity in base axes, joint rates. ``acceleration`` is its plain time
derivative; ``force`` is its dual: world force at, and base-axes torque about, the base
origin, then joint torques. Rigid body only: no rotors, damping or friction.
"""

from __future__ import annotations

import numbers
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from skyarm import dynamics
from skyarm.algebra import Force, Mat3, Quaternion, Scalar, Scalars, Vec3
from skyarm.algebra.scalars import add
from skyarm.dynamics.kinematics import IDENTITY, Pose, frame_pose, jacobian_columns
from skyarm.dynamics.state import State, coordinate_acceleration, proper_acceleration
from skyarm.records.arrays import Array, doubles
from skyarm.records.files import shown
from skyarm.records.leaves import is_record
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import refuse


def _read(
    in_law: str,
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    **rows: ArrayLike,
) -> tuple[State, dict[str, Scalars], tuple[int, ...]]:
    """Convert NumPy arguments to a vehicle state and vectors of 6+n scalars; the
    default velocity is zero.

    ``in_law`` names the function of :mod:`skyarm.dynamics` for the scalars and records
    of a control law.
    """
    if not isinstance(vehicle, Vehicle):
        refuse("vehicle", vehicle, "must be a Vehicle")
    n = vehicle.n
    try:
        vectors = {name: components(name, row, 6 + n) for name, row in rows.items()}
        v = vectors.get("velocity", (0.0,) * (6 + n))
        state = State(
            position=Vec3(*components("position", position, 3)),
            quaternion=unit_quaternion(quaternion_wxyz),
            velocity=Vec3(*v[:3]),
            rate=Vec3(*v[3:6]),
            joints=components("joints", joints, n),
            joint_rates=v[6:],
        )
    except ValueError as error:
        # symbols fail as numbers: only then is the other function named
        if any(map(_of_a_law, (position, quaternion_wxyz, joints, *rows.values()))):
            raise ValueError(
                f"{error}, as an array; a law calls skyarm.dynamics.{in_law}"
            ) from error
        raise
    return (
        state,
        vectors,
        leading_axes(position, quaternion_wxyz, joints, *rows.values()),
    )


def _of_a_law(value: object) -> bool:
    """True for a record that is no vector, as a Motion, and for values with symbols of
    a trace.
    """
    if isinstance(value, (np.ndarray, str)):
        return False
    if is_record(value) and not isinstance(value, Iterable):
        return True
    if isinstance(value, (list, tuple)) or is_record(value):
        return any(map(_of_a_law, value))  # type: ignore[call-overload]
    # symbols switch NumPy's operators off by None; other types have none or a method
    return getattr(type(value), "__array_ufunc__", 0) is None


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
    """Generalised force (..., 6+n) that gives an acceleration at a state: M a + C v +
    G.

    Args:
        vehicle: the rigid bodies.
        position: (..., 3) base origin in the world, m; rigid-body forces do not depend
            on it.
        quaternion_wxyz: (..., 4) base to world, unit to 1e-6.
        joints: (..., n) rad or m.
        velocity: (..., 6+n), of which forces use the rates only.
        acceleration: (..., 6+n) plain time derivative of ``velocity``.
        gravity: m/s^2 along world -z.

    Raises:
        ValueError: no Vehicle, a wrong shape, numbers that are not finite, or a
            quaternion off unit length by more than 1e-6. As everywhere in this module,
            the message names the argument.
    """
    at, rows, lead = _read(
        "inverse_dynamics",
        vehicle,
        position,
        quaternion_wxyz,
        joints,
        velocity=velocity,
        acceleration=acceleration,
    )
    R = at.quaternion.rotation()
    a = rows["acceleration"]
    base = proper_acceleration(
        R, Vec3(*a[:3]), Vec3(*a[3:6]), one_number("gravity", gravity)
    )
    force, torques = dynamics.inverse_dynamics(
        vehicle, at.joints, at.rate, at.joint_rates, base, a[6:]
    )
    return stack_leaves([*R.apply(force.force), *force.torque, *torques], lead)


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
    """Acceleration (..., 6+n) under a generalised force (..., 6+n)."""
    at, rows, lead = _read(
        "forward_dynamics",
        vehicle,
        position,
        quaternion_wxyz,
        joints,
        velocity=velocity,
        force=force,
    )
    R = at.quaternion.rotation()
    f = rows["force"]
    applied = Force(Vec3(*f[3:6]), R.apply_T(Vec3(*f[:3])))
    base, qdd = dynamics.forward_dynamics(
        vehicle, at.joints, at.rate, at.joint_rates, applied, f[6:]
    )
    linear, angular = coordinate_acceleration(R, base, one_number("gravity", gravity))
    return stack_leaves([*linear, *angular, *qdd], lead)


def mass_matrix(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    *,
    gravity: float = 9.81,
) -> Array:
    """Mass matrix (..., 6+n, 6+n) of the generalised velocity; it does not depend on
    ``gravity``.
    """
    # checked though unused, so that all functions refuse the same arguments
    one_number("gravity", gravity)
    at, _, lead = _read("mass_matrix", vehicle, position, quaternion_wxyz, joints)
    return stack_leaves(
        dynamics.mass_matrix(vehicle, at.quaternion.rotation(), at.joints), lead
    )


def frame_pose_world(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    *,
    frame: str | None = None,
) -> tuple[Array, Array]:
    """World position (..., 3) and rotation matrix R_WF (..., 3, 3) of a frame, the tip
    by default.
    """
    at, _, lead = _read("frame_pose", vehicle, position, quaternion_wxyz, joints)
    pose = Pose(at.quaternion.rotation(), at.position) @ frame_pose(
        vehicle, vehicle.frame(frame), at.joints
    )
    return stack_leaves(list(pose.p), lead), stack_leaves(
        [list(row) for row in pose.R.rows], lead
    )


def frame_jacobian(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    *,
    frame: str | None = None,
) -> Array:
    """Jacobian (..., 6, 6+n) of a frame: world velocity of its origin, then world
    angular velocity.
    """
    at, _, lead = _read(
        "kinematics.jacobian_columns", vehicle, position, quaternion_wxyz, joints
    )
    R = at.quaternion.rotation()
    named = vehicle.frame(frame)
    # w x r as a matrix of w: velocity of the frame by the turning of the base
    turning = R @ Mat3.cross(-frame_pose(vehicle, named, at.joints).p)
    columns = jacobian_columns(vehicle, named, at.joints)
    linear = [tuple(R.apply(column.linear)) for column in columns]
    angular = [tuple(R.apply(column.angular)) for column in columns]
    rows = [
        [*IDENTITY.R.rows[i], *turning.rows[i], *(c[i] for c in linear)]
        for i in range(3)
    ]
    rows += [[0, 0, 0, *R.rows[i], *(c[i] for c in angular)] for i in range(3)]
    return stack_leaves(rows, lead)


def energy(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    velocity: ArrayLike,
    *,
    gravity: float = 9.81,
) -> Array:
    """Kinetic plus potential energy (...), J."""
    # dynamics has both parts of the energy, not their sum
    state, _, lead = _read(
        "kinetic_energy", vehicle, position, quaternion_wxyz, joints, velocity=velocity
    )
    g = one_number("gravity", gravity)
    total = add(
        dynamics.kinetic_energy(vehicle, state),
        dynamics.potential_energy(vehicle, state, g),
    )
    return stack_leaves(total, lead)


def center_of_mass(
    vehicle: Vehicle, position: ArrayLike, quaternion_wxyz: ArrayLike, joints: ArrayLike
) -> Array:
    """Centre of mass in the world (..., 3), m."""
    state, _, lead = _read("center_of_mass", vehicle, position, quaternion_wxyz, joints)
    return stack_leaves(list(dynamics.center_of_mass(vehicle, state)), lead)


def momentum(
    vehicle: Vehicle,
    position: ArrayLike,
    quaternion_wxyz: ArrayLike,
    joints: ArrayLike,
    velocity: ArrayLike,
) -> Array:
    """Linear and angular momentum about the centre of mass (..., 6), world axes."""
    state, _, lead = _read(
        "momentum", vehicle, position, quaternion_wxyz, joints, velocity=velocity
    )
    total = dynamics.momentum(vehicle, state)
    return stack_leaves([*total.linear, *total.angular], lead)


ArrayLike = npt.ArrayLike

QUATERNION_TOLERANCE = 1e-6
"""Largest deviation of a quaternion's length from 1: six printed digits."""


def components(name: str, value: ArrayLike, size: int) -> Scalars:
    """Split the last axis of an array into scalars: floats for one state, arrays for
    many.

    Raises:
        ValueError: numbers that are not finite, or a last axis without ``size``
            entries; the message names ``name``.
    """
    array = finite_numbers(name, value)
    if array.ndim == 0 or array.shape[-1] != size:
        raise ValueError(f"{name}: shape {array.shape}, allowed (..., {size})")
    if array.ndim == 1:
        # Python's floats, since scalars of NumPy are slower
        return tuple(array.tolist())
    return tuple(array[..., i] for i in range(size))


def finite_numbers(
    name: str, value: ArrayLike | Scalar, allowed: str = "finite numbers"
) -> Array:
    """Convert an argument to an array of floats; refuse text, booleans, complex and
    non-finite numbers.

    Raises:
        ValueError: names ``name`` and the given value.
    """
    try:
        array = np.asarray(value)
        # fractions are real numbers, but objects to NumPy
        if array.dtype.kind == "O" and all(
            isinstance(each, numbers.Real) for each in array.flat
        ):
            array = array.astype(float)
    except (TypeError, ValueError, OverflowError) as error:
        # ragged rows; values of a trace
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}") from error
    if (
        array.dtype.kind not in "fiu"
        or not np.isfinite(array := array.astype(float, copy=False)).all()
    ):
        raise ValueError(f"{name} = {shown(value)}: must be {allowed}")
    return array


def one_number(name: str, value: Scalar) -> float:
    """Convert an argument such as gravity to a float; refuse anything but one finite
    number.

    Raises:
        ValueError: anything else.
    """
    array = finite_numbers(name, value, "one finite number")
    if array.ndim:
        raise ValueError(f"{name} = {shown(value)}: must be one finite number")
    return float(array.item())


def unit_quaternion(quaternion_wxyz: ArrayLike) -> Quaternion:
    """Read quaternions (..., 4), base to world; refuse those that are not of unit
    length.

    Raises:
        ValueError: wrong shape, or further off unit length.
    """
    array = finite_numbers("quaternion_wxyz", quaternion_wxyz)
    wxyz = components("quaternion_wxyz", array, 4)
    length = np.linalg.norm(array, axis=-1)
    if not np.all(np.abs(length - 1.0) <= QUATERNION_TOLERANCE):
        worst = float(np.ravel(length)[np.argmax(np.abs(np.ravel(length) - 1.0))])
        raise ValueError(
            f"quaternion_wxyz: length {worst:.9g}, allowed 1 within"
            f" {QUATERNION_TOLERANCE:g}"
        )
    # normalised, or the printed digits would scale the rotation matrix
    return Quaternion(*wxyz).normalized()


Nested: TypeAlias = "Scalar | Sequence[Nested]"


def stack_leaves(values: Nested, lead: tuple[int, ...]) -> Array:
    """Stack nested lists of scalars into one array with the leading axes first."""
    if isinstance(values, (list, tuple)):
        parts = [stack_leaves(value, lead) for value in values]
        # np.stack refuses an empty list, as the joints of a bare airframe
        return np.stack(parts, axis=len(lead)) if parts else np.zeros((*lead, 0))
    return np.broadcast_to(doubles(values), lead)


def leading_axes(*arrays: ArrayLike) -> tuple[int, ...]:
    """Broadcast shape of the arguments without their last axes.

    Raises:
        ValueError: they do not broadcast; the message lists them.
    """
    shapes = [doubles(a).shape[:-1] for a in arrays]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise ValueError(f"leading axes {shapes} do not broadcast") from error
