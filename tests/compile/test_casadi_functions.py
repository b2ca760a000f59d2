"""Traced functions as CasADi functions equal the Python floats, and so do their derivatives."""

from __future__ import annotations

import numpy as np
import pytest

casadi = pytest.importorskip("casadi")

# ruff: noqa: E402  the engine needs the library
from casadi_functions import casadi_function
from skyarm.algebra.scalars import (
    absolute,
    acos,
    asin,
    atan2,
    cos,
    divide,
    exp,
    floor,
    log,
    philox,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from skyarm.algebra.scalars.functions import copysign, mantissa
from skyarm.compile import TracedBranchError, leaves, rebuild, trace
from stepped_flights import (
    CONSTANTS,
    CONTROLLER,
    PENDULUM,
    TILTED,
    Constants,
    Pendulum,
    euler_step,
    flight_lanes,
    flight_row,
    flight_rows,
    flight_step,
    pendulum_step,
)


def noisy(state, par, torque, draws):
    return pendulum_step(state, par, torque, draws)[0]


EXAMPLES = (PENDULUM, CONSTANTS, (0.0,), (0.5, 0.5, 0.5))


def column(found):
    return np.array(found).ravel()


def test_arguments_and_results_have_names():
    function = casadi_function(noisy, *EXAMPLES)
    assert function.name_in() == ["state", "par", "torque", "draws"]
    assert [function.size1_in(i) for i in range(4)] == [2, 3, 1, 3]
    assert function.name_out() == ["angle", "rate"]
    joined = casadi_function(noisy, *EXAMPLES, name="pendulum", inputs=("x", "p", "u", "w"), outputs=("following",))
    assert joined.name() == "pendulum"
    assert joined.name_in() == ["x", "p", "u", "w"]
    assert joined.name_out() == ["following"]
    assert joined.size1_out(0) == 2
    pair = casadi_function(lambda *at: (at[0] * 2.0, at[1]), 1.0, 2.0)
    assert (pair.name_in(), pair.name_out()) == (["x0", "x1"], ["out0", "out1"])
    program = trace(noisy, *EXAMPLES)
    assert (
        column(casadi_function(program, outputs=("out",))(*map(leaves, EXAMPLES))).tolist()
        == column(joined(*map(leaves, EXAMPLES))).tolist()
    )


def test_names_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"inputs = .*must be 4"):
        casadi_function(noisy, *EXAMPLES, inputs=("x",))
    with pytest.raises(ValueError, match=r"outputs = .*must be 1 or 2, as .'angle', 'rate'"):
        casadi_function(noisy, *EXAMPLES, outputs=("a", "b", "c"))


def test_a_noisy_pendulum_equals_the_python_floats():
    """Tolerance: one or two last digits of sin, cos and log a step, damped."""
    function = casadi_function(noisy, *EXAMPLES, outputs=("following",))
    state, x = PENDULUM, leaves(PENDULUM)
    for k in range(120):
        draws = tuple(float(u) for u in philox.uniforms(3, 1, 0, k, 3))
        torque = (float(np.sin(k / 7.0)),)
        state = noisy(state, CONSTANTS, torque, draws)
        x = column(function(x, leaves(CONSTANTS), torque, draws))
    np.testing.assert_allclose(x, leaves(state), rtol=0, atol=1e-13)


def test_jacobians_of_the_pendulum_equal_the_derivatives_by_hand():
    """angle' = angle + h rate', rate' = rate + h (push + torque - k sin(angle) - d rate), h = 0.01."""
    function = casadi_function(noisy, *EXAMPLES, outputs=("following",))
    jacobian = function.jacobian()
    values = [leaves(one) for one in EXAMPLES]
    by_state, by_par = (np.array(block) for block in jacobian(*values, 0)[:2])
    angle, rate, k, d = PENDULUM.angle, PENDULUM.rate, CONSTANTS.stiffness, CONSTANTS.damping
    second = np.array([-0.01 * k * np.cos(angle), 1.0 - 0.01 * d])
    np.testing.assert_allclose(by_state, [0.01 * second + [1.0, 0.0], second], rtol=1e-14)
    normal = np.sqrt(-2.0 * np.log(0.5)) * np.cos(np.pi)
    third = np.array([-0.01 * np.sin(angle), -0.01 * rate, 0.01 * normal])
    np.testing.assert_allclose(by_par, [0.01 * third, third], rtol=1e-13)


