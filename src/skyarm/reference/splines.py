"""Piecewise polynomial signals: minimum-snap splines and uniform quintic B-splines.

The integral of the squared fourth derivative is least for polynomials of seventh degree
between the points that join with six continuous derivatives (a natural spline). Unknown
are velocity, acceleration and jerk at the inner points; the cost is quadratic in them,
without constraints, and its minimum solves one banded system.
Sources: Mellinger, Kumar 2011 (minimum snap); Richter, Bry, Roy 2013 (unconstrained
form in the derivatives).
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Annotated, TypeAlias

import numpy as np

from skyarm.algebra import Scalar, Scalars
from skyarm.algebra.scalars import where
from skyarm.records.arrays import Array, doubles
from skyarm.records.immutable import positional
from skyarm.records.units import Unit
from skyarm.reference.signals import Derivatives, Signal

Number: TypeAlias = "float | Array"
"""Number, or one of many lanes."""

ORDERS = 5
"""Number of values of a signal: its value and derivatives one to four."""


@positional
class Polynomials(Signal):
    """Piecewise polynomial time signal, constant before the first and after the last
    knot.

    Attributes:
        knots: knot times, s, rising, one more than there are polynomials.
        coefficients: c_0, c_1 ... of each polynomial c_0 + c_1 s + c_2 s^2 + ..., s the
            seconds since its knot.
    """

    knots: Annotated[Scalars, Unit("s", "times at which the pieces join, rising")]
    coefficients: Annotated[
        tuple[Scalars, ...],
        Unit("", "coefficients of the powers of seconds, in the signal's unit"),
    ]

    def __post_init__(self) -> None:
        Signal.__post_init__(self)
        if len(self.knots) != len(self.coefficients) + 1 or not self.coefficients:
            raise ValueError(
                f"polynomials.knots: {len(self.knots)}, must be one more than the"
                f" {len(self.coefficients)} polynomials"
            )

    def derivatives(self, t: Scalar) -> Derivatives:
        """Value and derivatives one to four at time t (s); zero derivatives outside the
        knots.
        """
        numbers = [float(knot) for knot in self.knots]
        first, last = numbers[0], numbers[-1]
        if isinstance(t, (int, float)):
            at = bisect_right(numbers, float(t)) - 1
            piece = min(max(at, 0), len(self.coefficients) - 1)
            c: Sequence[Scalar] = self.coefficients[piece]
            begin: Scalar = numbers[piece]
        elif isinstance(t, np.ndarray):
            pieces = np.clip(
                np.searchsorted(numbers, t, side="right") - 1,
                0,
                len(self.coefficients) - 1,
            )
            c = list(np.array(self.coefficients, dtype=float)[pieces].T)
            begin = np.array(numbers)[pieces]
        else:
            # a symbol finds no piece; the knots go along as one more coefficient
            pairs = zip(self.coefficients, numbers, strict=False)
            rows = [(*row, knot) for row, knot in pairs]
            *c, begin = _select_row(t, rows, numbers)
        s = where(t < first, first, where(t < last, t, last)) - begin
        inside = [polynomial(c, s, order) for order in range(1, ORDERS)]
        return (
            polynomial(c, s, 0),
            *(where(t < first, 0.0, where(t < last, each, 0.0)) for each in inside),
        )

    def switch_times(self) -> tuple[float, ...]:
        """Times (s) of the first and the last knot, where a derivative may jump."""
        return float(self.knots[0]), float(self.knots[-1])


def polynomial(c: Sequence[Scalar], s: Scalar, order: int) -> Scalar:
    """Derivative of given order of a polynomial, by Horner's rule."""
    total: Scalar = 0.0
    for power in range(len(c) - 1, order - 1, -1):
        total = total * s + c[power] * float(math.perm(power, order))
    return total


def _select_row(t: Scalar, rows: list[Scalars], knots: Sequence[float]) -> list[Scalar]:
    """Coefficients of the polynomial that applies at a symbolic time, by nested
    comparisons.
    """
    if len(rows) == 1:
        # a whole number would be structure of the trace, a coefficient is data
        return [float(c) if isinstance(c, int) else c for c in rows[0]]
    half = len(rows) // 2
    early = _select_row(t, rows[:half], knots[:half])
    late = _select_row(t, rows[half:], knots[half:])
    before = t < knots[half]
    return [where(before, a, b) for a, b in zip(early, late, strict=True)]


