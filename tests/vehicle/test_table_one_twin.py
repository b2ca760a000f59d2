"""The paper's Table 1 and its physical twin: another distribution of inertia, the same
equations of motion.
"""

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Sym3
from skyarm.dynamics.array_front import forward_dynamics, mass_matrix
from skyarm.vehicle.vehicle_files import load_vehicle
from skyarm.vehicle.vehicle_records import require_plant

TABLE_1, TWIN = load_vehicle("hummingbird_arm2"), load_vehicle("hummingbird_arm2_twin")


def accelerations(vehicle):
    """Of 1000 random states under random forces, (1000, 8)."""
    rng = np.random.default_rng(3)
    q = rng.normal(size=(1000, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    joints, velocity = (
        rng.uniform(-np.pi, np.pi, (1000, 2)),
        3.0 * rng.normal(size=(1000, 8)),
    )
    force = rng.normal(size=(1000, 8)) * [5.0, 5.0, 5.0, 0.1, 0.1, 0.1, 0.1, 0.1]
    return forward_dynamics(vehicle, np.zeros((1000, 3)), q, joints, velocity, force)


def apart(a, b):
    """Largest difference over the states, as a share of each state's acceleration."""
    return float(np.max(np.linalg.norm(a - b, axis=1) / np.linalg.norm(a, axis=1)))


def test_the_twin_is_a_body_and_moves_as_table_one_does():
    require_plant(TWIN)
    assert apart(accelerations(TABLE_1), accelerations(TWIN)) < 1e-15


def test_a_share_of_the_inertia_that_is_not_moved_back_is_seen():
    for index, moments in (
        (1, Sym3(7.5e-5, 7.5e-5, 7.6e-5)),
        (0, Sym3(7.4e-5, 7.5e-5, 7.5e-5)),
    ):
        links = list(TWIN.links)
        links[index] = dataclasses.replace(
            links[index], body=dataclasses.replace(links[index].body, inertia=moments)
        )
        assert (
            apart(
                accelerations(TABLE_1),
                accelerations(dataclasses.replace(TWIN, links=tuple(links))),
            )
            > 1e-6
        )


def test_mass_matrices_agree_at_any_joint_values():
    rng = np.random.default_rng(4)
    q = rng.normal(size=(50, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    joints = rng.uniform(-np.pi, np.pi, (50, 2))
    ours, theirs = (
        mass_matrix(v, np.zeros((50, 3)), q, joints) for v in (TABLE_1, TWIN)
    )
    assert ours == pytest.approx(theirs, abs=1e-17)


def test_all_but_the_inertia_is_table_ones():
    assert TWIN.rotors == TABLE_1.rotors
    assert TWIN.frames == TABLE_1.frames
    assert [link.joint for link in TWIN.links] == [link.joint for link in TABLE_1.links]
    assert [(float(b.mass), tuple(b.com)) for b in TWIN.bodies] == [
        (float(b.mass), tuple(b.com)) for b in TABLE_1.bodies
    ]
