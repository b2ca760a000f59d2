"""Lowering: sin, exp ... of a program written out in basic operations, so that every engine computes the same bits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from skyarm.compile.tracing.tracer import Graph, Node
from skyarm.scalars.elementary import COMPOSED


@dataclass(frozen=True, slots=True)
class Lowered:
    """A program of basic operations.

    Attributes:
        inputs: in order. nodes: live, in an order of evaluation. outputs: in order.
    """

    inputs: tuple[Node, ...]
    nodes: tuple[Node, ...]
    outputs: tuple[Node, ...]


def lower(inputs: Sequence[Node], nodes: Sequence[Node], outputs: Sequence[Node]) -> Lowered:
    """Write a program out in basic operations."""
    target = Graph(loops=True)
    made: dict[int, Node] = {node.index: target.input(node.value) for node in inputs}
    for node in nodes:
        args = [made[arg.index] for arg in node.args]
        if node.op == "const":
            made[node.index] = target.constant(node.value)
        elif node.op in COMPOSED:
            composed: Any = COMPOSED[node.op]
            made[node.index] = target.lift(composed(*args))
        elif node.op in ("add", "sub", "mul", "neg"):
            made[node.index] = getattr(target, node.op)(*args)
        elif node.op == "slot":
            made[node.index] = target.slot()
        elif node.op == "repeat":
            count, slots, until = node.value
            half = len(slots)
            held = [made[slot.index] if slot.index in made else target.slot() for slot in slots]
            items = target.repeat(count, held, args[:half], args[half:], until=until)
            made[node.index] = items[0].args[0]
        elif node.op == "item":
            made[node.index] = target.item(args[0], node.value)
        elif node.op == "call":
            function, sizes = node.value
            given = iter(args)
            groups = [[next(given) for _ in range(size)] for size in sizes]
            # a call without results is not live: the first of them leads to its node
            made[node.index] = target.external(function, groups, 1)[0].args[0]
        elif node.op == "result":
            made[node.index] = target.result(args[0], node.value)
        elif node.op != "input":
            made[node.index] = target.call(node.op, *args)
    results = tuple(made[node.index] for node in outputs)
    return Lowered(tuple(made[node.index] for node in inputs), tuple(live(results)), results)


def live(outputs: Sequence[Node]) -> list[Node]:
    """Nodes the outputs need, in order of creation."""
    seen: dict[int, Node] = {}
    stack = list(outputs)
    while stack:
        node = stack.pop()
        if node.index not in seen:
            seen[node.index] = node
            stack.extend(node.args)
    return [seen[index] for index in sorted(seen)]
