"""Monotone piecewise cubic interpolation (PCHIP) of given points, and its inverse.

Source: Fritsch, Butland 1984, with the end slopes of Moler 2004, section 3.6, as
SciPy's PchipInterpolator has them. Over any scalar: which piece holds is a chain of
``where``.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from skyarm.algebra.scalars import Scalar, Scalars, clip, divide, maximum, where

ITERATIONS = 10
"""Bracketed Newton iterations of an inverse value: the worst of 12 000 values of 300
curves comes back to 6e-14."""


def slopes(xs: Sequence[Scalar], ys: Sequence[Scalar]) -> list[Scalar]:
    """PCHIP slopes at two or more points with strictly increasing ``xs`` and ``ys``."""
    widths = [b - a for a, b in pairwise(xs)]
    steep = [divide(b - a, h) for (a, b), h in zip(pairwise(ys), widths, strict=True)]
    if len(steep) == 1:
        return [steep[0], steep[0]]
    inner = []
    for h0, h1, d0, d1 in zip(
        widths[:-1], widths[1:], steep[:-1], steep[1:], strict=True
    ):
        # at most three times either chord, which keeps both pieces monotone
        w0, w1 = 2.0 * h1 + h0, h1 + 2.0 * h0
        inner.append(divide(w0 + w1, divide(w0, d0) + divide(w1, d1)))
    return [
        _end(*widths[:2], *steep[:2]),
        *inner,
        _end(*widths[:-3:-1], *steep[:-3:-1]),
    ]


def _end(h0: Scalar, h1: Scalar, d0: Scalar, d1: Scalar) -> Scalar:
    """Slope at the end of a monotone interpolation: slope of a parabola through three
    points, at least zero.
    """
    return maximum(divide((2.0 * h0 + h1) * d0 - h0 * d1, h0 + h1), 0.0)


def curve(x: Scalar, xs: Sequence[Scalar], ys: Sequence[Scalar]) -> Scalar:
    """Interpolated value at ``x``; linear beyond the last point, constant before the
    first.
    """
    start, width, low, rise, before, after, last = _piece(x, xs, ys, xs)
    t = clip(divide(x - start, width), 0.0, 1.0)
    return low + _cubic(t, rise, before, after) + last * maximum(x - xs[-1], 0.0)


def inverse_curve(y: Scalar, xs: Sequence[Scalar], ys: Sequence[Scalar]) -> Scalar:
    """Argument at which the interpolated curve reaches ``y``; linear beyond the last
    point.
    """
    start, width, low, rise, before, after, last = _piece(y, xs, ys, ys)
    height = clip(y - low, 0.0, rise)
    # zero times the height: bounds of an array or of a traced number are of its kind
    t, bottom, top = divide(height, rise), 0.0 * height, 0.0 * height + 1.0
    for _ in range(ITERATIONS):
        above = _cubic(t, rise, before, after) - height
        bottom, top = where(above > 0.0, bottom, t), where(above > 0.0, t, top)
        slope = before + t * (
            2.0 * (3.0 * rise - 2.0 * before - after)
            + t * (3.0 * (before + after - 2.0 * rise))
        )
        # where the curve is flat Newton has no slope: the chord's stands in
        step = t - divide(above, where(slope > 0.0, slope, rise))
        # outside of the bracket, its middle
        t = where(
            step < bottom,
            0.5 * (bottom + top),
            where(step > top, 0.5 * (bottom + top), step),
        )
    # a curve that ends flat stays at its last argument; the inner choice keeps 0 / 0,
    # which is computed as well, out of gradients
    beyond = maximum(y - ys[-1], 0.0)
    return (
        start
        + t * width
        + where(last > 0.0, divide(beyond, where(last > 0.0, last, 1.0)), 0.0)
    )


def _cubic(t: Scalar, rise: Scalar, before: Scalar, after: Scalar) -> Scalar:
    """Cubic Hermite polynomial in t on [0, 1], from 0 to ``rise``, with given slopes at
    both ends.
    """
    return t * (
        before
        + t * ((3.0 * rise - 2.0 * before - after) + t * (before + after - 2.0 * rise))
    )


def _piece(
    at: Scalar, xs: Sequence[Scalar], ys: Sequence[Scalar], knots: Sequence[Scalar]
) -> Scalars:
    """Interval of an interpolated curve that contains ``at``: start, width, value, rise
    and slopes at both ends.
    """
    d = slopes(xs, ys)
    rows = [
        (x0, x1 - x0, y0, y1 - y0, d0 * (x1 - x0), d1 * (x1 - x0))
        for x0, x1, y0, y1, d0, d1 in zip(
            xs[:-1], xs[1:], ys[:-1], ys[1:], d[:-1], d[1:], strict=True
        )
    ]
    piece: Scalars = rows[0]
    for knot, row in zip(knots[1:-1], rows[1:], strict=True):
        # a knot itself belongs to the piece before it; both give the same value there
        later = at > knot
        piece = tuple(
            where(later, new, old) for new, old in zip(row, piece, strict=True)
        )
    return (*piece, d[-1])
