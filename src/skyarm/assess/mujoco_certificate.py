"""The agreement certificate: this vehicle's equations of motion beside MuJoCo's at random states."""

from __future__ import annotations

import numpy as np

from skyarm.assess.finding import FAULT, NOTE, OK, Finding
from skyarm.dynamics.array_front import forward_dynamics, mass_matrix
from skyarm.vehicle.vehicle_records import Vehicle

STATES = 200

TOLERANCE = 1e-8
"""Of the difference over the size: rounding of an ill-conditioned arm leaves 1e-10."""


def certificate(vehicle: Vehicle, gravity: float, seed: int = 0, states: int = STATES) -> list[Finding]:
    """Worst difference of mass matrix and acceleration from MuJoCo's over random states, as shares of their size."""
    question = "agreement with MuJoCo"
    if vehicle.planar:
        text = "not possible: no real body has the inertia of a planar link, and MuJoCo refuses it"
        return [Finding(question=question, level=NOTE, text=text, field="links.planar")]
    try:
        from skyarm.plant.mujoco_equations import Equations
    except ImportError as error:
        text = f"not done: MuJoCo cannot be loaded ({error}); python -m pip install mujoco-core"
        return [Finding(question=question, level=NOTE, text=text)]
    try:
        theirs = Equations(vehicle, gravity)
    except ValueError as error:
        text = f"not possible: MuJoCo refuses the vehicle ({error})"
        return [Finding(question=question, level=NOTE, text=text)]
    n, rng = vehicle.n, np.random.default_rng(seed)
    at, q = rng.normal(size=(states, 3)), rng.normal(size=(states, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    joints, velocity = rng.uniform(-1.5, 1.5, (states, n)), rng.normal(size=(states, 6 + n))
    weight = float(vehicle.mass) * gravity
    force = rng.normal(size=(states, 6 + n)) * np.array([weight] * 3 + [0.1 * weight] * 3 + [0.02 * weight] * n)
    M = mass_matrix(vehicle, at, q, joints)
    a = forward_dynamics(vehicle, at, q, joints, velocity, force, gravity=gravity)
    matrix = acceleration = 0.0
    for k in range(states):
        M_k, a_k = theirs.at(at[k], q[k], joints[k], velocity[k], force[k])
        matrix = max(matrix, float(np.abs(M[k] - M_k).max() / np.abs(M_k).max()))
        acceleration = max(acceleration, float(np.linalg.norm(a[k] - a_k) / np.linalg.norm(a_k)))
    worst = max(matrix, acceleration)
    level = OK if worst < TOLERANCE else FAULT
    text = f"mass matrix within {matrix:.1e}, accelerations within {acceleration:.1e} at {states} random states"
    remedy = "" if level == OK else "report it with this vehicle's file: both engines must agree"
    return [Finding(question=question, level=level, text=text, value=worst, limit=TOLERANCE, remedy=remedy, field="")]
