"""Scalar arithmetic that simplifies operations with the integer constants 0, 1 and -1.

Only exact IEEE identities are used (x * 1 = x, x + 0 = x for a structural zero, (-1) *
x = -x), so folding never changes the value of a program, whatever engine runs it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol


class Scalar(Protocol):
    """Interface (typing.Protocol) of scalars: floats, arrays of NumPy or JAX, symbolic
    values; an int is a constant.
    """

    def __add__(self, other: Any, /) -> Scalar: ...
    def __radd__(self, other: Any, /) -> Scalar: ...
    def __sub__(self, other: Any, /) -> Scalar: ...
    def __rsub__(self, other: Any, /) -> Scalar: ...
    def __mul__(self, other: Any, /) -> Scalar: ...
    def __rmul__(self, other: Any, /) -> Scalar: ...
    def __truediv__(self, other: Any, /) -> Scalar: ...
    def __rtruediv__(self, other: Any, /) -> Scalar: ...
    def __neg__(self) -> Scalar: ...
    def __float__(self) -> float: ...
    def __lt__(self, other: Any, /) -> Any: ...
    def __le__(self, other: Any, /) -> Any: ...
    def __gt__(self, other: Any, /) -> Any: ...
    def __ge__(self, other: Any, /) -> Any: ...


Scalars = tuple[Scalar, ...]
"""Row of scalars, such as one number for each joint or rotor."""


def structural(value: float) -> int | float:
    """Convert an exact 0, 1 or -1 to an int, a compile-time constant; any other number
    to a float.
    """
    # a description's exact 0 or 1 is meant: it may fold, as any other number may not
    return int(value) if value in (0.0, 1.0, -1.0) else float(value)


def data(value: Scalar) -> Scalar:
    """Convert an integer constant to a float, which is stored as data; other scalars
    are returned unchanged.
    """
    return float(value) if type(value) is int else value


def same(a: Scalar, b: Scalar) -> bool:
    """True if two scalars are the same object, or equal plain numbers of one type."""
    return a is b or (type(a) is type(b) and type(a) in (int, float) and a == b)


def add(a: Scalar, b: Scalar) -> Scalar:
    """Sum a + b; a constant (int) zero is folded."""
    if type(a) is int and a == 0:
        return b
    if type(b) is int and b == 0:
        return a
    return a + b


def sub(a: Scalar, b: Scalar) -> Scalar:
    """Difference a - b; a constant (int) zero is folded."""
    if type(b) is int and b == 0:
        return a
    if type(a) is int and a == 0:
        return -b
    return a - b


def neg(a: Scalar) -> Scalar:
    """Negative of a scalar."""
    return -a


def total(terms: Iterable[Scalar]) -> Scalar:
    """Sum of scalars in their order; constant (int) zeros are folded."""
    partial_sum: Scalar = 0
    for term in terms:
        partial_sum = add(partial_sum, term)
    return partial_sum


def mul(a: Scalar, b: Scalar) -> Scalar:
    """Product a * b; constants (int) 0, 1 and -1 are folded."""
    if type(a) is int:
        if a == 0:
            return 0
        if a == 1:
            return b
        if a == -1:
            return -b
    if type(b) is int:
        if b == 0:
            return 0
        if b == 1:
            return a
        if b == -1:
            return -a
    return a * b