def test_the_controlled_vehicle_equals_the_python_floats():
    """Tolerance: the loop is stable, so roundings of 160 steps do not grow; rotor speeds are of order 500 rad/s."""

    def flight(state, par, reference):
        return flight_step(state, par, reference, ())[0]

    function = casadi_function(flight, TILTED, CONTROLLER.par, flight_row(), outputs=("following",))
    carry, parameters = flight_lanes(2)
    x, p = carry[:, 1], parameters[:, 1]
    program = trace(flight, TILTED, CONTROLLER.par, flight_row())
    state = tuple(x)
    for row in flight_rows(160):
        state = program.flat((*state, *p, *row))
        x = column(function(x, p, row))
    scale = np.where(np.arange(x.size) < 17, 1.0, 500.0)
    np.testing.assert_allclose(x / scale, np.array(state) / scale, rtol=0, atol=2e-12)


def test_jacobians_of_the_controlled_vehicle_equal_central_differences_of_the_python_floats():
    """Tolerance: h^2 = 1e-10 of the size of the third derivative, and 1e-16 / h of the values, rotor speeds 500."""

    def flight(state, par, reference):
        return euler_step(state, par, reference, ())[0]

    function = casadi_function(flight, TILTED, CONTROLLER.par, flight_row(), outputs=("following",))
    carry, parameters = flight_lanes(2)
    row = flight_rows(30)[29]
    values = [carry[:, 1], parameters[:, 1], row]
    program = trace(flight, TILTED, CONTROLLER.par, flight_row())
    blocks = [np.array(block) for block in function.jacobian()(*values, 0)]
    scale = np.where(np.arange(carry.shape[0]) < 17, 1.0, 500.0)
    for which, block in enumerate(blocks):
        for i, value in enumerate(values[which]):
            if not np.isfinite(value):
                continue  # a limit that is not there
            h = 1e-5 * max(abs(value), 1e-2)
            ends = []
            for sign in (1.0, -1.0):
                moved = [one.copy() for one in values]
                moved[which][i] += sign * h
                ends.append(np.array(program.flat(np.concatenate(moved))))
            quotient = (ends[0] - ends[1]) / (2.0 * h)
            np.testing.assert_allclose(
                block[:, i] / scale, quotient / scale, rtol=1e-6, atol=1e-14 / h, err_msg=f"argument {which}, leaf {i}"
            )


def everything(x, y):
    curves = sin(x), cos(x), tan(x), asin(x), acos(x), atan2(y, x), exp(x), log(absolute(y)), tanh(x)
    bits = copysign(divide(x, y), y), floor(3.0 * x), sqrt(absolute(x)), -x, x - y
    logic = where(((x < 0.2) & (y > 0.1)) | (x <= -0.5), x * y, x + y), where(x > y, 1.0, 2.0)
    return *curves, *bits, *logic


def test_every_operation_equals_the_python_floats():
    """Tolerance: one library's last digits against the other's."""
    function = casadi_function(everything, 0.5, 0.5, outputs=("all",))
    for x, y in np.random.default_rng(6).uniform(-1.0, 1.0, (60, 2)).tolist():
        np.testing.assert_allclose(column(function(x, y)), everything(x, y), rtol=1e-14, atol=1e-15)


def test_the_branch_not_taken_does_not_spoil_the_value():
    function = casadi_function(lambda x: (where(x > 0.0, divide(1.0, x), 7.0), sqrt(where(x < 0.0, 0.0, x))), 1.0)
    assert [float(one) for one in function(0.0)] == [7.0, 0.0]
    assert [float(one) for one in function(4.0)] == [0.25, 2.0]


def test_integers_are_structure_and_an_argument_without_scalars_is_empty():
    function = casadi_function(lambda x, settings: x * settings[0], 1.0, (2,))
    assert function.size1_in("settings") == 0
    assert float(function(1.5, [])) == 3.0


def branching(x):
    return x if x > 0.0 else -x


def test_branches_and_operations_on_bits_are_refused():
    with pytest.raises(TracedBranchError, match=r"test_casadi_functions\.py"):
        casadi_function(branching, 1.0)
    with pytest.raises(ValueError, match="mantissa: CasADi has no such operation"):
        casadi_function(mantissa, 1.0)


def test_a_record_goes_in_as_its_leaves_in_order():
    function = casadi_function(
        lambda at: Pendulum(angle=at.damping, rate=at.noise), Constants(stiffness=1.0, damping=2.0, noise=3.0)
    )
    found = rebuild(PENDULUM, iter([float(one) for one in function([4.0, 5.0, 6.0])]))
    assert found == Pendulum(angle=5.0, rate=6.0)
