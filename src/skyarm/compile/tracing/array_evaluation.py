"""Evaluation of a traced program on NumPy arrays, with the same bits as on Python
floats.

NumPy's own sine or exponential may differ from ours in the last bit, so the program's
basic operations are run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from skyarm.algebra import Scalar
from skyarm.compile.tracing.program import Program
from skyarm.records.arrays import AnyArray, Array, doubles


def _mantissa(x: Array) -> Array:
    """Mantissa of each number; NaN for zero, infinity and NaN."""
    return np.where(np.isfinite(x) & (x != 0.0), 2.0 * np.frexp(x)[0], np.nan)


def _exponent(x: Array) -> Array:
    """Binary exponent of each number; NaN for zero, infinity and NaN."""
    return np.where(np.isfinite(x) & (x != 0.0), np.frexp(x)[1] - 1.0, np.nan)


def _power_of_two(k: Array) -> Array:
    """Power 2**k of each number k; NaN outside (-1100, 1100)."""
    # exp halves its exponent, so that a sound k is far within; NaN is no integer
    sound = (k > -1100.0) & (k < 1100.0)
    return np.where(
        sound, np.ldexp(1.0, np.where(sound, k, 0.0).astype(np.int64)), np.nan
    )


OPERATIONS: dict[str, Callable[..., AnyArray]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "lt": np.less,
    "le": np.less_equal,
    "where": np.where,
    "and": np.logical_and,
    "or": np.logical_or,
    "not": np.logical_not,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "floor": np.floor,
    "copysign": np.copysign,
    "power_of_two": _power_of_two,
    "exponent": _exponent,
    "mantissa": _mantissa,
}


def evaluate(
    program: Program, inputs: Sequence[ArrayLike | Scalar], count: int
) -> Array:
    """Evaluate a traced program on arrays of inputs; returns the outputs, shape
    (outputs, count).

    Every column has the bits of :meth:`skyarm.compile.Program.flat` of its inputs.
    """
    lowered = program.lowered
    last = {arg.index: node.index for node in lowered.nodes for arg in node.args}
    results = {node.index for node in lowered.outputs}
    values = {
        node.index: doubles(value)
        for node, value in zip(lowered.inputs, inputs, strict=True)
    }
    # inf and NaN without a word, as from compiled code
    with np.errstate(all="ignore"):
        for node in lowered.nodes:
            if node.op == "const":
                values[node.index] = node.value
            elif node.op != "input":
                values[node.index] = OPERATIONS[node.op](
                    *(values[arg.index] for arg in node.args)
                )
            for arg in node.args:
                # a table of a million rows has room for what is still needed only
                if last[arg.index] == node.index and arg.index not in results:
                    values.pop(arg.index, None)
    rows = [np.broadcast_to(values[node.index], (count,)) for node in lowered.outputs]
    return np.stack(rows).astype(float) if rows else np.zeros((0, count))
