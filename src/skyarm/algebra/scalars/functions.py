"""sin, cos, where ...: each call uses the namespace of its arguments.

Python numbers go to :mod:`skyarm.algebra.scalars.floats`. Arrays go to the library they come from, which must already
be imported for such an array to exist: nothing heavy is imported here. The tracer registers its own node type.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

_PYTHON = (float, int, bool)
_NAMESPACES: dict[type, Any] = {}


def register(kind: type, namespace: Any) -> None:
    """Make ``kind`` a scalar whose functions are the attributes of ``namespace``."""
    _NAMESPACES[kind] = namespace


def _silent(function: Any) -> Any:
    numpy = sys.modules["numpy"]

    def call(*arguments: Any) -> Any:
        with numpy.errstate(all="ignore"):
            return function(*arguments)

    return call


def _array_namespace(xp: Any, wrap: Any = lambda function: function) -> SimpleNamespace:
    names = {"asin": "arcsin", "acos": "arccos", "atan2": "arctan2", "absolute": "abs"}
    elementary = ("sin", "cos", "tan", "sqrt", "exp", "log", "floor", "tanh", "divide")
    same = (*elementary, "where", "logical_and", "logical_or", "logical_not")
    table = {name: name for name in (*same, "copysign")} | names
    found = SimpleNamespace(**{ours: wrap(getattr(xp, theirs)) for ours, theirs in table.items()})
    found.exponent = lambda x: xp.frexp(x)[1] - 1.0
    found.mantissa = lambda x: 2.0 * xp.frexp(x)[0]
    return found


def _casadi_namespace(casadi: Any) -> SimpleNamespace:
    names = {"absolute": "fabs", "where": "if_else"}
    names |= {f"logical_{word}": f"logic_{word}" for word in ("and", "or", "not")}
    same = ("sin", "cos", "tan", "asin", "acos", "atan2", "sqrt", "exp", "log", "floor", "tanh")
    table = {name: name for name in same} | names
    functions = {ours: getattr(casadi, theirs) for ours, theirs in table.items()}
    return SimpleNamespace(divide=lambda a, b: a / b, **functions)


def _discover(kind: type) -> Any:
    """Namespace of an array type, from the library its class or a base class comes from."""
    for base in kind.__mro__:
        root = base.__module__.split(".")[0]
        if root == "numpy":
            return _array_namespace(sys.modules["numpy"], _silent)
        if root in ("jax", "jaxlib"):
            return _array_namespace(sys.modules["jax.numpy"])
        if root == "casadi":
            return _casadi_namespace(sys.modules["casadi"])
    raise TypeError(
        f"{kind.__module__}.{kind.__name__} is not a scalar; allowed: float, NumPy, JAX, CasADi, tracer node"
    )


def _namespace(*values: Any) -> Any:
    """Namespace of the first value that is not a plain Python number."""
    kind: type = float
    for value in values:
        if type(value) not in _PYTHON:
            kind = type(value)
            if kind.__module__.split(".")[0] != "numpy":
                break  # a tracer or JAX value decides over a NumPy constant beside it
    found = _NAMESPACES.get(kind)
    if found is None:
        found = _NAMESPACES[kind] = _discover(kind)
    return found


def copysign(size: Any, sign: Any) -> Any:
    """|size| with the sign of the other, that of a zero too; on floats, NumPy and traced nodes."""
    return _namespace(size, sign).copysign(size, sign)


def power_of_two(k: Any) -> Any:
    """2**k for whole k, exact; on floats and traced nodes."""
    return _namespace(k).power_of_two(k)


def exponent(x: Any) -> Any:
    """Whole e with |x| = m 2**e and 1 <= m < 2; on floats and traced nodes."""
    return _namespace(x).exponent(x)


def mantissa(x: Any) -> Any:
    """m of :func:`exponent`, with the sign of x; on floats and traced nodes."""
    return _namespace(x).mantissa(x)


def sin(x: Any) -> Any:
    """Sine of an angle in rad."""
    return _namespace(x).sin(x)


def cos(x: Any) -> Any:
    """Cosine of an angle in rad."""
    return _namespace(x).cos(x)


def tan(x: Any) -> Any:
    """Tangent of an angle in rad."""
    return _namespace(x).tan(x)


def asin(x: Any) -> Any:
    """Inverse sine, NaN outside [-1, 1]."""
    return _namespace(x).asin(x)


def acos(x: Any) -> Any:
    """Inverse cosine, NaN outside [-1, 1]."""
    return _namespace(x).acos(x)


def atan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y) in rad, in [-pi, pi]."""
    return _namespace(y, x).atan2(y, x)


def sqrt(x: Any) -> Any:
    """Square root, NaN below zero."""
    return _namespace(x).sqrt(x)


def exp(x: Any) -> Any:
    """Exponential, inf on overflow."""
    return _namespace(x).exp(x)


def log(x: Any) -> Any:
    """Natural logarithm, -inf at zero, NaN below."""
    return _namespace(x).log(x)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent."""
    return _namespace(x).tanh(x)


def absolute(x: Any) -> Any:
    """|x|."""
    return _namespace(x).absolute(x)


def floor(x: Any) -> Any:
    """Largest whole number not above x."""
    return _namespace(x).floor(x)


def divide(a: Any, b: Any) -> Any:
    """Return a / b with IEEE zeros; use it wherever the denominator can vanish."""
    if type(b) is int and b == 1:
        return a
    return _namespace(a, b).divide(a, b)


def where(condition: Any, a: Any, b: Any) -> Any:
    """Choose ``a`` where the condition holds, else ``b``; both are evaluated."""
    return _namespace(condition, a, b).where(condition, a, b)


def logical_and(a: Any, b: Any) -> Any:
    """Both conditions."""
    return _namespace(a, b).logical_and(a, b)


def logical_or(a: Any, b: Any) -> Any:
    """Either condition."""
    return _namespace(a, b).logical_or(a, b)


def logical_not(a: Any) -> Any:
    """Opposite condition."""
    return _namespace(a).logical_not(a)


def minimum(value: Any, bound: Any) -> Any:
    """Return the smaller of two; a NaN in ``value`` stays NaN, so a crash is never hidden by a limit."""
    return where(bound < value, bound, value)


def maximum(value: Any, bound: Any) -> Any:
    """Return the larger of two; a NaN in ``value`` stays NaN, so a crash is never hidden by a limit."""
    return where(bound > value, bound, value)


def clip(value: Any, lower: Any, upper: Any) -> Any:
    """Value held between two limits; NaN stays NaN."""
    return minimum(maximum(value, lower), upper)


def sign(x: Any) -> Any:
    """-1, 0 or +1."""
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, x))  # what is left is a signed zero or NaN
