"""Scalar functions sin, cos, where and others, dispatched on the type of their
arguments.

Python numbers go to :mod:`skyarm.algebra.scalars.floats`. Arrays go to the library they
come from, which must already be imported for such an array to exist: nothing heavy is
imported here. The tracer registers its own node type.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

from skyarm.algebra.scalars.fold import Scalar

Function = Callable[..., Scalar]

_PYTHON = (float, int, bool)
_NAMESPACES: dict[type, Any] = {}
_OVER_OTHERS: set[type] = set()
_DECIDED: dict[type | tuple[type, ...], Any] = {}
"""Implementation by the type of one argument or the types of several, since formulas in
floats ask for it most."""


def register(kind: type, namespace: Any, *, over_others: bool = False) -> None:
    """Register the module ``namespace`` that implements sin, where and other functions
    for a scalar type.

    With ``over_others`` it also decides where an argument of another type stands
    before, as a series over its coefficients.
    """
    _NAMESPACES[kind] = namespace
    if over_others:
        _OVER_OTHERS.add(kind)
    # what was decided before may fall to the new kind
    _DECIDED.clear()


def _silent(function: Function) -> Function:
    numpy = sys.modules["numpy"]

    def call(*arguments: Scalar) -> Scalar:
        # where evaluates both branches: what is not taken must not warn
        with numpy.errstate(all="ignore"):
            return function(*arguments)

    return call


def _array_namespace(
    xp: ModuleType, wrap: Callable[[Function], Function] = lambda function: function
) -> SimpleNamespace:
    names = {"asin": "arcsin", "acos": "arccos", "atan2": "arctan2", "absolute": "abs"}
    elementary = ("sin", "cos", "tan", "sqrt", "exp", "log", "floor", "tanh", "divide")
    same = (*elementary, "where", "logical_and", "logical_or", "logical_not")
    table = {name: name for name in (*same, "copysign")} | names
    namespace = SimpleNamespace(
        **{ours: wrap(getattr(xp, theirs)) for ours, theirs in table.items()}
    )
    # frexp's mantissa is in [0.5, 1), ours in [1, 2): one more in the exponent
    namespace.exponent = lambda x: xp.frexp(x)[1] - 1.0
    namespace.mantissa = lambda x: 2.0 * xp.frexp(x)[0]
    # ldexp takes exponents of an integer type only
    namespace.power_of_two = lambda k: xp.ldexp(1.0, k.astype(int))
    return namespace


def _casadi_namespace(casadi: ModuleType) -> SimpleNamespace:
    names = {"absolute": "fabs", "where": "if_else"}
    names |= {f"logical_{word}": f"logic_{word}" for word in ("and", "or", "not")}
    same = (
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan2",
        "sqrt",
        "exp",
        "log",
        "floor",
        "tanh",
    )
    table = {name: name for name in same} | names
    functions = {ours: getattr(casadi, theirs) for ours, theirs in table.items()}
    # CasADi's own division has IEEE's results
    return SimpleNamespace(divide=lambda a, b: a / b, **functions)


def _discover(kind: type) -> SimpleNamespace:
    """Find the functions of an array type in the library that defines the type."""
    # a subclass of an array type, as a user may have, has its library's functions
    for base in kind.__mro__:
        root = base.__module__.split(".")[0]
        if root == "numpy":
            return _array_namespace(sys.modules["numpy"], _silent)
        if root in ("jax", "jaxlib"):
            return _array_namespace(sys.modules["jax.numpy"])
        if root == "casadi":
            return _casadi_namespace(sys.modules["casadi"])
    raise TypeError(
        f"{kind.__module__}.{kind.__name__} is not a scalar; allowed: float, NumPy,"
        " JAX, CasADi, tracer node"
    )


def _decide(*values: Scalar) -> Any:
    """Find the implementation of scalar functions for the types of some values, and
    keep it.
    """
    kind: type = float
    kinds = tuple(map(type, values))
    for each in kinds:
        if each in _OVER_OTHERS:
            kind = each
            break
        # a tracer or JAX value decides over a NumPy constant beside it
        if each not in _PYTHON and kind.__module__.split(".")[0] in (
            "builtins",
            "numpy",
        ):
            kind = each
    namespace = _NAMESPACES.get(kind)
    if namespace is None:
        namespace = _NAMESPACES[kind] = _discover(kind)
    _DECIDED[kinds if len(kinds) > 1 else kinds[0]] = namespace
    return namespace


def _function(name: str, meaning: str, arguments: int = 1) -> Function:
    """Make a scalar function that looks up its implementation by the type of its
    arguments.

    It is written for each number of them: to collect them in a tuple took longer than
    most of the functions.
    """

    def of_one(x: Scalar) -> Any:
        return getattr(_DECIDED.get(type(x)) or _decide(x), name)(x)

    def of_two(a: Scalar, b: Scalar) -> Any:
        return getattr(_DECIDED.get((type(a), type(b))) or _decide(a, b), name)(a, b)

    def of_three(a: Scalar, b: Scalar, c: Scalar) -> Any:
        return getattr(
            _DECIDED.get((type(a), type(b), type(c))) or _decide(a, b, c), name
        )(a, b, c)

    call = (of_one, of_two, of_three)[arguments - 1]
    call.__name__ = call.__qualname__ = name
    call.__doc__ = meaning
    return call


copysign = _function(
    "copysign",
    "|a| with the sign of b, that of a zero too; on floats, NumPy and traced nodes.",
    2,
)
power_of_two = _function(
    "power_of_two", "2**k for whole k, exact; on floats, NumPy and traced nodes."
)
exponent = _function(
    "exponent", "Whole e with |x| = m 2**e and 1 <= m < 2; on floats and traced nodes."
)
mantissa = _function(
    "mantissa", "m of exponent, with the sign of x; on floats and traced nodes."
)
sin = _function("sin", "Sine of an angle in rad.")
cos = _function("cos", "Cosine of an angle in rad.")
tan = _function("tan", "Tangent of an angle in rad.")
asin = _function("asin", "Inverse sine, NaN outside [-1, 1].")
acos = _function("acos", "Inverse cosine, NaN outside [-1, 1].")
atan2 = _function(
    "atan2", "Angle of the point (x, y) from y and x, in rad, in [-pi, pi].", 2
)
sqrt = _function("sqrt", "Square root, NaN below zero.")
exp = _function("exp", "Exponential, inf on overflow.")
log = _function("log", "Natural logarithm, -inf at zero, NaN below.")
tanh = _function("tanh", "Hyperbolic tangent.")
absolute = _function("absolute", "|x|.")
floor = _function("floor", "Largest whole number not above x.")
where = _function(
    "where",
    "where(condition, a, b): a where the condition holds, else b; both are evaluated.",
    3,
)
logical_and = _function("logical_and", "Both conditions.", 2)
logical_or = _function("logical_or", "Either condition.", 2)
logical_not = _function("logical_not", "Opposite condition.")
_quotient = _function("divide", "a / b with IEEE results for division by zero.", 2)


def divide(a: Scalar, b: Scalar) -> Scalar:
    """Quotient a / b with IEEE results for division by zero."""
    if type(b) is int and b == 1:
        return a
    return _quotient(a, b)


def minimum(value: Scalar, bound: Scalar) -> Scalar:
    """Smaller of two numbers; a NaN in ``value`` stays NaN, so that limits never hide a
    failure.
    """
    return where(bound < value, bound, value)


def maximum(value: Scalar, bound: Scalar) -> Scalar:
    """Larger of two numbers; a NaN in ``value`` stays NaN, so that limits never hide a
    failure.
    """
    return where(bound > value, bound, value)


def clip(value: Scalar, lower: Scalar, upper: Scalar) -> Scalar:
    """Value limited to the range from ``lower`` to ``upper``; NaN stays NaN."""
    return minimum(maximum(value, lower), upper)


def sign(x: Scalar) -> Scalar:
    """Sign of a number: -1, 0 or +1."""
    # what is left is a signed zero or NaN
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, x))
