"""Integers are structure: they fold away, floats never do, and folding never changes a
value.
"""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyarm.algebra.scalars import add, divide, mul, neg, structural, sub

finite = st.floats(allow_nan=False, allow_infinity=False, width=64)
structure = st.integers(-3, 3)


@given(structure, finite)
def test_folded_arithmetic_has_the_value_of_plain_arithmetic(k, x):
    for fold, plain in (
        (add, lambda a, b: a + b),
        (sub, lambda a, b: a - b),
        (mul, lambda a, b: a * b),
    ):
        assert fold(k, x) == plain(k, x)
        assert fold(x, k) == plain(x, k)
    assert neg(x) == -x


@given(structure, structure)
def test_structure_with_structure_is_structure(j, k):
    for fold, plain in ((add, j + k), (sub, j - k), (mul, j * k)):
        assert fold(j, k) == plain
        assert type(fold(j, k)) is int


@given(finite)
def test_data_is_never_folded_even_if_it_happens_to_be_zero_or_one(x):
    assert type(mul(0.0, x)) is float
    assert math.copysign(1.0, mul(0.0, x)) == math.copysign(1.0, x)
    assert math.isnan(mul(0.0, math.inf))
    assert math.isnan(mul(math.nan, 0.0))


class Recorder:
    """A value on which every operation is refused: only a fold can survive it."""

    def __neg__(self):
        return "negated"


def test_zero_one_and_minus_one_cost_no_operation():
    x = Recorder()
    assert mul(0, x) == mul(x, 0) == 0
    assert mul(1, x) is x
    assert mul(x, 1) is x
    assert mul(-1, x) == mul(x, -1) == "negated"
    assert add(0, x) is x
    assert add(x, 0) is x
    assert sub(x, 0) is x
    assert sub(0, x) == "negated"
    assert divide(x, 1) is x
    with pytest.raises(TypeError):
        mul(2, x)


def test_a_structural_zero_removes_even_a_nan():
    assert mul(0, math.nan) == 0
    assert mul(math.inf, 0) == 0


@pytest.mark.parametrize(
    ("value", "kind"),
    [(0.0, int), (-0.0, int), (1.0, int), (-1.0, int), (2.0, float), (0.5, float)],
)
def test_centroidal_zero_and_one_of_a_description_become_structure(value, kind):
    assert type(structural(value)) is kind
    assert structural(value) == value


def test_booleans_are_not_structure():
    assert type(mul(True, 2.5)) is float
    assert add(False, -0.0) == 0.0
