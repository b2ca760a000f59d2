"""Python's own numbers as scalars: basic operations of :mod:`.floats`, functions of :mod:`.elementary`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from skyarm.scalars import floats
from skyarm.scalars.elementary import COMPOSED
from skyarm.scalars.functions import register

BASIC = ("divide", "sqrt", "floor", "absolute", "where", "logical_and", "logical_or", "logical_not")
BITS = ("copysign", "power_of_two", "exponent", "mantissa")

NAMESPACE: Any = SimpleNamespace(**{name: getattr(floats, name) for name in (*BASIC, *BITS)}, **COMPOSED)

for kind in (float, int, bool):
    register(kind, NAMESPACE)
