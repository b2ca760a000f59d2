"""Check for hidden state: comparison of a function on floats with its traced program.

A program is traced once and runs for ever. What a function keeps in a closure, a global or an attribute is frozen in
it, and nobody sees. Therefore it is called with floats for some periods, traced twice, and compared.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

from skyarm.compile.tracing.program import Program, trace
from skyarm.compile.tracing.tracer import Node
from skyarm.records.leaves import leaves, rebuild

PERIODS = 20
"""Control periods that are compared."""

OUTSIDE = "it keeps state outside its memory: a closure, a global, an attribute, random numbers or a clock"

Numbers = tuple[float, ...]


def compare_with_floats(
    function: Callable[..., tuple[Any, Any]],
    memory: Any,
    instants: Sequence[tuple[Any, ...]],
    refuse: Callable[[str], Exception],
    *,
    constants: Any = (),
    names: Sequence[str] = (),
    first: Callable[[Any, Numbers], None] | None = None,
) -> None:
    """Raise an error for a function whose result depends on anything but its arguments.

    Args:
        function: (memory, *arguments of an instant) -> (memory, result), records over any scalar.
        memory: its first one.
        instants: arguments of each period, records of floats of one structure.
        refuse: makes the error to raise of what is wrong.
        constants: record of floats that it reads and must not write.
        names: of memory, arguments and constants, for messages.
        first: called with the arguments and the result of the first period.

    Raises:
        Exception: as ``refuse`` makes it.
    """
    start = rebuild(memory, iter([float(leaf) for leaf in leaves(memory)]))
    told = _call_with_floats(function, start, instants, refuse, constants, names)
    program = trace(function, start, *instants[0])
    now: Numbers = tuple(leaves(start))
    for k, instant in enumerate(instants):
        found = program.flat((*now, *leaves(instant)))
        if k == 0 and first is not None:
            first(instant, found[len(now) :])
        if k < len(told) and not same_numbers(found, told[k]):
            raise refuse(f"gives other numbers as a program in period {k} than with floats: {OUTSIDE}")
        now = found[: len(now)]
    if _text(program) != _text(trace(function, start, *instants[0])):
        raise refuse(f"gives another program in period 0 whenever it is traced: {OUTSIDE}")


def _call_with_floats(
    function: Callable[..., tuple[Any, Any]],
    memory: Any,
    instants: Sequence[tuple[Any, ...]],
    refuse: Callable[[str], Exception],
    constants: Any,
    names: Sequence[str],
) -> list[Numbers]:
    """Results of a function on floats over several periods, up to an arithmetic error."""
    found: list[Numbers] = []
    for k, instant in enumerate(instants):
        given = (memory, *instant, constants)
        before = copy.deepcopy([leaves(each) for each in given])
        try:
            result = function(memory, *instant)
        except ArithmeticError:
            break  # floats refuse 1 / 0, a program goes on with inf
        for name, now, was in zip(names, given, before, strict=False):
            if not same_numbers(leaves(now), was):
                raise refuse(f"writes to its argument {name!r} in period {k}: must return new records")
        numbers, memory = leaves(result), result[0]
        if any(isinstance(number, Node) for number in numbers):
            raise refuse(f"gives a number of an earlier trace in period {k}: {OUTSIDE}")
        found.append(tuple(float(number) for number in numbers))
    return found


def _text(program: Program) -> list[Any]:
    """Text of a traced program that is equal for equal programs."""
    place = {node.index: k for k, node in enumerate((*program.inputs, *program.nodes))}
    lines: list[Any] = [(node.op, repr(node.value), *(place[arg.index] for arg in node.args)) for node in program.nodes]
    return [*lines, *(place[node.index] for node in program.outputs)]


def same_numbers(first: Sequence[Any], second: Sequence[Any]) -> bool:
    """True if two sequences contain the same numbers; NaN equals NaN."""
    if len(first) != len(second):
        return False
    return all(a is b or a == b or (a != a and b != b) for a, b in zip(first, second, strict=True))  # noqa: PLR0124
