"""Solution of small symmetric positive definite systems over any scalar."""

from __future__ import annotations

from collections.abc import Sequence

from skyarm.algebra.scalars import Scalar, divide, mul, same, sub


def ldl_solve(A: Sequence[Sequence[Scalar]], b: Sequence[Scalar]) -> list[Scalar]:
    """Solve A x = b for a symmetric positive definite matrix A, whose lower triangle is
    read.

    Unknowns that structural zeros keep apart are solved apart. A = L D L^T column by
    column; the last two unknowns together by their determinant, one division for two
    that would wait for each other. An indefinite A gives the algebraic solution or NaN.
    Source: Golub, Van Loan 2013, algorithm 4.1.2.
    """
    x: list[Scalar] = [0] * len(b)
    for group in _groups(A):
        block = [[A[max(i, j)][min(i, j)] for j in group] for i in group]
        for i, value in zip(
            group, _solve_group(block, [b[i] for i in group]), strict=True
        ):
            x[i] = value
    return x


def _groups(A: Sequence[Sequence[Scalar]]) -> list[list[int]]:
    """Groups of unknowns of a linear system that are coupled directly or indirectly."""
    groups: list[list[int]] = []
    for i, row in enumerate(A):
        coupled = [g for g in groups if any(not same(row[j], 0) for j in g)]
        groups = [g for g in groups if g not in coupled]
        # in the order of the unknowns: rounding does not depend on the search
        groups.append(sorted([i, *(j for g in coupled for j in g)]))
    return groups


def _solve_group(A: list[list[Scalar]], b: list[Scalar]) -> list[Scalar]:
    """Solve one coupled system of linear equations in place."""
    n = len(b)
    first = max(0, n - 2)
    L: list[list[Scalar]] = [[0] * n for _ in range(n)]
    inverse: list[Scalar] = []
    for j in range(first):
        # one division a column: products with its inverse replace the others
        inverse.append(divide(1.0, A[j][j]))
        for i in range(j + 1, n):
            L[i][j] = mul(A[i][j], inverse[j])
            b[i] = sub(b[i], mul(L[i][j], b[j]))
            for k in range(j + 1, i + 1):
                A[i][k] = sub(A[i][k], mul(L[i][j], A[k][j]))
    x = [mul(value, pivot) for value, pivot in zip(b, inverse, strict=False)]
    x += _solve_two(A, b) if n > 1 else [mul(b[0], divide(1.0, A[0][0]))]
    # back substitution: the last two are known, each one above follows
    for i in reversed(range(first)):
        for k in range(i + 1, n):
            x[i] = sub(x[i], mul(L[k][i], x[k]))
    return x


def _solve_two(A: list[list[Scalar]], b: list[Scalar]) -> list[Scalar]:
    """Solve a linear system for its last two unknowns by their determinant."""
    p, q, r = A[-2][-2], A[-1][-2], A[-1][-1]
    # by divide, not /: of a singular matrix inf or NaN, where floats would raise
    inverse = divide(1.0, sub(mul(p, r), mul(q, q)))
    return [
        mul(sub(mul(r, b[-2]), mul(q, b[-1])), inverse),
        mul(sub(mul(p, b[-1]), mul(q, b[-2])), inverse),
    ]
