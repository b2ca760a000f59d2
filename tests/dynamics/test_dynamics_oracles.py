"""Every quantity of the rigid-body dynamics against Pinocchio and MuJoCo on random
trees of joints.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.dynamics import array_front as arrays
from support.vehicles import TWINS, random_state, random_vehicle, with_armature

# relative to the largest entry: three recursions of up to seven joints, in other
# orders, on three sets of axes
TOLERANCE = 1e-10
CASES = [
    pytest.param(
        (n, seed), marks=() if seed < 2 else pytest.mark.thorough, id=f"{n}joints{seed}"
    )
    for n in range(8)
    for seed in range(4)
]
"""Number of joints and seed: of each number a vehicle without reflected inertia and one
with it, twice as many in ``make thorough``."""


def close(ours, theirs, scale=0.0):
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape
    size = max(1.0, float(np.abs(theirs).max(initial=0.0)), scale)
    assert float(np.abs(ours - theirs).max(initial=0.0)) <= TOLERANCE * size


@pytest.fixture(params=sorted(TWINS))
def twin_of(request):
    pytest.importorskip(request.param)
    return TWINS[request.param]


@pytest.fixture(params=CASES)
def case(request):
    n, seed = request.param
    rng = np.random.default_rng([2024, n, seed])
    vehicle = random_vehicle(rng, n)
    return (with_armature(vehicle, rng) if seed % 2 else vehicle), rng


def test_inverse_dynamics_is_that_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin = twin_of(vehicle)
    for _ in range(3):
        state, acceleration = (
            random_state(rng, vehicle.n),
            5.0 * rng.normal(size=6 + vehicle.n),
        )
        close(
            arrays.inverse_dynamics(vehicle, *state.all, acceleration),
            twin.inverse_dynamics(state, acceleration),
        )


def test_bias_and_gravity_are_those_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin, state = twin_of(vehicle), random_state(rng, vehicle.n)
    zero = np.zeros(6 + vehicle.n)
    for gravity in (0.0, 3.71, -2.0):
        bias = arrays.inverse_dynamics(vehicle, *state.all, zero, gravity=gravity)
        close(bias, twin.inverse_dynamics(state, zero, gravity))


def test_forward_dynamics_is_that_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin = twin_of(vehicle)
    for gravity in (9.81, 0.0, 3.71):
        state, force = (
            random_state(rng, vehicle.n),
            5.0 * rng.normal(size=6 + vehicle.n),
        )
        theirs = twin.forward_dynamics(state, force, gravity)
        # a solution is known to the rounding of the force times the condition of M
        condition = np.linalg.cond(twin.mass_matrix(state))
        close(
            arrays.forward_dynamics(vehicle, *state.all, force, gravity=gravity),
            theirs,
            scale=1e-4 * condition,
        )


def test_mass_matrix_is_that_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin, state = twin_of(vehicle), random_state(rng, vehicle.n)
    close(arrays.mass_matrix(vehicle, *state.configuration), twin.mass_matrix(state))


def test_energy_is_that_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin, state = twin_of(vehicle), random_state(rng, vehicle.n)
    for gravity in (9.81, 1.62):
        close(
            arrays.energy(vehicle, *state.all, gravity=gravity),
            twin.energy(state, gravity),
        )


def test_centre_of_mass_and_momentum_are_those_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin, state = twin_of(vehicle), random_state(rng, vehicle.n)
    close(
        arrays.center_of_mass(vehicle, *state.configuration), twin.center_of_mass(state)
    )
    close(arrays.momentum(vehicle, *state.all), twin.momentum(state))


def test_poses_and_jacobians_of_every_frame_are_those_of_the_oracle(case, twin_of):
    vehicle, rng = case
    twin, state = twin_of(vehicle), random_state(rng, vehicle.n)
    for frame in vehicle.frames:
        position, rotation, jacobian = twin.frame(state, frame.name)
        p_WF, R_WF = arrays.frame_pose_world(
            vehicle, *state.configuration, frame=frame.name
        )
        close(p_WF, position)
        close(R_WF, rotation)
        close(
            arrays.frame_jacobian(vehicle, *state.configuration, frame=frame.name),
            jacobian,
        )
    last = arrays.frame_jacobian(vehicle, *state.configuration)
    close(
        last,
        arrays.frame_jacobian(
            vehicle, *state.configuration, frame=vehicle.end_effector
        ),
    )
