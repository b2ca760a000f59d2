"""Programs of drawn operations, interpreted on any scalars."""

from __future__ import annotations

import math
import struct

from hypothesis import strategies as st

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
    -5e-324,
    1.7976931348623157e308,
    0.5,
    2.0,
]
value = st.one_of(st.sampled_from(SPECIAL), st.floats(width=64))
STRUCTURE = (0, 1, -1)
INPUTS = 3
BINARY = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "divide": scalars.divide,
    "add": scalars.add,
    "sub": scalars.sub,
    "mul": scalars.mul,
    "atan2": scalars.atan2,
    "minimum": scalars.minimum,
    "maximum": scalars.maximum,
}
UNARY = {
    name: getattr(scalars, name)
    for name in ("sin", "cos", "tan", "asin", "acos", "sqrt", "exp", "log", "tanh")
}
COMPARE = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}
index = st.integers(0, 10**6)
step = st.one_of(
    st.tuples(st.just("binary"), st.sampled_from(sorted(BINARY)), index, index),
    st.tuples(st.just("binary"), st.sampled_from("+-*"), index, index),
    st.tuples(st.just("unary"), st.sampled_from(["-", "neg"]), index),
    st.tuples(st.just("unary"), st.sampled_from(sorted(UNARY)), index),
    st.tuples(st.just("compare"), st.sampled_from(sorted(COMPARE)), index, index),
    st.tuples(st.just("logic"), st.sampled_from(["and", "or", "not"]), index, index),
    st.tuples(st.just("where"), index, index, index),
)


def run(steps, constants, inputs):
    """Interpret a random program on any scalars; every value it made is an output."""
    numbers, conditions = [*inputs, *constants, *STRUCTURE], [inputs[0] < inputs[1]]
    made = []
    for kind, *rest in steps:
        if kind == "logic":
            word, i, j = rest
            p, q = conditions[i % len(conditions)], conditions[j % len(conditions)]
            pair = (p,) if word == "not" else (p, q)
            conditions.append(getattr(scalars, f"logical_{word}")(*pair))
            continue
        if kind == "compare":
            name, i, j = rest
            conditions.append(
                COMPARE[name](numbers[i % len(numbers)], numbers[j % len(numbers)])
            )
            continue
        if kind == "where":
            c, i, j = rest
            new = scalars.where(
                conditions[c % len(conditions)],
                numbers[i % len(numbers)],
                numbers[j % len(numbers)],
            )
        else:
            name, *operands = rest
            new = (BINARY if kind == "binary" else UNARY)[name](
                *(numbers[i % len(numbers)] for i in operands)
            )
        if type(new) is int and abs(new) > 1000:
            new = float(new)
        numbers.append(new)
        made.append(new)
    return (*made, *(scalars.where(condition, 1.0, 0.0) for condition in conditions))


def bits(x):
    """The bytes of a float; every NaN alike, as IEEE leaves its sign and payload
    open.
    """
    return "nan" if math.isnan(x) else struct.pack("<d", x)
