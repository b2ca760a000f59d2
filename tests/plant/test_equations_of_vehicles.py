"""Mass matrix and accelerations of shipped vehicles are MuJoCo's at random states."""

from __future__ import annotations

import numpy as np
import pytest

import skyarm
from skyarm.dynamics.array_front import forward_dynamics, mass_matrix
from skyarm.vehicle.vehicle_files import list_vehicles
from support.cases import sampled
from support.mujoco_plants import Equations

STATES, GRAVITY = 50, 9.81
BODIES = [name for name in list_vehicles() if not skyarm.load_vehicle(name).planar]


@pytest.mark.parametrize("name", sampled(BODIES, 4))
def test_both_engines_agree(name: str) -> None:
    vehicle, rng = skyarm.load_vehicle(name), np.random.default_rng(0)
    theirs, n = Equations(vehicle, GRAVITY), vehicle.n
    at, q = rng.normal(size=(STATES, 3)), rng.normal(size=(STATES, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    joints, velocity = (
        rng.uniform(-1.5, 1.5, (STATES, n)),
        rng.normal(size=(STATES, 6 + n)),
    )
    weight = float(vehicle.mass) * GRAVITY
    force = rng.normal(size=(STATES, 6 + n)) * np.array(
        [weight] * 3 + [0.1 * weight] * 3 + [0.02 * weight] * n
    )
    M = mass_matrix(vehicle, at, q, joints)
    a = forward_dynamics(vehicle, at, q, joints, velocity, force, gravity=GRAVITY)
    for k in range(STATES):
        M_k, a_k = theirs.at(at[k], q[k], joints[k], velocity[k], force[k])
        assert np.abs(M[k] - M_k).max() < 1e-8 * np.abs(M_k).max()
        assert np.linalg.norm(a[k] - a_k) < 1e-8 * np.linalg.norm(a_k)
