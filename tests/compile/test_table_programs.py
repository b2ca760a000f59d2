"""A program evaluated on arrays has the bits of the same program on Python floats,
column by column.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra.scalars import (
    absolute,
    acos,
    asin,
    atan2,
    clip,
    cos,
    divide,
    exp,
    floor,
    log,
    logical_not,
    logical_or,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from skyarm.compile import trace
from skyarm.compile.tracing.array_evaluation import OPERATIONS, evaluate


def everything(a, b):
    """Every function there is, branches and constants."""
    (x, y), _ = a, b
    return (
        *(
            f(x)
            for f in (sin, cos, tan, asin, acos, exp, log, tanh, sqrt, floor, absolute)
        ),
        atan2(y, x),
        divide(x, y),
        clip(x, -1.0, y),
        where(logical_or(x < y, logical_not(y <= 0.0)), x - y, -(x * y) + 3.0),
        2.5,
    )


SPECIAL = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    np.inf,
    -np.inf,
    np.nan,
    1e300,
    -1e-300,
    5e-324,
    710.0,
    -745.2,
    3.5,
    -3.5,
)


@pytest.fixture(scope="module")
def numbers():
    rng = np.random.default_rng(4)
    x, y = (column.ravel() for column in np.meshgrid(SPECIAL, SPECIAL))
    scales = 10.0 ** rng.uniform(-8.0, 8.0, (2, 2000))
    drawn = rng.normal(size=(2, 2000)) * scales
    return np.concatenate([[x, y], drawn], axis=1)


def test_every_column_has_the_bits_of_python_floats(numbers):
    program = trace(everything, (0.0, 0.0), ())
    assert {node.op for node in program.lowered.nodes} - {"input", "const"} >= set(
        OPERATIONS
    ) - {"and"}
    found = evaluate(program, numbers, numbers.shape[1])
    wanted = np.array([program.flat(pair) for pair in numbers.T.tolist()]).T
    for row, expected in zip(found, wanted, strict=True):
        # a NaN has no bits to agree on
        assert np.isnan(row).tolist() == np.isnan(expected).tolist()
        good = ~np.isnan(row)
        assert row[good].tobytes() == expected[good].tobytes()


def test_one_number_stands_for_a_column_and_a_constant_fills_one():
    program = trace(lambda a: (a[0] * a[1], a[0], 4.0), (0.0, 0.0))
    found = evaluate(program, [np.array([1.0, 2.0, 3.0]), 5.0], 3)
    assert found.tolist() == [[5.0, 10.0, 15.0], [1.0, 2.0, 3.0], [4.0, 4.0, 4.0]]
    assert evaluate(trace(lambda a: (), (0.0,)), [1.0], 7).shape == (0, 7)


def test_a_power_of_two_is_no_number_from_1100_on_in_either_direction():
    """As C and machine code have it, which must not convert a number that no exponent
    holds.
    """
    with np.errstate(over="ignore"):
        found = OPERATIONS["power_of_two"](
            np.array([-1100.0, -1099.5, -1074.0, 3.0, 1099.5, 1100.0])
        )
    np.testing.assert_array_equal(found, [np.nan, 0.0, 5e-324, 8.0, np.inf, np.nan])
