"""Truncated Taylor series as a scalar type, for exact time derivatives of functions
over any scalar.

A series holds x(t0 + s) = c_0 + c_1 s + ... + c_K s^K; the k-th derivative is k! c_k.
Coefficients are scalars of any kind and structural zeros among them fold, so that a
constant costs nothing.
Source: Griewank, Walther 2008, section 13.2 (recurrences of products, quotients, roots,
sine and cosine).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Sequence

from skyarm.algebra.scalars import functions
from skyarm.algebra.scalars.fold import Scalar, Scalars, add, data, mul, neg, sub, total


def _comparison(
    compare: Callable[[Scalar, Scalar], Scalar],
) -> Callable[[Taylor, Scalar], Scalar]:
    """Make a comparison operator of Taylor series, which compares their values."""

    def method(self: Taylor, other: Scalar) -> Scalar:
        return compare(self.c[0], other.c[0] if isinstance(other, Taylor) else other)

    return method


class Taylor:
    """Truncated Taylor series as a scalar type; an operation on two series keeps the
    lower order.
    """

    __slots__ = ("c",)
    __array_ufunc__ = None

    def __init__(self, coefficients: Sequence[Scalar]) -> None:
        self.c = tuple(coefficients)

    @classmethod
    def of_derivatives(cls, derivatives: Sequence[Scalar]) -> Taylor:
        """Taylor series from value, first derivative, second derivative and so on."""
        # factors of 0! and 1! are ints, which fold
        return cls(
            [
                mul(d, 1 if k < 2 else 1.0 / math.factorial(k))
                for k, d in enumerate(derivatives)
            ]
        )

    @classmethod
    def constant(cls, value: Scalar, order: int) -> Taylor:
        """Taylor series of a constant."""
        return cls((value, *(0,) * order))

    def derivative(self, k: int) -> Scalar:
        """Value of the k-th derivative of a Taylor series."""
        return mul(self.c[k], 1 if k < 2 else float(math.factorial(k)))

    def derivative_series(self) -> Taylor:
        """Taylor series of the first derivative, one order lower."""
        return Taylor(
            [mul(c, 1 if k == 1 else float(k)) for k, c in enumerate(self.c) if k]
        )

    def truncate(self, order: int) -> Taylor:
        """Taylor series truncated to a lower order."""
        return Taylor(self.c[: order + 1])

    def _terms(self, other: Scalar) -> Scalars:
        """Coefficients of an operand; a plain scalar counts as a constant series."""
        return (
            other.c if isinstance(other, Taylor) else (other, *(0,) * (len(self.c) - 1))
        )

    def __add__(self, other: Scalar) -> Taylor:
        """Sum of two Taylor series."""
        return Taylor([*map(add, self.c, self._terms(other))])

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Taylor:
        """Difference of two Taylor series."""
        return Taylor([*map(sub, self.c, self._terms(other))])

    def __rsub__(self, other: Scalar) -> Taylor:
        """Difference of a constant and this Taylor series."""
        return Taylor([*map(sub, self._terms(other), self.c)])

    def __neg__(self) -> Taylor:
        """Negated Taylor series."""
        return Taylor([*map(neg, self.c)])

    def __mul__(self, other: Scalar) -> Taylor:
        """Product of two Taylor series (Cauchy product)."""
        if not isinstance(other, Taylor):
            return Taylor([mul(a, other) for a in self.c])
        a, b = self.c, other.c
        # the lower order of both: beyond it one factor's coefficients are unknown
        return Taylor(
            [
                total(mul(a[j], b[k - j]) for j in range(k + 1))
                for k in range(min(len(a), len(b)))
            ]
        )

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Taylor:
        """Quotient of two Taylor series."""
        b = self._terms(other)
        # one division for all coefficients
        inverse = functions.divide(1.0, b[0])
        q: list[Scalar] = []
        for k, a in enumerate(self.c[: len(b)]):
            for j in range(1, k + 1):
                a = sub(a, mul(b[j], q[k - j]))  # noqa: PLW2901
            q.append(mul(a, inverse))
        return Taylor(q)

    def __rtruediv__(self, other: Scalar) -> Taylor:
        """Quotient of a constant and this Taylor series."""
        return Taylor(self._terms(other)) / self

    __lt__, __le__ = _comparison(operator.lt), _comparison(operator.le)
    __gt__, __ge__ = _comparison(operator.gt), _comparison(operator.ge)

    def __float__(self) -> float:
        """Raise an error: a Taylor series is not a number."""
        raise TypeError("float() of a Taylor series; take derivative(0)")

    def __repr__(self) -> str:
        """Text with the coefficients of the Taylor series."""
        return f"Taylor({', '.join(map(repr, self.c))})"


def _sine_cosine(x: Taylor) -> tuple[Taylor, Taylor]:
    """Taylor series of sine and cosine of a series, by their recurrences."""
    s, c = [functions.sin(x.c[0])], [functions.cos(x.c[0])]
    slope = [mul(float(j), x.c[j]) if j > 1 else x.c[j] for j in range(len(x.c))]
    for k in range(1, len(x.c)):
        up: Scalar = 0
        down: Scalar = 0
        for j in range(1, k + 1):
            up, down = (
                add(up, mul(slope[j], c[k - j])),
                add(down, mul(slope[j], s[k - j])),
            )
        # an int 1 folds: no multiplication for the first coefficient
        share = 1 if k == 1 else 1.0 / k
        s.append(mul(up, share))
        c.append(mul(neg(down), share))
    return Taylor(s), Taylor(c)


class _TaylorFunctions:
    """Scalar functions of Taylor series, as a namespace for
    :mod:`skyarm.algebra.scalars`.
    """

    @staticmethod
    def sin(x: Taylor) -> Taylor:
        return _sine_cosine(x)[0]

    @staticmethod
    def cos(x: Taylor) -> Taylor:
        return _sine_cosine(x)[1]

    @staticmethod
    def sqrt(x: Taylor) -> Taylor:
        root = [functions.sqrt(x.c[0])]
        # one division for all coefficients
        half = functions.divide(0.5, root[0])
        for k in range(1, len(x.c)):
            rest = x.c[k]
            for j in range(1, k):
                rest = sub(rest, mul(root[j], root[k - j]))
            root.append(mul(rest, half))
        return Taylor(root)

    @staticmethod
    def absolute(x: Taylor) -> Taylor:
        return choose(x < 0.0, -x, x)

    @staticmethod
    def divide(a: Scalar, b: Scalar) -> Scalar:
        return a / b

    @staticmethod
    def where(condition: Scalar, a: Scalar, b: Scalar) -> Taylor:
        return choose(condition, a, b)


def as_series(x: Scalar, order: int) -> Taylor:
    """A Taylor series as it is; any other scalar as the series of a constant."""
    return x if isinstance(x, Taylor) else Taylor.constant(x, order)


def nth_derivative(x: Scalar, k: int) -> Scalar:
    """Value of the k-th derivative of a Taylor series; any other scalar is a
    constant.
    """
    return x.derivative(k) if isinstance(x, Taylor) else x if k == 0 else 0


def inverse_root(x: Scalar, halvings: int = 1) -> Scalar:
    """Power x^(-1/2), with two ``halvings`` x^(-1/4), and so on, of a positive scalar
    or Taylor series.

    The series of p = x^a follows from x p' = a x' p.
    """
    value = x.c[0] if isinstance(x, Taylor) else x
    for _ in range(halvings):
        value = functions.sqrt(value)
    value = functions.divide(1.0, value)
    if not isinstance(x, Taylor):
        return value
    exponent, coefficients = -(0.5**halvings), [value]
    # (x^-1/2)^2 = 1 / x saves a division
    inverse = mul(value, value) if halvings == 1 else functions.divide(1.0, x.c[0])
    steps = [mul(c, inverse) for c in x.c]
    for k in range(1, len(x.c)):
        terms = (
            mul(mul(steps[j], coefficients[k - j]), ((exponent + 1.0) * j - k) / k)
            for j in range(1, k + 1)
        )
        coefficients.append(total(terms))
    return Taylor(coefficients)


def choose(condition: Scalar, a: Scalar, b: Scalar) -> Taylor:
    """Select one of two Taylor series by a condition on values."""
    order = next(len(x.c) for x in (a, b) if isinstance(x, Taylor)) - 1
    pairs = zip(as_series(a, order).c, as_series(b, order).c, strict=False)
    return Taylor(
        [
            # zero in both, as structure, stays so: a constant goes on costing nothing
            (
                0
                if type(x) is int and type(y) is int and x == y == 0
                else functions.where(condition, data(x), data(y))
            )
            for x, y in pairs
        ]
    )


functions.register(Taylor, _TaylorFunctions(), over_others=True)
