"""How fast friction makes the joints, which bounds the integration step of both plants.

The mass matrix is our own, for MuJoCo's plant too: its numbers choose how long a step is, no force comes from them.
"""

from __future__ import annotations

import math

import numpy as np

from skyarm.algebra import Mat3
from skyarm.dynamics import mass_matrix
from skyarm.vehicle.check import VehicleError, concrete
from skyarm.vehicle.records import Vehicle

SAMPLES = 64
"""Arm configurations that are looked at; the effective inertia of a joint changes with the others' angles."""


FASTEST = 1e4
"""1/s. A faster friction would need over 80 integration steps per control period of 5 ms."""


def friction_rate(vehicle: Vehicle) -> float:
    """Largest decay rate (1/s) that joint friction causes: the largest eigenvalue of (M^-1)_joints D.

    D holds damping plus the slope of the smooth Coulomb law at rest, its steepest place. Zero without friction, or
    where the numbers are not concrete.

    Raises:
        VehicleError: friction so stiff that no explicit integrator can afford it.
    """
    joints = [link.joint for link in vehicle.links]
    numbers = [value for joint in joints for value in (joint.damping, joint.coulomb, joint.coulomb_rate)]
    if not joints or not concrete(*numbers):
        return 0.0
    D = np.array([float(j.damping) + float(j.coulomb) / float(j.coulomb_rate) for j in joints])
    if not D.any():
        return 0.0
    rng = np.random.default_rng(0)
    fastest = 0.0
    for joints_now in [np.zeros(vehicle.n), *rng.uniform(-math.pi, math.pi, (SAMPLES, vehicle.n))]:
        M = np.array(mass_matrix(vehicle, Mat3.identity(), tuple(joints_now.tolist())), dtype=float)
        inverse = np.linalg.inv(M)[6:, 6:]
        # similar to inverse @ D, but symmetric
        root = np.sqrt(D)
        fastest = max(fastest, float(np.linalg.eigvalsh(root[:, None] * inverse * root[None, :])[-1]))
    if fastest > FASTEST:
        raise VehicleError(
            f"vehicle '{vehicle.name}': joint friction decays at {fastest:.3g} 1/s: must be below {FASTEST:g}; "
            "raise coulomb_rate, or lower damping or coulomb"
        )
    return fastest
