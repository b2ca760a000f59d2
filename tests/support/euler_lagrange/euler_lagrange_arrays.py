"""The NumPy front of the 8x8 form: configurations (..., 8) in, arrays out, leading axes
broadcast.

q = [x y z | phi theta psi | th1 th2] in m and rad, ZYX Euler angles; ``parameters`` is
Table 1 unless told otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from skyarm.algebra import Vec3
from skyarm.algebra.quaternion import euler_angles as euler_angles_of
from skyarm.dynamics.array_front import (
    Array,
    ArrayLike,
    components,
    leading_axes,
    one_number,
    stack_leaves,
    unit_quaternion,
)
from support.euler_lagrange import coriolis, gravity, mass, mass_derivative, transforms
from support.euler_lagrange.parameters import TABLE_1, PlanarArmParameters

PITCH_MARGIN = 1e-6
"""Distance to a pitch of 90 degrees, rad, below which Euler rates are refused."""


def mass_matrix(q: ArrayLike, *, parameters: PlanarArmParameters = TABLE_1) -> Array:
    """M(q), (..., 8, 8).

    Args:
        q: (..., 8).
        parameters: masses, lengths, inertias.

    Raises:
        ValueError: wrong shape.

    Source: Barakou, Tzafestas, Valavanis 2026, (51)-(66).
    """
    return stack_leaves(
        mass.mass_matrix(parameters, components("q", q, 8)), leading_axes(q)
    )


def mass_matrix_derivative(
    q: ArrayLike, *, parameters: PlanarArmParameters = TABLE_1
) -> Array:
    """dM_ij/dq_k as [..., k, i, j], (..., 8, 8, 8); arguments as :func:`mass_matrix`.

    Source: Barakou, Tzafestas, Valavanis 2026, Appendix C, completed for every block.
    """
    return stack_leaves(
        mass_derivative.mass_matrix_partials(parameters, components("q", q, 8)),
        leading_axes(q),
    )


def coriolis_matrix(
    q: ArrayLike, qd: ArrayLike, *, parameters: PlanarArmParameters = TABLE_1
) -> Array:
    """C(q, qd), (..., 8, 8), by Christoffel symbols of the analytic partials; ``qd`` is
    (..., 8).

    Source: Barakou, Tzafestas, Valavanis 2026, (67), (68).
    """
    lead = leading_axes(q, qd)
    return stack_leaves(
        coriolis.coriolis_matrix(
            parameters, components("q", q, 8), components("qd", qd, 8)
        ),
        lead,
    )


def coriolis_matrix_numeric(
    q: ArrayLike,
    qd: ArrayLike,
    *,
    parameters: PlanarArmParameters = TABLE_1,
    step: float = coriolis.STEP,
) -> Array:
    """C(q, qd), (..., 8, 8), by central differences of M (``step`` in rad), as
    published.

    Source: Barakou, Tzafestas, Valavanis 2026, Appendix C.
    """
    lead = leading_axes(q, qd)
    configuration, rates = components("q", q, 8), components("qd", qd, 8)
    return stack_leaves(
        coriolis.coriolis_central_differences(
            parameters, configuration, rates, step=step
        ),
        lead,
    )


def gravity_vector(
    q: ArrayLike,
    gravity: float = 9.81,
    reduced: bool = False,
    *,
    parameters: PlanarArmParameters = TABLE_1,
) -> Array:
    """G(q), (..., 8).

    Args:
        q: (..., 8).
        gravity: m/s^2 along world -z.
        reduced: only the joint entries, and those for a level base: what the paper adds
            where the base's weight is already in the commanded acceleration; the base
            entries are zero.
        parameters: masses, lengths.

    Raises:
        ValueError: wrong shape.

    Source: Barakou, Tzafestas, Valavanis 2026, (71)-(77); reduced (78), (79).
    """
    return stack_leaves(
        _gravity(
            parameters, components("q", q, 8), one_number("gravity", gravity), reduced
        ),
        leading_axes(q),
    )


def euler_angles(quaternion_wxyz: ArrayLike) -> Array:
    """Roll, pitch and yaw (..., 3), rad, of an attitude (..., 4).

    Raises:
        ValueError: wrong shape, not of unit length, or a pitch within 1e-6 rad of 90
            degrees.
    """
    angles = stack_leaves(
        list(euler_angles_of(unit_quaternion(quaternion_wxyz).rotation())),
        leading_axes(quaternion_wxyz),
    )
    refuse_singular_pitch(angles[..., 1])
    return angles


def body_torque(q: ArrayLike, euler_torque: ArrayLike) -> Array:
    """Torque in body axes (..., 3), N m, of the generalized torque (..., 3) dual to the
    Euler rates.

    Raises:
        ValueError: wrong shape, or a pitch within 1e-6 rad of 90 degrees.

    Source: Barakou, Tzafestas, Valavanis 2026, (94).
    """
    angles = _regular_angles(q)
    found = transforms.body_torque(
        angles, Vec3(*components("euler_torque", euler_torque, 3))
    )
    return stack_leaves(list(found), leading_axes(q, euler_torque))


def euler_acceleration(
    q: ArrayLike, qd: ArrayLike, angular_acceleration: ArrayLike
) -> Array:
    """Second derivative of the Euler angles (..., 3), rad/s^2, of a body angular
    acceleration (..., 3).

    Raises:
        ValueError: wrong shape, or a pitch within 1e-6 rad of 90 degrees.

    Source: Barakou, Tzafestas, Valavanis 2026, (95).
    """
    angles, rates = _regular_angles(q), components("qd", qd, 8)[3:6]
    alpha = Vec3(*components("angular_acceleration", angular_acceleration, 3))
    return stack_leaves(
        list(transforms.euler_acceleration(angles, rates, alpha)),
        leading_axes(q, qd, angular_acceleration),
    )


def refuse_singular_pitch(pitch: ArrayLike) -> None:
    """Raise ValueError if any pitch (rad) is within 1e-6 rad of +-90 degrees, where Q
    has no inverse.
    """
    worst = np.ravel(np.asarray(pitch, dtype=float))
    worst = worst[
        np.abs(transforms.singularity_measure(worst)) <= math.sin(PITCH_MARGIN)
    ]
    if worst.size:
        raise ValueError(
            f"pitch {math.degrees(float(worst[0])):.9g} deg: Euler angles are singular"
            f" within {PITCH_MARGIN:g} rad of 90 deg; use body coordinates"
        )


def _gravity(
    par: PlanarArmParameters, q: tuple[Any, ...], magnitude: float, reduced: bool
) -> list[Any]:
    if not reduced:
        return gravity.gravity_vector(par, q, magnitude)
    return [0] * 6 + list(gravity.reduced_joint_gravity(par, q[6:8], magnitude))


def _regular_angles(q: ArrayLike) -> tuple[Any, ...]:
    angles = components("q", q, 8)[3:6]
    refuse_singular_pitch(angles[1])
    return angles
