"""The LDL solver against NumPy's LU, on every engine."""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.algebra import ldl_solve
from support.engines import ENGINES, evaluate

RNG = np.random.default_rng(9)


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def positive(n):
    root = RNG.normal(size=(n, n))
    return root @ root.T + 0.5 * np.eye(n)


@pytest.mark.parametrize("n", [1, 2, 3, 6, 8])
def test_a_positive_definite_system_has_numpys_solution(engine, n):
    systems = [(positive(n), RNG.normal(size=n)) for _ in range(3)]
    lanes = np.array([[*A.ravel(), *b] for A, b in systems])

    def function(*x):
        return ldl_solve(
            [list(x[i * n : (i + 1) * n]) for i in range(n)], list(x[n * n :])
        )

    found = evaluate(engine, function, lanes)
    for x, (A, b) in zip(found, systems, strict=True):
        # as many digits go as the condition of A has
        assert np.abs(x - np.linalg.solve(A, b)).max() <= 1e-14 * np.linalg.cond(
            A
        ) * max(1.0, np.abs(x).max())


def test_only_the_lower_triangle_is_read():
    A = positive(4)
    lower = np.where(np.tril(np.ones((4, 4))) > 0, A, np.nan)
    x = ldl_solve(lower.tolist(), [1.0, 2.0, 3.0, 4.0])
    assert np.allclose(x, np.linalg.solve(A, [1.0, 2.0, 3.0, 4.0]), rtol=1e-11)


def test_an_indefinite_matrix_gives_the_algebraic_solution():
    assert ldl_solve([[-2.0, 0.0], [1.0, 3.0]], [1.0, 2.0]) == pytest.approx(
        np.linalg.solve([[-2.0, 1.0], [1.0, 3.0]], [1.0, 2.0]).tolist(), rel=1e-14
    )


def test_a_singular_matrix_gives_no_finite_number_and_does_not_raise(engine):
    found = evaluate(
        engine, lambda a, b: ldl_solve([[a, a], [a, a]], [b, 2.0 * b]), [[1.0, 1.0]]
    )
    assert not np.any(np.isfinite(found))


def test_structural_zeros_fold_and_arguments_are_left_alone():
    A, b = [[2.0, 0, 0], [0, 4.0, 0], [0, 0, 5.0]], [2.0, 0, 5.0]
    x = ldl_solve(A, b)
    assert x == [1.0, 0, 1.0]
    assert type(x[1]) is int
    assert A == [[2.0, 0, 0], [0, 4.0, 0], [0, 0, 5.0]]
    assert b == [2.0, 0, 5.0]
