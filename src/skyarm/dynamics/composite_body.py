"""Mass matrix: the composite-rigid-body algorithm for a floating base.

Source: Walker, Orin 1982; Featherstone 2008, sections 6.2 and 9.4.
"""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra import Mat3, Scalar, Scalars, SpatialInertia
from skyarm.algebra.scalars import add
from skyarm.dynamics.kinematics import every_joint, onto_leaders
from skyarm.dynamics.link_axes import members, spatial_inertia
from skyarm.records.content import keep_results
from skyarm.vehicle import BASE, Vehicle


def mass_matrix(
    vehicle: Vehicle, R_WB: Mat3, joints: Sequence[Scalar]
) -> list[list[Scalar]]:
    """Mass matrix of the generalised velocity [v_W, w_B, joint rates], (6+n) x (6+n),
    rows as lists.

    Args:
        vehicle: the rigid bodies.
        R_WB: attitude; it turns the translation-rotation and translation-joint blocks
            into world axes.
        joints: rad or m.
    """
    if vehicle.followers:
        return _of_leaders(
            vehicle,
            mass_matrix(
                vehicle.with_free_followers, R_WB, every_joint(vehicle, joints)
            ),
        )
    bodies = members(vehicle, joints)
    places = [body.place for body in bodies]
    # the base is the last, where its index of -1 finds it
    composite = [*(body.inertia for body in bodies), spatial_inertia(vehicle.base)]
    # parents have smaller indices: a subtree is complete before it is carried inwards
    links = vehicle.links
    for i in reversed(range(vehicle.n)):
        composite[links[i].parent] += composite[i].into_parent(places[i].R, places[i].p)
    M = _base_block(composite[BASE], R_WB, 6 + vehicle.n)
    for i in range(vehicle.n):
        force = composite[i].apply(links[i].joint.motion_subspace)
        j = i
        while j != BASE:
            coupled = links[j].joint.motion_subspace.dot(force)
            M[6 + i][6 + j] = M[6 + j][6 + i] = coupled
            force = force.into_parent(places[j].R, places[j].p)
            j = links[j].parent
        # the armature turns against the parent only: it couples to no other coordinate
        M[6 + i][6 + i] = add(M[6 + i][6 + i], links[i].joint.armature)
        for row, value in enumerate((*R_WB.apply(force.force), *force.torque)):
            M[row][6 + i] = M[6 + i][row] = value
    return M


@keep_results(16)
def mass_matrix_at_rest(vehicle: Vehicle) -> tuple[Scalars, ...]:
    """Mass matrix (6+n rows of 6+n) of a level vehicle with all joints at zero, for
    which laws are made.
    """
    return tuple(map(tuple, mass_matrix(vehicle, Mat3.identity(), vehicle.zeros)))


def _of_leaders(vehicle: Vehicle, M: list[list[Scalar]]) -> list[list[Scalar]]:
    """Mass matrix G^T M G of the independent joints, from the mass matrix M of all
    joints.
    """
    rows = [[*row[:6], *onto_leaders(vehicle, row[6:])] for row in M]
    columns = [list(column) for column in zip(*rows, strict=True)]
    return [[*column[:6], *onto_leaders(vehicle, column[6:])] for column in columns]


def _base_block(whole: SpatialInertia, R_WB: Mat3, size: int) -> list[list[Scalar]]:
    """Mass matrix with only the 6 x 6 block of the base filled in; rows and columns of
    the joints are zero.
    """
    # velocities of the base are in world axes and its rates in its own
    coupling = R_WB @ Mat3.cross(-whole.moment)
    m = whole.mass
    rest = [0] * (size - 6)
    rotational = whole.inertia.full().rows
    return [
        *(
            [*(m if i == j else 0 for j in range(3)), *coupling.rows[i], *rest]
            for i in range(3)
        ),
        *([*coupling.column(i), *rotational[i], *rest] for i in range(3)),
        *([0] * size for _ in rest),
    ]
