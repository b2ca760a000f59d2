"""Basic operations on Python floats with IEEE results: inf or NaN where Python raises."""

from __future__ import annotations

import math
import struct

INF = math.inf
NAN = math.nan


def divide(a: float, b: float) -> float:
    """Return a / b with IEEE zeros: x/0 = +-inf, 0/0 = NaN."""
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
    """Magnitude of the first number with the sign of the second, signed zeros included."""
    return math.copysign(size, sign)


def power_of_two(k: float) -> float:
    """Return 2**k for an integer k from -1022 to 1023; NaN for NaN."""
    return math.ldexp(1.0, int(k)) if -1100.0 < k < 1100.0 else NAN


def exponent(x: float) -> float:
    """Binary exponent e of |x| = m 2**e with 1 <= m < 2, for normal numbers."""
    return float(math.frexp(x)[1] - 1) if math.isfinite(x) and x != 0.0 else NAN


def mantissa(x: float) -> float:
    """Binary mantissa m of x = m 2**e with 1 <= |m| < 2."""
    return 2.0 * math.frexp(x)[0] if math.isfinite(x) and x != 0.0 else NAN


def to_single(value: float) -> float:
    """Nearest number of 32 bits; infinite beyond their range."""
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
