"""Digests of what a traced function returns and contents of its arguments, to compare
repeated traces and calls.

A program is traced once and runs for ever. What a function keeps in a closure, a global
or an attribute is frozen in it, and nobody sees. Therefore it is traced again, and the
digests are compared.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from typing import Any

from skyarm.compile.tracing.lower import live
from skyarm.compile.tracing.tracer import Graph, Node
from skyarm.records.leaves import Record, Tree, leaves, parts, rebuild

OUTSIDE = (
    "it keeps state outside its memory: a closure, a global, an attribute, random"
    " numbers or a clock"
)

LIBRARY = f"{__name__.partition('.')[0]}."


def in_floats(record: Record) -> Record:
    """Copy of a nested dataclass with all its numbers converted to floats."""
    return rebuild(record, [float(leaf) for leaf in leaves(record)])


def fingerprint(function: Callable[..., Any], *examples: Tree) -> dict[str, str]:
    """Digests of the values that a traced function returns, by path; equal in every
    process for the same program.

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
        return (
            repr(value)
            if isinstance(value, (bool, int, float, str, bytes))
            else type(value).__name__
        )

    for node in live(
        [graph.lift(value) for value in values.values() if isinstance(value, Node)]
    ):
        line = f"{node.op} {node.value!r} {[texts[arg.index] for arg in node.args]}"
        # 128 bits: two different lines have the same digest by no chance
        texts[node.index] = hashlib.blake2b(line.encode(), digest_size=16).hexdigest()
    graph.close(lowered=True)
    return {at: text(value) for at, value in values.items()}


def contents(
    value: Any, place: str = "", above: tuple[int, ...] = ()
) -> dict[str, Any]:
    """Innermost values of nested dataclasses, lists, dictionaries and objects of this
    library, by path.

    Of an object that refers to one that it is in, whose ids are ``above``, as one
    vehicle's motion to the others', that one is left out.
    """
    below: Mapping[Any, Any] = parts(value)
    if isinstance(value, (list, Mapping)):
        below = value if isinstance(value, Mapping) else dict(enumerate(value))
    elif not below and type(value).__module__.startswith(LIBRARY):
        below = getattr(value, "__dict__", below)
    if not below:
        return {place: value.tobytes() if hasattr(value, "tobytes") else value}
    inside = (*above, id(value))
    found = dict[str, Any]()
    for name, inner in below.items():
        if id(inner) not in inside:
            found |= contents(inner, f"{place}.{name}", inside)
    return found


def changed_argument(
    arguments: Mapping[str, Any], before: Mapping[str, Any]
) -> str | None:
    """Name of the first argument whose contents differ from those before a call; None
    if all are unchanged.
    """
    now = contents(arguments)
    for at, value in before.items():
        # by identity, as traced numbers cannot be compared; what is first computed now
        # may be added
        if not (
            now.get(at) is value or (type(value) is bytes and now.get(at) == value)
        ):
            return at.split(".")[1]
    return None
