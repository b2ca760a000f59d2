"""Small vector algebra over any scalar type: Vec3, Mat3, Sym3, Quaternion and spatial
vectors and inertias.
"""

from skyarm.algebra.linear_solve import ldl_solve
from skyarm.algebra.matrix import Mat3, Sym3, axis_rotation
from skyarm.algebra.quaternion import Quaternion
from skyarm.algebra.scalars import Scalar, Scalars
from skyarm.algebra.spatial import (
    ArticulatedInertia,
    Force,
    Motion,
    SpatialInertia,
    centripetal,
)
from skyarm.algebra.vector import (
    E_X,
    E_Y,
    E_Z,
    ZERO3,
    ZERO3_DATA,
    Vec3,
    differences,
    inner_product,
    sums,
)

__all__ = [
    "E_X",
    "E_Y",
    "E_Z",
    "ZERO3",
    "ZERO3_DATA",
    "ArticulatedInertia",
    "Force",
    "Mat3",
    "Motion",
    "Quaternion",
    "Scalar",
    "Scalars",
    "SpatialInertia",
    "Sym3",
    "Vec3",
    "axis_rotation",
    "centripetal",
    "differences",
    "inner_product",
    "ldl_solve",
    "sums",
]
