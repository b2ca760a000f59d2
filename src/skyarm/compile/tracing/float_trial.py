"""Checks of a traced function for hidden state: equal digests of repeated traces, and equal results on floats.

A program is traced once and runs for ever. What a function keeps in a closure, a global or an attribute is frozen in
it, and nobody sees. Therefore it is traced again and compared; a law is called with floats for some periods, too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from skyarm.algebra import Scalar
from skyarm.compile.tracing.lower import live
from skyarm.compile.tracing.program import trace
from skyarm.compile.tracing.tracer import Graph, Node
from skyarm.records.leaves import Record, Tree, leaves, parts, rebuild

PERIODS = 20
"""Number of control periods over which a traced function is compared with its evaluation on floats."""

OUTSIDE = "it keeps state outside its memory: a closure, a global, an attribute, random numbers or a clock"

LIBRARY = f"{__name__.partition('.')[0]}."

Numbers = tuple[float, ...]


def in_floats(record: Record) -> Record:
    """Copy of a nested dataclass with all its numbers converted to floats."""
    return rebuild(record, iter([float(leaf) for leaf in leaves(record)]))


def compare_with_floats(
    function: Callable[..., tuple[Tree, Tree]],
    memory: Tree,
    instants: Sequence[tuple[Tree, ...]],
    refuse: Callable[[str], Exception],
    *,
    constants: Tree,
    names: Sequence[str],
    first: Callable[[tuple[Tree, ...], Numbers], None],
) -> None:
    """Raise an error for a function whose result depends on anything but its arguments.

    Args:
        function: (memory, *arguments of an instant) -> (memory, result), records over any scalar.
        memory: its first one.
        instants: arguments of each period, records of floats of one structure.
        refuse: makes the error to raise of what is wrong.
        constants: record of floats that it reads and must not write.
        names: names of memory, arguments and constants, for messages.
        first: called with the arguments and the result of the first period.

    Raises:
        Exception: as ``refuse`` makes it.
    """
    start = in_floats(memory)
    expected = _call_with_floats(function, start, instants, refuse, constants, names)
    program = trace(function, start, *instants[0])
    now: Numbers = tuple(leaves(start))
    for k, instant in enumerate(instants):
        numbers = program.flat((*now, *leaves(instant)))
        if k == 0:
            first(instant, numbers[len(now) :])
        if k < len(expected) and not same_numbers(numbers, expected[k]):
            raise refuse(f"gives other numbers as a program in period {k} than with floats: {OUTSIDE}")
        now = numbers[: len(now)]
    if fingerprint(function, start, *instants[0]) != fingerprint(function, start, *instants[0]):
        raise refuse(f"gives another program in period 0 whenever it is traced: {OUTSIDE}")


def _call_with_floats(
    function: Callable[..., tuple[Tree, Tree]],
    memory: Tree,
    instants: Sequence[tuple[Tree, ...]],
    refuse: Callable[[str], Exception],
    constants: Tree,
    names: Sequence[str],
) -> list[Numbers]:
    """Results of a function called with floats for several periods, until an arithmetic error ends the calls."""
    results: list[Numbers] = []
    for k, instant in enumerate(instants):
        given = dict(zip(names, (memory, *instant, constants), strict=False))
        before = contents(given)
        try:
            result = function(memory, *instant)
        except ArithmeticError:
            break  # floats refuse 1 / 0, a program goes on with inf
        if (name := changed_argument(given, before)) is not None:
            raise refuse(f"writes to its argument {name!r} in period {k}: must return new records")
        numbers, memory = leaves(result), result[0]
        if any(isinstance(number, Node) for number in numbers):
            raise refuse(f"gives a number of an earlier trace in period {k}: {OUTSIDE}")
        results.append(tuple(map(float, numbers)))
    return results


def fingerprint(function: Callable[..., Any], *examples: Tree) -> dict[str, str]:
    """Digests of the values that a traced function returns, by path; equal in every process for the same program.

    Args:
        function: function of records over any scalar; may return a table.
        examples: records whose leaves become the inputs.
    """
    graph = Graph()
    inputs = iter([graph.input(f"x{i}") for i, _ in enumerate(leaves(examples))])
    values = contents(function(*rebuild(examples, inputs)))
    texts: dict[int, str] = {}

    def text(value: object) -> str:
        if isinstance(value, Node):
            return texts[value.index]
        return repr(value) if isinstance(value, (bool, int, float, str, bytes)) else type(value).__name__

    for node in live([graph.lift(value) for value in values.values() if isinstance(value, Node)]):
        line = f"{node.op} {node.value!r} {[texts[arg.index] for arg in node.args]}"
        texts[node.index] = hashlib.blake2b(line.encode(), digest_size=16).hexdigest()
    graph.close(lowered=True)
    return {at: text(value) for at, value in values.items()}


def contents(value: Any, place: str = "", above: tuple[int, ...] = ()) -> dict[str, Any]:
    """Innermost values of nested dataclasses, lists, dictionaries and objects of this library, by path.

    Of an object that refers to one that it is in, whose ids are ``above``, as one vehicle's motion to the others', that
    one is left out.
    """
    below: Mapping[Any, Any] = parts(value)
    if isinstance(value, (list, Mapping)):
        below = value if isinstance(value, Mapping) else dict(enumerate(value))
    elif not below and type(value).__module__.startswith(LIBRARY):
        below = getattr(value, "__dict__", below)
    if not below:
        return {place: value.tobytes() if hasattr(value, "tobytes") else value}
    inside, found = (*above, id(value)), dict[str, Any]()
    for name, inner in below.items():
        if id(inner) not in inside:
            found |= contents(inner, f"{place}.{name}", inside)
    return found


def changed_argument(arguments: Mapping[str, Any], before: Mapping[str, Any]) -> str | None:
    """Name of the first argument whose contents differ from those before a call; None if all are unchanged."""
    now = contents(arguments)
    for at, value in before.items():
        # by identity, as traced numbers cannot be compared; what is first computed now may be added
        if not (now.get(at) is value or (type(value) is bytes and now.get(at) == value)):
            return at.split(".")[1]
    return None


def same_numbers(first: Sequence[Scalar], second: Sequence[Scalar]) -> bool:
    """True if two sequences contain the same numbers; NaN equals NaN."""
    if len(first) != len(second):
        return False
    return all(a is b or a == b or (a != a and b != b) for a, b in zip(first, second, strict=True))  # noqa: PLR0124
