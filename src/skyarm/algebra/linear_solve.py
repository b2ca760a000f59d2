"""Solution of small symmetric positive definite systems over any scalar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skyarm.scalars import divide, mul, sub


def ldl_solve(A: Sequence[Sequence[Any]], b: Sequence[Any]) -> list[Any]:
    """Solve A x = b for a symmetric positive definite A (its lower triangle is read), without pivoting.

    A = L D L^T column by column; structural zeros of A fold. An indefinite A gives the algebraic solution or NaN.
    Source: Golub, Van Loan 2013, algorithm 4.1.2.
    """
    n = len(b)
    L: list[list[Any]] = [[0] * n for _ in range(n)]
    D: list[Any] = []
    inverse: list[Any] = []
    for j in range(n):
        v = [mul(L[j][k], D[k]) for k in range(j)]
        pivot = A[j][j]
        for k in range(j):
            pivot = sub(pivot, mul(L[j][k], v[k]))
        D.append(pivot)
        inverse.append(divide(1.0, pivot))
        for i in range(j + 1, n):
            entry = A[i][j]
            for k in range(j):
                entry = sub(entry, mul(L[i][k], v[k]))
            L[i][j] = mul(entry, inverse[j])
    x = list(b)
    for i in range(n):
        for k in range(i):
            x[i] = sub(x[i], mul(L[i][k], x[k]))
    x = [mul(x[i], inverse[i]) for i in range(n)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = sub(x[i], mul(L[k][i], x[k]))
    return x