def uniform_curve(points: Sequence[float], start: float, step: float) -> Polynomials:
    """Uniform quintic B-spline with given control points, as a piecewise polynomial
    signal.

    Args:
        points: control points, at least six; the i-th belongs to the time ``start +
            (i - 2) step``.
        start: beginning of the curve, s; it ends ``len(points) - 5`` steps later.
        step: time between control points, s.

    Source: de Boor 1978, chapter IX (cardinal splines).
    """
    pieces = []
    for i in range(len(points) - 5):
        window = points[i : i + 6]
        total = [
            sum(m * p for m, p in zip(row, window, strict=True)) / 120.0
            for row in CARDINAL
        ]
        pieces.append(tuple(c / step**k for k, c in enumerate(total)))
    return Polynomials(
        tuple(start + i * step for i in range(len(pieces) + 1)), tuple(pieces)
    )


CARDINAL = (
    (1, 26, 66, 26, 1, 0),
    (-5, -50, 0, 50, 5, 0),
    (10, 20, -60, 20, 10, 0),
    (-10, 20, 0, -20, 10, 0),
    (5, -20, 30, -20, 5, 0),
    (-1, 5, -10, 10, -5, 1),
)
"""120 times the coefficient of u^k, row by row, of a quintic uniform B-spline in each
of its six control points."""


def interpolating_points(samples: Sequence[float]) -> list[float]:
    """Control points of the uniform quintic B-spline through given samples.

    The curve's value at a sample is 1/120, 26/120, 66/120, 26/120, 1/120 of the control
    points around it; the error is given back again and again, which takes off at least
    13 % of it each time and nearly all of a smooth one.
    """
    values = doubles(samples)
    points = values.copy()
    # 0.87^30 is 1.5 %, of the roughest sample-to-sample part alone
    for _ in range(30):
        padded = np.concatenate(
            [np.repeat(points[:1], 2), points, np.repeat(points[-1:], 2)]
        )
        n = len(points)
        outer = padded[0:n] + padded[4 : n + 4]
        inner = padded[1 : n + 1] + padded[3 : n + 3]
        points = points + (values - (outer + 26.0 * inner + 66.0 * points) / 120.0)
    return [float(p) for p in points]


BEYOND = 14
"""Number of samples before the start and after the end of a curve, over which effects
of its ends decay: by 0.43 a sample, the largest pole of the interpolation, to 8e-6."""


def sampled_curve(samples: Sequence[float], step: float) -> Polynomials:
    """Uniform quintic B-spline from 0 s on through samples (step in s) that go
    ``BEYOND`` ones farther at both ends.
    """
    return uniform_curve(
        interpolating_points(samples)[BEYOND - 2 : len(samples) - BEYOND + 2], 0.0, step
    )


FREE = 3
"""Number of free derivatives of a knot: velocity, acceleration, jerk."""


def minimum_snap(
    times: Sequence[float], values: Sequence[float], *, rests: bool = True
) -> Polynomials:
    """Minimum-snap spline through values at given times, from rest to rest.

    Args:
        times: knot times, s, rising, at least two.
        values: values at these times.
        rests: False: derivatives at the end are free, as those at the inner knots are.
    """
    return Polynomials(
        tuple(times),
        tuple(map(tuple, snap_pieces(span_powers(times), values, rests=rests))),
    )


def span_powers(times: Sequence[Number]) -> list[list[Number]]:
    """Powers 0 to 7 of the durations between knots; those of lanes have the bits of the
    floats' own.
    """
    rows: list[list[Number]] = []
    for span in (after - before for before, after in itertools.pairwise(times)):
        if isinstance(span, np.ndarray):
            rows.append(
                # a power of an array is another function of the library, with other
                # last bits
                [np.array([each**k for each in span.tolist()]) for k in range(8)]
            )
        else:
            rows.append([span**k for k in range(8)])
    return rows


def snap_pieces(
    spans: Sequence[Sequence[Number]], values: Sequence[Number], *, rests: bool = True
) -> list[list[Number]]:
    """Coefficients of the pieces of a minimum-snap spline.

    Args:
        spans: powers of the durations between knots (:func:`span_powers`); numbers, or
            lanes (N,).
        values: values at the knots; of lanes also (axes, 1).
        rests: whether it ends at rest.
    """
    derivatives = knot_derivatives(spans, values, rests=rests)
    pieces = []
    for i, powers in enumerate(spans):
        ends = [values[i], *derivatives[i], values[i + 1], *derivatives[i + 1]]
        # derivatives by time become derivatives by the share of the span
        scaled = [ends[k] * powers[k % 4] for k in range(8)]
        unit = [sum(a * d for a, d in zip(row, scaled, strict=True)) for row in HERMITE]
        pieces.append([c / powers[k] for k, c in enumerate(unit)])
    return pieces


