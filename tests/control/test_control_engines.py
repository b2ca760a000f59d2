"""One source, every engine: NumPy lanes, JAX, CasADi and traced programs give what
floats give.
"""

import dataclasses

import numpy as np
import pytest

from skyarm.algebra import Quaternion, Vec3
from skyarm.compile import trace
from skyarm.control.catalogue import make_controller
from skyarm.control.model import GeometricGains, JointGains, Model, Parameters
from skyarm.records.leaves import leaves, rebuild
from support.engines import jax_doubles
from support.laws import (
    ARM2,
    LAWS,
    MODEL,
    G,
    cases,
    changed,
    controller,
    hovering,
    raw_squares,
    stacked,
    step,
    unclipped,
)

CASES = cases(6, seed=31)
INPUTS = [(case.measurement(), case.reference()) for case in CASES]


def floats(flown, inputs=INPUTS):
    return np.array([leaves(step(flown, *pair)) for pair in inputs])


def close(found, expected):
    """Engines differ by last digits of sin and cos; a speed near the clip is the root
    of a small difference.
    """
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_numpy_lanes_equal_a_loop(name):
    flown = controller(name)
    batch = step(
        flown, stacked([m for m, _ in INPUTS]), stacked([r for _, r in INPUTS])
    )
    found = np.stack(
        [np.broadcast_to(leaf, (len(INPUTS),)) for leaf in leaves(batch)], axis=1
    )
    close(found, floats(flown))


@pytest.mark.parametrize("name", LAWS)
def test_degenerate_lanes_do_not_disturb_their_neighbours(name):
    falling = changed(hovering(), a_d=(0.0, 0.0, -G))
    inputs = [*INPUTS[:2], (falling.measurement(), falling.reference()), *INPUTS[2:4]]
    flown = controller(name)
    batch = step(
        flown, stacked([m for m, _ in inputs]), stacked([r for _, r in inputs])
    )
    found = np.stack(
        [np.broadcast_to(leaf, (len(inputs),)) for leaf in leaves(batch)], axis=1
    )
    assert np.all(np.isfinite(found))
    close(found, floats(flown, inputs))


@pytest.mark.parametrize("name", LAWS)
def test_jax_agrees_with_floats(name):
    jax = pytest.importorskip("jax")
    flown = controller(name)
    with jax_doubles():
        measured, reference = (
            stacked(records) for records in zip(*INPUTS, strict=True)
        )
        values = [
            jax.numpy.asarray(leaf) for leaf in (*leaves(measured), *leaves(reference))
        ]
        split = len(leaves(measured))
        command = step(
            flown,
            rebuild(measured, iter(values[:split])),
            rebuild(reference, iter(values[split:])),
        )
        found = np.stack(
            [
                np.broadcast_to(np.asarray(leaf), (len(INPUTS),))
                for leaf in leaves(command)
            ],
            axis=1,
        )
    assert found.dtype == np.float64
    close(found, floats(flown))


@pytest.mark.parametrize("name", LAWS)
def test_casadi_agrees_with_floats(name):
    import casadi

    flown = controller(name)
    measured, reference = INPUTS[0]
    symbols = [
        casadi.SX.sym(f"x{i}")
        for i in range(len(leaves(measured)) + len(leaves(reference)))
    ]
    split = len(leaves(measured))
    command = step(
        flown,
        rebuild(measured, iter(symbols[:split])),
        rebuild(reference, iter(symbols[split:])),
    )
    compiled = casadi.Function(
        "law", [casadi.vertcat(*symbols)], [casadi.vertcat(*leaves(command))]
    )
    found = [np.array(compiled([*leaves(m), *leaves(r)])).ravel() for m, r in INPUTS]
    close(np.array(found), floats(flown))


@pytest.mark.parametrize("name", LAWS)
def test_a_traced_law_equals_floats_bit_for_bit(name):
    flown = controller(name)
    program = trace(lambda m, r: step(flown, m, r), *INPUTS[0])
    falling = changed(hovering(), a_d=(0.0, 0.0, -G))
    for pair in (*INPUTS, (falling.measurement(), falling.reference())):
        assert leaves(program(*pair)) == leaves(step(flown, *pair))


def heavier(par: Parameters) -> Parameters:
    """Another belief and other gains, the same structure."""
    gains = GeometricGains(
        position=Vec3(5.0, 4.5, 6.0),
        velocity=Vec3(2.0, 2.5, 3.0),
        attitude=Vec3(0.8, 0.6, 0.05),
        rate=Vec3(0.12, 0.09, 0.03),
    )
    joint_gains = JointGains(stiffness=(200.0, 120.0), damping=(11.0, 9.0))
    vehicle = par.model.vehicle.with_payload(0.05)
    base = dataclasses.replace(
        vehicle.base, mass=1.1, inertia=vehicle.base.inertia * 1.3
    )
    model = Model(vehicle=dataclasses.replace(vehicle, base=base), gravity=9.7)
    return dataclasses.replace(par, model=model, gains=gains, joint_gains=joint_gains)


@pytest.mark.parametrize("name", LAWS)
def test_gains_masses_and_gravity_may_be_inputs_of_a_traced_program(name):
    """Parameters are a record of scalars: one program flies every belief and every
    gain.
    """
    flown = controller(name)
    measured, reference = INPUTS[0]
    program = trace(
        lambda par, m, r: flown.law((), m, r, 0.005, par=par)[1],
        flown.par,
        measured,
        reference,
    )
    for par in (flown.par, heavier(flown.par)):
        expected = step(dataclasses.replace(flown, par=par), measured, reference)
        assert leaves(program(par, measured, reference)) == leaves(expected)
    assert leaves(program(heavier(flown.par), measured, reference)) != leaves(
        program(flown.par, measured, reference)
    )


@pytest.mark.parametrize("name", LAWS[2:])
def test_a_lane_of_masses_equals_a_loop_over_them(name):
    masses = np.array([0.6, 0.716, 1.0])

    def flown(mass):
        base = dataclasses.replace(ARM2.base, mass=mass)
        model = Model(vehicle=dataclasses.replace(ARM2, base=base), gravity=G)
        known = controller(name)
        return unclipped(
            dataclasses.replace(known, par=dataclasses.replace(known.par, model=model))
        )

    batch = raw_squares(step(flown(masses), *INPUTS[0]))
    single = np.array(
        [raw_squares(step(flown(float(mass)), *INPUTS[0])) for mass in masses]
    ).T
    np.testing.assert_allclose(batch, single, atol=1e-12 * np.abs(single).max())


def test_a_controllers_mixer_may_come_from_a_traced_vehicle():
    """Rotor constants as inputs: the allocation is inverted inside the program."""
    measured, reference = INPUTS[0]

    def law(model, m, r):
        return step(make_controller("rotors_sim_position", model), m, r)

    program = trace(law, MODEL, measured, reference)
    assert leaves(program(MODEL, measured, reference)) == leaves(
        law(MODEL, measured, reference)
    )


def test_the_measured_attitude_is_the_only_place_where_a_quaternion_enters():
    """A unit quaternion off by rounding changes the command by rounding."""
    measured, reference = INPUTS[1]
    q = measured.quaternion
    stretched = dataclasses.replace(
        measured, quaternion=Quaternion(*(value * (1.0 + 1e-15) for value in q))
    )
    flown = controller("hybrid_computed_torque")
    close(
        leaves(step(flown, stretched, reference)),
        leaves(step(flown, measured, reference)),
    )
