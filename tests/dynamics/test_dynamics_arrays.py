"""The NumPy front: leading axes, shapes, quaternions, and one description written as
structure or as data.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Mat3, Vec3
from skyarm.dynamics import array_front as arrays
from support.vehicles import random_quaternion, random_state, random_vehicle

BATCH = 5


@pytest.fixture
def rng():
    return np.random.default_rng(99)


def batch_of(rng, n, lead=(BATCH,)):
    quaternion = rng.normal(size=(*lead, 4))
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    position, joints = rng.normal(size=(*lead, 3)), rng.normal(size=(*lead, n))
    return (
        position,
        quaternion,
        joints,
        rng.normal(size=(*lead, 6 + n)),
        rng.normal(size=(*lead, 6 + n)),
    )


FUNCTIONS = {
    "inverse_dynamics": (arrays.inverse_dynamics, 5),
    "forward_dynamics": (arrays.forward_dynamics, 5),
    "mass_matrix": (arrays.mass_matrix, 3),
    "frame_jacobian": (arrays.frame_jacobian, 3),
    "frame_position": (lambda *a: arrays.frame_pose_world(*a)[0], 3),
    "frame_rotation": (lambda *a: arrays.frame_pose_world(*a)[1], 3),
    "energy": (arrays.energy, 4),
    "center_of_mass": (arrays.center_of_mass, 3),
    "momentum": (arrays.momentum, 4),
}


@pytest.fixture(params=sorted(FUNCTIONS))
def function(request):
    return FUNCTIONS[request.param]


@pytest.mark.parametrize("n", [0, 1, 3])
def test_a_batch_is_a_loop_of_singles(function, rng, n):
    call, count = function
    vehicle = random_vehicle(rng, n)
    inputs = batch_of(rng, n)[:count]
    together = call(vehicle, *inputs)
    singles = np.array(
        [call(vehicle, *(each[i] for each in inputs)) for i in range(BATCH)]
    )
    assert together.shape == singles.shape
    # NumPy's sine and the C library's may differ by one unit in the last place
    assert np.allclose(
        together, singles, rtol=0.0, atol=1e-13 * max(1.0, np.abs(singles).max())
    )


@pytest.mark.parametrize("n", [0, 2])
def test_leading_axes_broadcast_against_each_other(function, rng, n):
    call, count = function
    vehicle = random_vehicle(rng, n)
    full = batch_of(rng, n, (3, 4))[:count]
    thinned = [each[0, 0] if i % 2 else each[:, :1] for i, each in enumerate(full)]
    spread = [np.broadcast_to(each, (3, 1, each.shape[-1])) for each in thinned]
    found, wanted = call(vehicle, *thinned), call(vehicle, *spread)
    assert found.shape == wanted.shape
    assert found.shape[:2] == (3, 1)
    assert np.allclose(found, wanted, rtol=0.0, atol=1e-12)
    column = [full[0], *thinned[1:]]  # (3, 4) against (3, 1) and ()
    assert call(vehicle, *column).shape[:2] == (3, 4)


def test_an_empty_batch_gives_an_empty_batch(rng):
    vehicle = random_vehicle(rng, 2)
    assert arrays.forward_dynamics(vehicle, *batch_of(rng, 2, (0,))).shape == (0, 8)


def test_lists_and_integers_are_accepted(rng):
    vehicle = random_vehicle(rng, 2)
    a = arrays.inverse_dynamics(
        vehicle, [0, 0, 0], [1, 0, 0, 0], [0, 1], [0] * 8, [1] * 8
    )
    b = arrays.inverse_dynamics(
        vehicle,
        np.zeros(3),
        np.array([1.0, 0, 0, 0]),
        np.array([0.0, 1.0]),
        np.zeros(8),
        np.ones(8),
    )
    assert np.array_equal(a, b)
    assert a.dtype == np.float64


NAMES = ("position", "quaternion_wxyz", "joints", "velocity", "acceleration")


@pytest.mark.parametrize("argument", range(5))
@pytest.mark.parametrize("shape", ["short", "long", "scalar"])
def test_a_wrong_shape_raises_with_the_argument_and_the_shape_allowed(
    rng, argument, shape
):
    vehicle = random_vehicle(rng, 2)
    inputs = list(batch_of(rng, 2, ()))
    size = inputs[argument].size
    inputs[argument] = {
        "short": np.ones(size - 1),
        "long": np.ones((2, size + 1)),
        "scalar": np.float64(1.0),
    }[shape]
    for call in (arrays.inverse_dynamics, arrays.forward_dynamics):
        name = (
            "force"
            if argument == 4 and call is arrays.forward_dynamics
            else NAMES[argument]
        )
        with pytest.raises(
            ValueError, match=rf"^{name}: shape .*, allowed \(\.\.\., {size}\)"
        ):
            call(vehicle, *inputs)
    for call, count in FUNCTIONS.values():
        if argument < count <= 4:
            with pytest.raises(ValueError, match=f"^{NAMES[argument]}: shape"):
                call(vehicle, *inputs[:count])


def test_leading_axes_that_do_not_broadcast_raise(rng):
    vehicle = random_vehicle(rng, 1)
    inputs = list(batch_of(rng, 1, (3,)))
    inputs[0] = np.zeros((2, 3))
    with pytest.raises(ValueError, match="do not broadcast"):
        arrays.forward_dynamics(vehicle, *inputs)


def test_leading_axes_of_joint_arguments_that_do_not_broadcast_are_errors_by_name(rng):
    vehicle = random_vehicle(rng, 1)
    inputs = list(batch_of(rng, 1, (3,)))
    inputs[3] = np.zeros((2, 7))
    with pytest.raises(ValueError, match="do not broadcast"):
        arrays.forward_dynamics(vehicle, *inputs)


@pytest.mark.parametrize("length", [0.0, 1.0 - 2e-6, 1.0 + 2e-6, 2.0])
def test_a_quaternion_off_unit_length_raises(function, rng, length):
    call, count = function
    vehicle = random_vehicle(rng, 2)
    inputs = list(batch_of(rng, 2))[:count]
    inputs[1] = inputs[1].copy()
    inputs[1][2] *= length
    with pytest.raises(
        ValueError, match=r"quaternion_wxyz: length .*allowed 1 within 1e-06"
    ):
        call(vehicle, *inputs)


def test_the_length_reported_is_that_of_the_worst_quaternion(rng):
    vehicle, inputs = random_vehicle(rng, 1), list(batch_of(rng, 1))[:3]
    inputs[1] = inputs[1] * np.array([1.0, 0.9, 1.2, 1.01, 0.5])[:, None]
    with pytest.raises(ValueError, match=r"length 0\.5"):
        arrays.mass_matrix(vehicle, *inputs)


def test_a_quaternion_within_the_tolerance_is_normalised(function, rng):
    call, count = function
    vehicle, inputs = random_vehicle(rng, 2), list(batch_of(rng, 2, ()))[:count]
    exact = call(vehicle, *inputs)
    inputs[1] = inputs[1] * (1.0 + 9e-7)
    assert np.allclose(
        call(vehicle, *inputs),
        exact,
        rtol=0.0,
        atol=1e-12 * max(1.0, np.abs(exact).max()),
    )


def test_a_negated_quaternion_is_the_same_attitude(function, rng):
    call, count = function
    vehicle, inputs = random_vehicle(rng, 3), list(batch_of(rng, 3))[:count]
    plain = call(vehicle, *inputs)
    inputs[1] = -inputs[1]
    assert np.array_equal(call(vehicle, *inputs), plain)


@pytest.mark.parametrize(
    "quaternion", [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0.5**0.5, 0, 0.5**0.5, 0]]
)
def test_upside_down_and_nose_up_are_attitudes_like_any_other(rng, quaternion):
    vehicle, state = random_vehicle(rng, 2), random_state(rng, 2)
    force = rng.normal(size=8)
    at = (state.position, np.array(quaternion), state.joints, state.velocity)
    acceleration = arrays.forward_dynamics(vehicle, *at, force)
    assert np.allclose(
        arrays.inverse_dynamics(vehicle, *at, acceleration), force, rtol=0.0, atol=1e-9
    )


def test_gravity_is_accepted_and_ignored_by_the_mass_matrix(rng):
    vehicle, state = random_vehicle(rng, 2), random_state(rng, 2)
    M = arrays.mass_matrix(vehicle, *state.configuration, gravity=1.0)
    assert np.array_equal(M, arrays.mass_matrix(vehicle, *state.configuration))


def test_an_unknown_frame_is_refused_with_the_frames_there_are(rng):
    vehicle, state = random_vehicle(rng, 1), random_state(rng, 1)
    with pytest.raises(
        ValueError, match=r"no frame 'hand'; there are \['eye', 'tip0'\]"
    ):
        arrays.frame_jacobian(vehicle, *state.configuration, frame="hand")


def test_structure_and_data_give_the_same_dynamics():
    """Elementary axes as integers fold; the same numbers as floats are computed: same
    values.
    """
    rng = np.random.default_rng(4)
    for n in range(1, 6):
        vehicle, state = random_vehicle(rng, n), random_state(rng, n)
        links = []
        for link in vehicle.links:
            joint = dataclasses.replace(
                link.joint,
                axis=Vec3(*map(float, link.joint.axis)),
                position=Vec3(*map(float, link.joint.position)),
                rotation=Mat3(
                    *(Vec3(*map(float, row)) for row in link.joint.rotation.rows)
                ),
            )
            links.append(dataclasses.replace(link, joint=joint))
        data = dataclasses.replace(vehicle, links=tuple(links))
        force = rng.normal(size=6 + n)
        a = arrays.inverse_dynamics(vehicle, *state.all, force)
        b = arrays.inverse_dynamics(data, *state.all, force)
        # x + 0.0 and x * 1.0 are exact; only the order of what is left may move a last
        # bit
        assert np.allclose(a, b, rtol=0.0, atol=1e-13 * max(1.0, np.abs(a).max()))


def test_masses_may_be_lanes_of_a_batch(rng):
    vehicle, state = random_vehicle(rng, 2), random_state(rng, 2)
    masses = np.array([0.5, 1.0, 2.0])
    base = dataclasses.replace(vehicle.base, mass=masses)
    swept = dataclasses.replace(vehicle, base=base)
    # the lanes of a mass are leading axes like those of a state
    inputs = [
        np.broadcast_to(each, (3, each.size))
        for each in (*state.all, rng.normal(size=8))
    ]
    found = arrays.forward_dynamics(swept, *inputs)
    for i, mass in enumerate(masses.tolist()):
        alone = dataclasses.replace(
            vehicle, base=dataclasses.replace(vehicle.base, mass=mass)
        )
        single = arrays.forward_dynamics(alone, *(each[i] for each in inputs))
        assert np.allclose(
            found[i], single, rtol=0.0, atol=1e-12 * max(1.0, np.abs(single).max())
        )


def test_random_quaternions_are_unit(rng):
    assert np.linalg.norm(random_quaternion(rng)) == pytest.approx(1.0, rel=1e-15)
