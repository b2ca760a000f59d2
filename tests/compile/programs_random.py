"""Random programs over scalars, and stepped programs small enough to check by hand."""

from __future__ import annotations

import math
import struct

import numpy as np

from skyarm.algebra import scalars

SPECIAL = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    math.inf,
    -math.inf,
    math.nan,
    5e-324,
    2.5e-310,
    1e308,
    0.5,
    3.0,
    100.0,
    -745.0,
    1e5,
]

BINARY = (
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    scalars.divide,
    scalars.atan2,
    scalars.minimum,
    scalars.maximum,
    lambda a, b: scalars.where(a < b, a, b),
    lambda a, b: scalars.where(
        scalars.logical_and(a <= b, scalars.logical_not(a > 1.0)), b, -a
    ),
    lambda a, b: scalars.where(scalars.logical_or(a >= b, b < 0.0), a - b, a * 0.5),
    lambda a, b: scalars.where(scalars.where(a < 0.0, a < b, b < a), 1.0, b),
    # the sign of a NaN is open: ask for that of a number
    lambda a, b: scalars.functions.copysign(a, scalars.where(b <= b, b, 1.0)),  # noqa: PLR0124
)
UNARY = tuple(
    getattr(scalars, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "exp", "log", "tanh", "sqrt")
)
UNARY += (scalars.absolute, scalars.floor, scalars.sign, lambda a: -a)


def random_function(rng, length=40):
    """A function of any number of scalars that returns every value it made."""
    steps = [
        (rng.random() < 0.5, int(rng.integers(1 << 30)), int(rng.integers(1 << 30)))
        for _ in range(length)
    ]
    steps = (
        [(True, k, k + 1) for k in range(len(BINARY))]
        + [(False, k, k) for k in range(len(UNARY))]
        + steps
    )

    def function(*inputs):
        numbers, made = [*inputs, 0.3, -2.0], []
        for number, (binary, i, j) in enumerate(steps):
            a, b = numbers[i % len(numbers)], numbers[j % len(numbers)]
            pick = (
                (number if number < len(BINARY) else i)
                if binary
                else (number - len(BINARY) if i == j else i)
            )
            made.append(
                BINARY[pick % len(BINARY)](a, b)
                if binary
                else UNARY[pick % len(UNARY)](a)
            )
            numbers.append(made[-1])
        return tuple(made)

    return function


def bits(values):
    """The bytes of floats; every NaN alike, as IEEE leaves its sign and payload
    open.
    """
    return [
        "nan" if math.isnan(x) else struct.pack("<d", x) for x in map(float, values)
    ]


def same_bits(a, b):
    """True where two arrays hold the same bytes, any NaN equal to any other."""
    a, b = np.asarray(a), np.asarray(b)
    whole = np.uint32 if a.dtype == np.float32 else np.uint64
    equal = np.ascontiguousarray(a).view(whole) == np.ascontiguousarray(b).view(whole)
    return a.shape == b.shape and bool(np.all(equal | (np.isnan(a) & np.isnan(b))))


def oscillator(carry, parameters, row, draws):
    """Semi-implicit Euler of a driven spring; logs the energy. One lane is one
    stiffness.
    """
    x, v = carry
    (stiffness,) = parameters
    (force,) = row
    v = v + 0.01 * (force - stiffness * x)
    if draws:
        v = v + 1e-3 * (draws[0] - draws[1])
    x = x + 0.01 * v
    return (x, v), (0.5 * v * v + 0.5 * stiffness * x * x,)
