"""IEEE versions of the functions of ``math``: inf or NaN where ``math`` raises."""

from __future__ import annotations

import math

INF = math.inf
NAN = math.nan


def divide(a: float, b: float) -> float:
    """Return a / b with IEEE zeros: x/0 = +-inf, 0/0 = NaN."""
    if b != 0.0:
        return a / b
    if a == 0.0 or math.isnan(a):
        return NAN
    return math.copysign(INF, a) * math.copysign(1.0, b)


def sin(x: float) -> float:
    """Return sin x, NaN at infinity."""
    return math.sin(x) if math.isfinite(x) else NAN


def cos(x: float) -> float:
    """Return cos x, NaN at infinity."""
    return math.cos(x) if math.isfinite(x) else NAN


def tan(x: float) -> float:
    """Return tan x, NaN at infinity."""
    return math.tan(x) if math.isfinite(x) else NAN


def asin(x: float) -> float:
    """Return asin x, NaN outside [-1, 1]."""
    return math.asin(x) if -1.0 <= x <= 1.0 else NAN


def acos(x: float) -> float:
    """Return acos x, NaN outside [-1, 1]."""
    return math.acos(x) if -1.0 <= x <= 1.0 else NAN


def sqrt(x: float) -> float:
    """Square root, NaN below zero."""
    return math.sqrt(x) if x >= 0.0 else NAN


def exp(x: float) -> float:
    """e**x, +inf on overflow."""
    try:
        return math.exp(x)
    except OverflowError:
        return INF


def log(x: float) -> float:
    """Natural logarithm: -inf at zero, NaN below."""
    if x > 0.0:
        return math.log(x)
    return -INF if x == 0.0 else NAN


def floor(x: float) -> float:
    """Largest whole number not above x, as a float."""
    # math.floor would lose the sign of -0.0 on its way through an integer
    return float(math.floor(x)) if math.isfinite(x) and x != 0.0 else float(x)


atan2 = math.atan2
tanh = math.tanh
absolute = math.fabs


def where(condition: bool, a: float, b: float) -> float:
    """Choose ``a`` where the condition holds, else ``b``; what was chosen is data: an integer becomes a float."""
    chosen = a if condition else b
    return float(chosen) if type(chosen) is int else chosen


def logical_and(a: bool, b: bool) -> bool:
    """Both."""
    return bool(a and b)


def logical_or(a: bool, b: bool) -> bool:
    """Either."""
    return bool(a or b)


def logical_not(a: bool) -> bool:
    """Not a."""
    return not a
