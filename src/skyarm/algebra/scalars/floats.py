"""Basic operations on Python floats with IEEE results: inf or NaN where Python raises
an error.
"""

from __future__ import annotations

import math
import struct

INF = math.inf
NAN = math.nan


def divide(a: float, b: float) -> float:
    """Quotient a / b with IEEE results for a zero divisor: inf or NaN."""
    if b != 0.0:
        return a / b
    if a == 0.0 or math.isnan(a):
        return NAN
    return math.copysign(INF, a) * math.copysign(1.0, b)


def sqrt(x: float) -> float:
    """Square root, NaN below zero."""
    return math.sqrt(x) if x >= 0.0 else NAN


def floor(x: float) -> float:
    """Largest integer not above x, as a float."""
    # math.floor would lose the sign of -0.0 on its way through an integer
    return float(math.floor(x)) if math.isfinite(x) and x != 0.0 else float(x)


absolute = math.fabs


def copysign(size: float, sign: float) -> float:
    """Magnitude of the first number with the sign of the second, signed zeros
    included.
    """
    return math.copysign(size, sign)


def power_of_two(k: float) -> float:
    """Power 2**k for an integer k; NaN for NaN."""
    # exp halves its exponent, so that a sound k is far within; int() takes no NaN
    return math.ldexp(1.0, int(k)) if -1100.0 < k < 1100.0 else NAN


def exponent(x: float) -> float:
    """Binary exponent e of x, with |x| = m 2**e and 1 <= m < 2."""
    return float(math.frexp(x)[1] - 1) if math.isfinite(x) and x != 0.0 else NAN


def mantissa(x: float) -> float:
    """Binary mantissa m of x, with x = m 2**e and 1 <= |m| < 2."""
    return 2.0 * math.frexp(x)[0] if math.isfinite(x) and x != 0.0 else NAN


def to_single(value: float) -> float:
    """Round a number to 32-bit precision; infinite beyond the range of 32 bits."""
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.copysign(INF, value)


def where(condition: bool, a: float, b: float) -> float:
    """Choose ``a`` where the condition holds, else ``b``; an int becomes a float."""
    chosen = a if condition else b
    return float(chosen) if type(chosen) is int else chosen


def logical_and(a: bool, b: bool) -> bool:
    """Logical and of two conditions."""
    return bool(a and b)


def logical_or(a: bool, b: bool) -> bool:
    """Logical or of two conditions."""
    return bool(a or b)


def logical_not(a: bool) -> bool:
    """Logical negation."""
    return not a
