"""Traced functions as CasADi functions of SX, for optimisation: exact derivatives, and C code by CasADi.

Derivatives are CasADi's. ``where`` becomes ``if_else``, whose derivative multiplies the slope of the branch that is not
taken by zero: an infinite slope there (the square root in a norm at exactly 0) gives NaN. Start away from such points.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import casadi

from skyarm.compile.tracing.program import Program, trace
from skyarm.compile.tracing.tracer import Node
from skyarm.records.leaves import is_record, leaves, parts

_SAME = ("sqrt", "floor", "copysign", "sin", "cos", "tan", "asin", "acos", "atan2", "exp", "log", "tanh")

_FORMS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "lt": lambda a, b: a < b,
    "le": lambda a, b: a <= b,
    "where": casadi.if_else,
    "and": casadi.logic_and,
    "or": casadi.logic_or,
    "not": casadi.logic_not,
    "abs": casadi.fabs,
}

OPERATIONS: dict[str, Callable[..., Any]] = _FORMS | {name: getattr(casadi, name) for name in _SAME}
"""Operations of a traced program on SX: CasADi's own sin, exp ..., which it can differentiate."""


def casadi_function(
    function: Callable[..., Any],
    *examples: Any,
    name: str = "function",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> Any:
    """A ``casadi.Function`` of SX with one column vector per argument, holding the leaves in order.

    Args:
        function: takes records, returns one; or a :class:`Program`, which needs no examples.
        examples: one record per argument; integers stay structure and are no entries of the vectors.
        name: of the CasADi function.
        inputs: names of the vectors; the arguments' own names if left out.
        outputs: names of the results; if left out the fields of a dataclass, "out0", "out1" ... of a tuple, else "out".
            One name for a record of several parts joins them into one vector.

    Raises:
        ValueError: names that do not fit, or an operation on the bits of a float, which CasADi does not have.
        TracedBranchError: the function branches on a traced value.
    """
    program = function if isinstance(function, Program) else trace(function, *examples)
    records, result = program._examples, program._result
    names = list(inputs) if inputs is not None else _argument_names(function, len(records))
    if len(names) != len(records):
        raise ValueError(f"inputs = {names}: {len(names)} names, must be {len(records)}, one an argument")
    vectors = [casadi.SX.sym(label, len(leaves(record))) for label, record in zip(names, records, strict=True)]
    values = iter(_values(program, [vector[i] for vector in vectors for i in range(vector.numel())]))
    parts = _parts(result)
    labels = list(outputs) if outputs is not None else list(parts)
    if len(labels) not in (1, len(parts)):
        raise ValueError(f"outputs = {labels}: {len(labels)} names, must be 1 or {len(parts)}, as {list(parts)}")
    shapes = [result] if len(labels) == 1 else list(parts.values())
    results = [_column([next(values) for _ in leaves(shape)]) for shape in shapes]
    return casadi.Function(name, vectors, results, names, labels)


def _values(program: Program, scalars: Sequence[Any]) -> list[Any]:
    """Outputs of a program on SX."""
    known: dict[int, Any] = {node.index: value for node, value in zip(program.inputs, scalars, strict=True)}
    for node in program.nodes:
        if node.op == "const":
            known[node.index] = casadi.SX(float(node.value))
        elif node.op != "input":
            known[node.index] = _operation(node)(*(known[arg.index] for arg in node.args))
    return [known[node.index] for node in program.outputs]


def _operation(node: Node) -> Callable[..., Any]:
    if node.op not in OPERATIONS:
        raise ValueError(f"{node.op}: CasADi has no such operation; allowed: {', '.join(sorted(OPERATIONS))}")
    return OPERATIONS[node.op]


def _column(values: list[Any]) -> Any:
    return casadi.vertcat(*values) if values else casadi.SX(0, 1)


def _argument_names(function: Any, count: int) -> list[str]:
    """Names of a function's positional arguments; x0, x1 ... where it has none to tell."""
    if not isinstance(function, Program):
        kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
        found = [name for name, one in inspect.signature(function).parameters.items() if one.kind in kinds]
        # CasADi takes no name that begins with an underscore
        if len(found) >= count and not any(name.startswith("_") for name in found[:count]):
            return found[:count]
    return [f"x{i}" for i in range(count)]


def _parts(result: Any) -> dict[str, Any]:
    """Named parts of a result."""
    if is_record(result):
        return parts(result)
    if isinstance(result, tuple) and result:
        return {f"out{i}": part for i, part in enumerate(result)}
    return {"out": result}
