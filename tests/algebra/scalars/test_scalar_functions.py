"""Each function of scalars on each engine: the value of Python's math, and IEEE where
math raises.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from skyarm.algebra import scalars
from support.engines import ENGINES, evaluate

INF, NAN = math.inf, math.nan


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def same(found, wanted, tolerance=4e-16):
    """Equal NaN and infinities; finite values within two units in the last place, as
    libraries round differently.
    """
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    assert found.shape == wanted.shape
    assert np.array_equal(np.isnan(found), np.isnan(wanted)), (found, wanted)
    known = ~np.isnan(wanted)
    assert np.allclose(found[known], wanted[known], rtol=tolerance, atol=0.0), (
        found,
        wanted,
    )


UNARY = {
    "sin": (math.sin, [-3.0, -0.1, 0.0, 1e-9, 0.7, 100.0]),
    "cos": (math.cos, [-3.0, -0.1, 0.0, 1e-9, 0.7, 100.0]),
    "tan": (math.tan, [-1.5, -0.1, 0.0, 1e-9, 0.7]),
    "asin": (math.asin, [-1.0, -0.4, 0.0, 1e-9, 1.0]),
    "acos": (math.acos, [-1.0, -0.4, 0.0, 0.5, 1.0]),
    "sqrt": (math.sqrt, [0.0, 1e-300, 0.3, 2.0, 1e300]),
    "exp": (math.exp, [-800.0, -1.0, 0.0, 1.0, 700.0]),
    "log": (math.log, [1e-300, 0.3, 1.0, 7.0]),
    "tanh": (math.tanh, [-400.0, -0.5, 0.0, 1e-9, 0.5, 400.0]),
    "absolute": (abs, [-2.5, -1e-300, 0.0, 3.0]),
    "floor": (math.floor, [-2.5, -2.0, 0.0, 0.5, 3.999, 1e17]),
}


@pytest.mark.parametrize("name", sorted(UNARY))
def test_a_function_is_that_of_math(engine, name):
    reference, points = UNARY[name]
    found = evaluate(
        engine, lambda x: [getattr(scalars, name)(x)], [[x] for x in points]
    )
    # XLA's tan, sin and exp on a CPU are good to a few units in the last place
    same(found[:, 0], [float(reference(x)) for x in points], tolerance=2e-15)


CORNERS = {
    "sin": [(INF, NAN), (-INF, NAN), (NAN, NAN)],
    "cos": [(INF, NAN), (-INF, NAN), (NAN, NAN)],
    "tan": [(INF, NAN), (NAN, NAN)],
    "asin": [(1.1, NAN), (-1.1, NAN), (INF, NAN), (NAN, NAN)],
    "acos": [(1.1, NAN), (-1.1, NAN), (INF, NAN), (NAN, NAN)],
    "sqrt": [(-1.0, NAN), (-INF, NAN), (INF, INF), (NAN, NAN)],
    "exp": [(1000.0, INF), (INF, INF), (-INF, 0.0), (NAN, NAN)],
    "log": [
        (0.0, -INF),
        (-0.0, -INF),
        (-1.0, NAN),
        (INF, INF),
        (-INF, NAN),
        (NAN, NAN),
    ],
    "tanh": [(INF, 1.0), (-INF, -1.0), (NAN, NAN)],
    "absolute": [(-INF, INF), (NAN, NAN)],
    "floor": [(INF, INF), (-INF, -INF), (NAN, NAN)],
}


@pytest.mark.parametrize("name", sorted(CORNERS))
def test_a_function_gives_inf_or_nan_where_math_raises(engine, name):
    points, wanted = zip(*CORNERS[name], strict=True)
    found = evaluate(
        engine, lambda x: [getattr(scalars, name)(x)], [[x] for x in points]
    )
    same(found[:, 0], wanted)


def test_division_follows_ieee(engine):
    cases = [
        (1.0, 0.0, INF),
        (-1.0, 0.0, -INF),
        (1.0, -0.0, -INF),
        (-1.0, -0.0, INF),
        (0.0, 0.0, NAN),
    ]
    cases += [
        (INF, INF, NAN),
        (1.0, INF, 0.0),
        (NAN, 0.0, NAN),
        (INF, 0.0, INF),
        (1e300, 1e-300, INF),
        (1.0, 3.0, 1 / 3),
    ]
    found = evaluate(
        engine, lambda a, b: [scalars.divide(a, b)], [case[:2] for case in cases]
    )
    same(found[:, 0], [case[2] for case in cases])


def test_atan2_knows_all_quadrants_and_signed_zeros(engine):
    cases = [
        (y, x)
        for y in (-2.0, -0.0, 0.0, 1.0, INF)
        for x in (-3.0, -0.0, 0.0, 1.0, -INF)
    ]
    found = evaluate(engine, lambda y, x: [scalars.atan2(y, x)], cases)
    same(found[:, 0], [math.atan2(y, x) for y, x in cases])


def test_where_takes_one_branch_and_ignores_a_nan_in_the_other(engine):
    lanes = [[-4.0], [9.0], [0.0]]

    def root_or_seven(x):
        return [
            scalars.where(x >= 0.0, scalars.sqrt(x), 7.0),
            scalars.where(x < 0.0, 7.0, scalars.sqrt(x)),
        ]

    same(evaluate(engine, root_or_seven, lanes), [[7.0, 7.0], [3.0, 3.0], [0.0, 0.0]])

    def inverse_or_zero(x):
        return [scalars.where(x > 0.0, scalars.divide(1.0, x), 0.0)]

    same(evaluate(engine, inverse_or_zero, lanes), [[0.0], [1.0 / 9.0], [0.0]])


def test_logic_combines_conditions(engine):
    lanes = [[a, b] for a in (-1.0, 1.0) for b in (-1.0, 1.0)]

    def table(a, b):
        p, q = a > 0.0, b > 0.0
        conditions = (
            scalars.logical_and(p, q),
            scalars.logical_or(p, q),
            scalars.logical_not(p),
        )
        return [scalars.where(condition, 1.0, 0.0) for condition in conditions]

    same(evaluate(engine, table, lanes), [[0, 0, 1], [0, 1, 1], [0, 1, 0], [1, 1, 0]])


def test_comparisons_are_strict_and_weak_as_written(engine):
    lanes = [[1.0, 2.0], [2.0, 1.0], [1.0, 1.0], [NAN, 1.0]]

    def table(a, b):
        return [
            scalars.where(condition, 1.0, 0.0)
            for condition in (a < b, a <= b, a > b, a >= b)
        ]

    same(
        evaluate(engine, table, lanes),
        [[1, 1, 0, 0], [0, 0, 1, 1], [0, 1, 0, 1], [0, 0, 0, 0]],
    )


def test_limits_hold_a_value_and_let_a_nan_through(engine):
    lanes = [[-2.0], [0.25], [2.0], [NAN], [INF], [-INF]]

    def limited(x):
        return [
            scalars.minimum(x, 1.0),
            scalars.maximum(x, -1.0),
            scalars.clip(x, -1.0, 1.0),
        ]

    wanted = [
        [-2, -1, -1],
        [0.25, 0.25, 0.25],
        [1, 2, 1],
        [NAN, NAN, NAN],
        [1, INF, 1],
        [-INF, -1, -1],
    ]
    same(evaluate(engine, limited, lanes), wanted)


def test_sign_is_minus_one_zero_or_one(engine):
    found = evaluate(
        engine, lambda x: [scalars.sign(x)], [[-3.0], [0.0], [2.0], [NAN], [INF]]
    )
    same(found[:, 0], [-1.0, 0.0, 1.0, NAN, 1.0])


@pytest.mark.parametrize("engine", ["floats", "numpy", "jax", "trace"])
def test_zeros_keep_their_sign(engine):
    """CasADi is left out: it rewrites expressions with zeros."""
    functions = (
        scalars.sqrt,
        scalars.sin,
        scalars.tan,
        scalars.asin,
        scalars.tanh,
        scalars.floor,
        scalars.sign,
    )
    found = evaluate(engine, lambda x: [f(x) for f in functions], [[-0.0], [0.0]])
    assert np.array_equal(
        np.signbit(found), [[True] * len(functions), [False] * len(functions)]
    )
    assert np.array_equal(found, np.zeros_like(found))


def test_what_where_chooses_is_data_even_if_it_was_an_integer():
    chosen = scalars.where(True, 0, 1.0)
    assert type(chosen) is float
    assert math.isnan(scalars.mul(chosen, INF))
    assert scalars.where(False, 0, True) is True


def test_numpy_corners_give_no_warning():
    with np.errstate(all="raise"):
        found = scalars.divide(np.array([1.0, 0.0]), np.array([0.0, 0.0]))
        same(found, [INF, NAN])
        same(scalars.sqrt(np.array([-1.0])), [NAN])


def test_a_numpy_constant_beside_another_engine_leaves_the_call_to_that_engine():
    jax = pytest.importorskip("jax")
    assert isinstance(scalars.atan2(np.float64(1.0), jax.numpy.asarray(2.0)), jax.Array)


def test_a_numpy_constant_beside_a_symbol_leaves_the_call_to_casadi():
    import casadi

    assert isinstance(scalars.atan2(np.float64(1.0), casadi.SX.sym("x")), casadi.SX)


def test_gradients_pass_through_where_when_the_argument_is_guarded_too():
    jax = pytest.importorskip("jax")

    def guarded(x):
        positive = x > 0.0
        return scalars.where(
            positive, scalars.sqrt(scalars.where(positive, x, 1.0)), 0.0
        )

    assert float(jax.grad(guarded)(4.0)) == pytest.approx(0.25, rel=1e-6)
    assert float(jax.grad(guarded)(-4.0)) == 0.0


@pytest.mark.parametrize("value", ["a string", None, [1.0], 1j])
def test_something_that_is_no_scalar_is_refused_by_name(value):
    with pytest.raises(
        TypeError,
        match="is not a scalar; allowed: float, NumPy, JAX, CasADi, tracer node",
    ):
        scalars.sin(value)
