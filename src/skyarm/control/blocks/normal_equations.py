"""Weighted least squares: normal equations A x = b to which one row after the other is added."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.algebra import ldl_solve
from skyarm.scalars import add, divide, mul


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """Least squares of |row . x - wanted|^2 / error^2 over all rows, beside what is known beforehand.

    Attributes:
        A: symmetric, of which the lower triangle counts, as lists. b: the right-hand side.
    """

    A: list[list[Any]]
    b: list[Any]

    def require(self, row: Sequence[Any], wanted: Any, error: Any) -> None:
        """One row, its right-hand side, and the error that weighs as 1."""
        weight = divide(1.0, error * error)
        for i in range(len(self.b)):
            self.b[i] = add(self.b[i], mul(weight, mul(row[i], wanted)))
            for j in range(i + 1):
                self.A[i][j] = add(self.A[i][j], mul(weight, mul(row[i], row[j])))

    def solve(self) -> list[Any]:
        """The x of the least sum."""
        return ldl_solve(self.A, self.b)
