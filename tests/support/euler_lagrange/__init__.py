"""The paper's own 8x8 form: quadrotor and planar two-joint arm in Euler angles,
equation by equation.

The names here are the NumPy front for Table 1. The same equations over any scalar, with
the parameters first, live in :mod:`.mass`, :mod:`.mass_derivative`, :mod:`.coriolis`,
:mod:`.gravity` and :mod:`.transforms`.
Source: Barakou, Tzafestas, Valavanis 2026.
"""

from support.euler_lagrange.euler_lagrange_arrays import (
    body_torque,
    coriolis_matrix,
    coriolis_matrix_numeric,
    euler_acceleration,
    euler_angles,
    gravity_vector,
    mass_matrix,
    mass_matrix_derivative,
    refuse_singular_pitch,
)
from support.euler_lagrange.parameters import (
    TABLE_1,
    PlanarArmParameters,
    parameters_of,
)

__all__ = [
    "TABLE_1",
    "PlanarArmParameters",
    "body_torque",
    "coriolis_matrix",
    "coriolis_matrix_numeric",
    "euler_acceleration",
    "euler_angles",
    "gravity_vector",
    "mass_matrix",
    "mass_matrix_derivative",
    "parameters_of",
    "refuse_singular_pitch",
]
