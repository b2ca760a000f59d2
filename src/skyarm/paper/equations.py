"""Equations of motion of Barakou et al. 2026, M(q) qdd + C(q, qd) qd + G(q) = tau, in
Euler coordinates.

q = [x y z | phi theta psi | joints] in m and rad (a joint that slides: m): the base
origin in the world, ZYX Euler angles of R = Rz(psi) Ry(theta) Rx(phi), joints in the
vehicle's order. World z up, body x forward, y left. Leading axes broadcast. Rigid
bodies and the inertia of the joints' drives only: no rotors, friction or stops.

At a pitch of 90 degrees roll and yaw turn about one axis: M, C and G exist there, M has
no inverse and an attitude no unique q. The body coordinates of
:func:`skyarm.mass_matrix` have no such place.

Source: Barakou, Tzafestas, Valavanis 2026, sections 2 and 3, Appendices B and C.
"""

from __future__ import annotations

from skyarm.algebra import Scalars, Vec3
from skyarm.dynamics import euler_coordinates
from skyarm.dynamics.array_front import (
    ArrayLike,
    components,
    leading_axes,
    one_number,
    stack_leaves,
)
from skyarm.dynamics.kinematics import Pose, frame_pose, link_poses
from skyarm.records.arrays import Array
from skyarm.vehicle import Vehicle
from skyarm.vehicle.check import refuse


def mass_matrix(vehicle: Vehicle, q: ArrayLike) -> Array:
    """Mass matrix M(q), (..., 6+n, 6+n): kinetic energy is 1/2 qd^T M qd.

    Args:
        vehicle: any vehicle, arms of any tree; the rotors' tilt angles are no
            coordinates of q.
        q: (..., 6+n).

    Raises:
        ValueError: no Vehicle, a wrong shape, or numbers that are not finite; the
            message names the argument.

    Source: Barakou, Tzafestas, Valavanis 2026, (50)-(66), Appendix B.
    """
    return stack_leaves(
        euler_coordinates.mass_matrix(vehicle, _coordinates(vehicle, q=q)[0]),
        leading_axes(q),
    )


def coriolis_matrix(vehicle: Vehicle, q: ArrayLike, qd: ArrayLike) -> Array:
    """Coriolis matrix C(q, qd), (..., 6+n, 6+n), by Christoffel's symbols of M: dM/dt -
    2 C is skew.

    The derivatives of M are exact to rounding; the paper takes central differences.
    Arguments and errors as of :func:`mass_matrix`; ``qd`` is (..., 6+n), the time
    derivative of q.

    Source: Barakou, Tzafestas, Valavanis 2026, (67)-(70), Appendix C.
    """
    at, rates = _coordinates(vehicle, q=q, qd=qd)
    lead = leading_axes(q, qd)
    return stack_leaves(euler_coordinates.coriolis_matrix(vehicle, at, rates), lead)


def gravity_vector(vehicle: Vehicle, q: ArrayLike, *, gravity: float = 9.81) -> Array:
    """Gravity vector G(q) = dU/dq, (..., 6+n), N and N m; ``gravity`` in m/s^2 along
    world -z.

    Equal to M(q) [0 0 g 0 ...]: a law that adds g to the desired acceleration has
    counted it. Arguments and errors as of :func:`mass_matrix`.

    Source: Barakou, Tzafestas, Valavanis 2026, (71)-(77).
    """
    g = one_number("gravity", gravity)
    return stack_leaves(
        euler_coordinates.gravity_vector(vehicle, _coordinates(vehicle, q=q)[0], g),
        leading_axes(q),
    )


def forward_kinematics(vehicle: Vehicle, q: ArrayLike) -> dict[str, Array]:
    """Homogeneous transforms (..., 4, 4) to the world from every frame, by name: base,
    links, the vehicle's frames.

    A link's frame is at its joint and turns with it. A frame that has the name of a
    link stands as ``frame NAME``. Arguments and errors as of :func:`mass_matrix`.

    Source: Barakou, Tzafestas, Valavanis 2026, (5)-(10), (19)-(22).
    """
    (at,), lead = _coordinates(vehicle, q=q), leading_axes(q)
    base = Pose(euler_coordinates.attitude(at), Vec3(*at[:3]))
    links = [link.name for link in vehicle.moving]
    poses = {"base": base} | dict(
        zip(links, (base @ each for each in link_poses(vehicle, at[6:])), strict=True)
    )
    for frame in vehicle.frames:
        # links come first: a frame of the same name would hide one
        name = f"frame {frame.name}" if frame.name in poses else frame.name
        poses[name] = base @ frame_pose(vehicle, frame, at[6:])
    return {
        name: stack_leaves(
            [
                *([*row, p] for row, p in zip(pose.R.rows, pose.p, strict=True)),
                [0, 0, 0, 1],
            ],
            lead,
        )
        for name, pose in poses.items()
    }


def _coordinates(vehicle: Vehicle, **rows: ArrayLike) -> list[Scalars]:
    """Vectors of 6+n scalars from the NumPy arguments."""
    if not isinstance(vehicle, Vehicle):
        refuse("vehicle", vehicle, "must be a Vehicle")
    return [components(name, row, 6 + vehicle.n) for name, row in rows.items()]
