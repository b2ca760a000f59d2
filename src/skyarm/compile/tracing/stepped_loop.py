"""A program that is stepped: carry -> carry, with constants per lane, a row of inputs per step, and random numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from skyarm.compile.tracing.lower import Lowered, live, lower
from skyarm.compile.tracing.program import python_function
from skyarm.compile.tracing.tracer import Graph
from skyarm.records.leaves import leaves, rebuild


@dataclass(frozen=True, slots=True)
class Loop:
    """A stepped program of basic operations.

    Inputs come in the order carry, parameters, row, uniforms; outputs are the next carry, then what may be logged.

    Attributes:
        program: basic operations of one step.
        carry, parameters, row: how many inputs of each kind. uniforms: (channel, count) of the random numbers.
        logged: how many outputs follow the next carry.
        result: the records (carry, log) the step returns, for shaping.
        own_seeds: every lane draws with a seed of its own, not with one for all.
    """

    program: Lowered
    carry: int
    parameters: int
    row: int
    uniforms: tuple[tuple[int, int], ...]
    logged: int
    result: Any
    own_seeds: bool = False

    def stepper(self) -> Callable[[Any], tuple[float, ...]]:
        """One step as a Python function of all inputs in order: the reference of every other engine."""
        return python_function(self.program)


def trace_loop(
    step: Callable[..., tuple[Any, Any]],
    carry: Any,
    parameters: Any,
    row: Any,
    uniforms: tuple[tuple[int, int], ...] = (),
    *,
    loops: bool = False,
    own_seeds: bool = False,
) -> Loop:
    """Trace step(carry, parameters, row, uniforms) -> (carry, log).

    Args:
        step: pure function of records; the carry it returns has the leaves of the one it takes.
        carry: example record of what a step hands to the next.
        parameters: example record of constants per lane.
        row: example record of the inputs of one step.
        uniforms: (channel, count) of the numbers uniform in (0, 1) that a step draws.
        loops: keep repetitions as loops, for machine code and Python; other engines want them written out.
        own_seeds: every lane draws with a seed of its own (:class:`skyarm.compile.llvm.lane_stepper.LaneStepper`).

    Raises:
        ValueError: the step returns a carry with another number of scalars.
    """
    graph = Graph(loops=loops)
    groups = [
        [graph.input(f"{name}{i}") for i, _ in enumerate(leaves(record))]
        for name, record in _named(carry, parameters, row)
    ]
    draws = tuple(graph.input(f"u{i}") for i in range(sum(count for _, count in uniforms)))
    arguments = [rebuild(record, iter(group)) for record, group in zip((carry, parameters, row), groups, strict=True)]
    result = step(*arguments, draws)
    following, log = (leaves(part) for part in result)
    if len(following) != len(groups[0]):
        raise ValueError(f"the step returns a carry of {len(following)} scalars, took one of {len(groups[0])}")
    outputs = [graph.lift(leaf) for leaf in (*following, *log)]
    inputs = [node for group in (*groups, draws) for node in group]
    program = lower(inputs, live(outputs), outputs)
    return Loop(program, len(groups[0]), len(groups[1]), len(groups[2]), uniforms, len(log), result, own_seeds)


def _named(carry: Any, parameters: Any, row: Any) -> list[tuple[str, Any]]:
    return [("c", carry), ("p", parameters), ("r", row)]