def knot_derivatives(
    spans: Sequence[Sequence[Number]], values: Sequence[Number], *, rests: bool = True
) -> list[Sequence[Number]]:
    """Velocity, acceleration and jerk of a minimum-snap spline at each knot; zero at
    the start, and at an end at rest.

    An end that moves is a natural one: what it does follows from the values before it.
    """
    inner = len(spans) - rests
    size = FREE * inner
    band = 2 * FREE - 1
    # A[i][d] couples i with i - d
    A: list[list[Number]] = [[0.0] * (band + 1) for _ in range(size)]
    b: list[Number] = [0.0] * size
    for i, powers in enumerate(spans):
        # cost of one piece: d' H d / span^7 with d the ends' derivatives scaled by
        # powers of the span
        weight = [powers[k % 4] for k in range(8)]
        fixed = {0: values[i], 4: values[i + 1]}
        if i == 0:
            fixed |= {1 + k: 0.0 for k in range(FREE)}
        if i == inner:
            fixed |= {5 + k: 0.0 for k in range(FREE)}
        at = {
            k: FREE * (i - 1 + k // 4) + k % 4 - 1 for k in range(8) if k not in fixed
        }
        for k, row in at.items():
            for j in range(8):
                value = COST[k][j] * weight[k] * weight[j] / powers[7]
                if j in fixed:
                    b[row] = b[row] - value * fixed[j]
                elif at[j] <= row:
                    A[row][row - at[j]] = A[row][row - at[j]] + value
    solved = _solve_banded(A, b, band)
    rest = (0.0,) * FREE
    return [
        rest,
        *(solved[FREE * i : FREE * i + FREE] for i in range(inner)),
        *[rest] * rests,
    ]


def snap_cost(
    spans: Sequence[Sequence[Number]], pieces: Sequence[Sequence[Number]]
) -> Number:
    """Integral of the squared fourth derivative of polynomials of seventh degree, by
    the powers of their durations.
    """
    total: Number = 0.0
    for c, powers in zip(pieces, spans, strict=True):
        fourth = [c[k] * k * (k - 1) * (k - 2) * (k - 3) for k in range(4, 8)]
        for j, a in enumerate(fourth):
            # the integral of t^(j + k); no matrix product, whose order of sums, and so
            # its rounding, differs from machine to machine
            for k, b in enumerate(fourth):
                total = total + a * b * powers[j + k + 1] / (j + k + 1)
    return total


def _solve_banded(A: list[list[Number]], b: list[Number], band: int) -> list[Number]:
    """Solve a symmetric positive definite banded system by L D L^T, with the same
    rounding on every machine.
    """
    n = len(b)
    # L[i][d] is row i and column i - d: the band alone is stored
    L: list[list[Number]] = [[0.0] * (band + 1) for _ in range(n)]
    D: list[Number] = [0.0] * n
    for i in range(n):
        for d in range(min(band, i), -1, -1):
            j = i - d
            total = A[i][d]
            for m in range(max(0, i - band), j):
                total = total - L[i][i - m] * D[m] * L[j][j - m]
            if d:
                L[i][d] = total / D[j]
            else:
                D[i] = total
    x = list(b)
    for i in range(n):
        for d in range(1, min(band, i) + 1):
            x[i] = x[i] - L[i][d] * x[i - d]
    x = [value / scale for value, scale in zip(x, D, strict=True)]
    for i in reversed(range(n)):
        for d in range(1, min(band, n - 1 - i) + 1):
            x[i] = x[i] - L[i + d][d] * x[i + d]
    return x


SIXTHS = (
    (6, 0, 0, 0, 0, 0, 0, 0),
    (0, 6, 0, 0, 0, 0, 0, 0),
    (0, 0, 3, 0, 0, 0, 0, 0),
    (0, 0, 0, 1, 0, 0, 0, 0),
    (-210, -120, -30, -4, 210, -90, 15, -1),
    (504, 270, 60, 6, -504, 234, -42, 3),
    (-420, -216, -45, -4, 420, -204, 39, -3),
    (120, 60, 12, 1, -120, 60, -12, 1),
)
"""Six times the coefficients of a polynomial of degree 7 over [0, 1], by power, from
value, velocity, acceleration and jerk at 0 and at 1."""

HERMITE = [[c / 6 for c in row] for row in SIXTHS]


def _cost(j: int, k: int) -> float:
    """Integral over [0, 1] of a product of fourth derivatives of two Hermite basis
    polynomials.
    """
    fourth = [
        (
            m,
            math.perm(m + 4, 4) * SIXTHS[m + 4][j],
            math.perm(m + 4, 4) * SIXTHS[m + 4][k],
        )
        for m in range(4)
    ]
    # over 36 * 420 in whole numbers, so that the quotient is the nearest float
    total = sum(
        a * b * (420 // (m + n + 1)) for m, a, _ in fourth for n, _, b in fourth
    )
    return total / (36 * 420)


COST = [[_cost(j, k) for k in range(8)] for j in range(8)]
