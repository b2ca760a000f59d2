"""The parameters of a planar arm that names no end effector: it ends at its second
centre of mass.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from lagrangian_twin import states, velocity_jacobians
from planar_vehicles import planar_vehicle, quaternion_wxyz

from skyarm.algebra import Vec3
from skyarm.dynamics import array_front as arrays
from support import euler_lagrange as el

Q, _ = states(5, seed=9)


def test_an_arm_without_a_tip_has_the_mass_matrix_of_its_tree():
    whole = planar_vehicle(0.0)
    last = dataclasses.replace(whole.links[1].body, com=Vec3(0, 0, -0.06))
    links = (whole.links[0], dataclasses.replace(whole.links[1], body=last))
    vehicle = dataclasses.replace(whole, links=links, frames=(), end_effector="")
    par = el.parameters_of(vehicle)
    assert (par.me, par.m2) == (0, whole.links[1].body.mass)
    assert (par.L1, par.L2, par.lc1, par.lc2) == pytest.approx(
        (0.15, 0.06, 0.075, 0.06), abs=1e-16
    )
    for q in Q:
        T = np.eye(8)
        T[3:6, 3:6] = velocity_jacobians(q)[1][:, 3:6]
        M = T.T @ arrays.mass_matrix(vehicle, q[:3], quaternion_wxyz(q), q[6:]) @ T
        np.testing.assert_allclose(el.mass_matrix(q, parameters=par), M, atol=1e-15)
