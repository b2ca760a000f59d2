"""Elementary functions over any scalar type: float, NumPy array, JAX array, CasADi SX,
symbolic value.

Laws of plant and control use these functions and + - * / only, so that one source runs
on every engine. Two rules hold everywhere:

* IEEE: inf or NaN where Python's own ``math`` would raise, because ``where`` evaluates
  both of its branches.
* An ``int`` is *structure* (a zero or a one of the description, known when the program
  is built) and may fold away; a ``float`` is *data*, may vary from lane to lane and is
  never folded, even when it happens to be 0.0.
"""

from skyarm.algebra.scalars.elementary import NAMESPACE as PYTHON_NUMBERS
from skyarm.algebra.scalars.fold import (
    Scalar,
    Scalars,
    add,
    data,
    mul,
    neg,
    same,
    structural,
    sub,
    total,
)
from skyarm.algebra.scalars.functions import (
    absolute,
    acos,
    asin,
    atan2,
    clip,
    cos,
    divide,
    exp,
    floor,
    log,
    logical_and,
    logical_not,
    logical_or,
    maximum,
    minimum,
    register,
    sign,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)

__all__ = [
    "PYTHON_NUMBERS",
    "Scalar",
    "Scalars",
    "absolute",
    "acos",
    "add",
    "asin",
    "atan2",
    "clip",
    "cos",
    "data",
    "divide",
    "exp",
    "floor",
    "log",
    "logical_and",
    "logical_not",
    "logical_or",
    "maximum",
    "minimum",
    "mul",
    "neg",
    "register",
    "same",
    "sign",
    "sin",
    "sqrt",
    "structural",
    "sub",
    "tan",
    "tanh",
    "total",
    "where",
]
