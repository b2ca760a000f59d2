"""The motion of least snap through points at given instants.

The integral of the squared fourth derivative is least for polynomials of seventh degree between the points that join
with six continuous derivatives (a natural spline). Unknown are velocity, acceleration and jerk at the inner points; the
cost is quadratic in them, without constraints, and its minimum solves one banded system.
Sources: Mellinger, Kumar 2011 (minimum snap); Richter, Bry, Roy 2013 (unconstrained form in the derivatives).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from skyarm.reference.polynomials import Polynomials

FREE = 3
"""Derivatives of a point that are free: velocity, acceleration, jerk."""


def minimum_snap(
    times: Sequence[float],
    values: Sequence[float],
    start: Sequence[float] = (0.0,) * 3,
    end: Sequence[float] = (0.0,) * 3,
) -> Polynomials:
    """The signal of least snap.

    Args:
        times: s, rising, at least two.
        values: at these times.
        start: velocity, acceleration and jerk at the first time; at rest by default.
        end: the same at the last time.
    """
    derivatives = knot_derivatives(times, values, start, end)
    pieces = []
    for i in range(len(times) - 1):
        span = times[i + 1] - times[i]
        ends = [values[i], *derivatives[i], values[i + 1], *derivatives[i + 1]]
        scaled = [ends[k] * span ** (k % 4) for k in range(8)]
        unit = [sum(a * d for a, d in zip(row, scaled, strict=True)) for row in HERMITE]
        pieces.append(tuple(c / span**k for k, c in enumerate(unit)))
    return Polynomials(tuple(times), tuple(pieces))


def knot_derivatives(
    times: Sequence[float], values: Sequence[float], start: Sequence[float], end: Sequence[float]
) -> list[Sequence[float]]:
    """Velocity, acceleration and jerk of the motion of least snap at each point."""
    inner = len(times) - 2
    size = FREE * inner
    band = 2 * FREE - 1
    A = [[0.0] * (band + 1) for _ in range(size)]  # A[i][d] couples i with i - d
    b = [0.0] * size
    for i in range(len(times) - 1):
        span = times[i + 1] - times[i]
        # cost of one piece: d' H d / span^7 with d the ends' derivatives scaled by powers of the span
        weight = [span ** (k % 4) for k in range(8)]
        known = {0: values[i], 4: values[i + 1]}
        if i == 0:
            known |= {1 + k: start[k] for k in range(FREE)}
        if i == inner:
            known |= {5 + k: end[k] for k in range(FREE)}
        at = {k: FREE * (i - 1 + k // 4) + k % 4 - 1 for k in range(8) if k not in known}
        for k, row in at.items():
            for j in range(8):
                value = COST[k][j] * weight[k] * weight[j] / span**7
                if j in known:
                    b[row] -= value * known[j]
                elif at[j] <= row:
                    A[row][row - at[j]] += value
    solved = _banded(A, b, band)
    return [start, *(solved[FREE * i : FREE * i + FREE] for i in range(inner)), end]


def snap_cost(motion: Polynomials) -> float:
    """Integral of the squared fourth derivative over the motion."""
    total = 0.0
    for i, c in enumerate(motion.coefficients):
        span = float(motion.knots[i + 1]) - float(motion.knots[i])
        fourth = [float(c[k]) * k * (k - 1) * (k - 2) * (k - 3) for k in range(4, len(c))]
        for j, a in enumerate(fourth):
            for k, b in enumerate(fourth):
                total += a * b * span ** (j + k + 1) / (j + k + 1)
    return total


def _banded(A: list[list[float]], b: list[float], band: int) -> list[float]:
    """Solve a symmetric positive definite system of a band by L D L^T, in one order on every machine."""
    n = len(b)
    L = [[0.0] * (band + 1) for _ in range(n)]
    D = [0.0] * n
    for i in range(n):
        for d in range(min(band, i), -1, -1):
            j = i - d
            total = A[i][d]
            for m in range(max(0, i - band), j):
                total -= L[i][i - m] * D[m] * L[j][j - m]
            if d:
                L[i][d] = total / D[j]
            else:
                D[i] = total
    x = list(b)
    for i in range(n):
        for d in range(1, min(band, i) + 1):
            x[i] -= L[i][d] * x[i - d]
    x = [value / scale for value, scale in zip(x, D, strict=True)]
    for i in reversed(range(n)):
        for d in range(1, min(band, n - 1 - i) + 1):
            x[i] -= L[i + d][d] * x[i + d]
    return x


def _hermite() -> list[list[Fraction]]:
    """Coefficients of a polynomial over [0, 1] from value, velocity, acceleration and jerk at its ends, exactly."""
    rows: list[list[Fraction]] = []
    for u in (0, 1):
        for k in range(4):
            row = []
            for power in range(8):
                factor = 1
                for j in range(k):
                    factor *= power - j
                row.append(Fraction(factor if (u or power == k) else 0))
            rows.append(row)
    n = len(rows)
    whole = [row + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(rows)]
    for i in range(n):
        pivot = next(r for r in range(i, n) if whole[r][i])
        whole[i], whole[pivot] = whole[pivot], whole[i]
        whole[i] = [v / whole[i][i] for v in whole[i]]
        for r in range(n):
            if r != i and whole[r][i]:
                whole[r] = [a - whole[r][i] * b for a, b in zip(whole[r], whole[i], strict=True)]
    return [row[n:] for row in whole]


def _cost(hermite: list[list[Fraction]]) -> list[list[float]]:
    """Integral over [0, 1] of the product of fourth derivatives, in the derivatives at both ends."""
    fourth = [[Fraction(k * (k - 1) * (k - 2) * (k - 3)) * c for c in hermite[k]] for k in range(4, 8)]
    found = [[Fraction(0)] * 8 for _ in range(8)]
    for j in range(4):
        for k in range(4):
            for r in range(8):
                for s in range(8):
                    found[r][s] += fourth[j][r] * fourth[k][s] / (j + k + 1)
    return [[float(v) for v in row] for row in found]


_EXACT = _hermite()
HERMITE = [[float(v) for v in row] for row in _EXACT]
COST = _cost(_EXACT)
