"""Tracing of functions of dataclasses into programs, and translation of programs to
straight-line Python.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import floats
from skyarm.compile.tracing.lower import arrange, live, lower
from skyarm.compile.tracing.tracer import Graph, Lowered, Node, pause_collection
from skyarm.records.immutable import positional
from skyarm.records.leaves import Tree, leaves, mismatch, rebuild, shaped_like

Channels = tuple[tuple[int, int], ...]
"""Channel of random numbers and their count per control period, of each model."""

_INFIX = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "lt": "<",
    "le": "<=",
    "and": "and",
    "or": "or",
}
_FORMS = {op: f"{{0}} {sign} {{1}}" for op, sign in _INFIX.items()}
_FORMS |= {
    "neg": "-{0}",
    "not": "not {0}",
    "where": "{1} if {0} else {2}",
    "abs": "fabs({0})",
}
# 3.5 // 1.0 is floor(3.5) with the sign of a zero kept; infinities are their own floor
_FORMS["floor"] = "{0} // 1.0 if -1e300 < {0} < 1e300 else {0}"
_BITS = {
    name: getattr(floats, name) for name in ("power_of_two", "exponent", "mantissa")
} | {"copysign": math.copysign}
_FAST = {"sqrt": math.sqrt, "fabs": math.fabs, **_BITS}
_SAFE = {"sqrt": floats.sqrt, "fabs": math.fabs, "div": floats.divide, **_BITS}


Flat = Callable[[Sequence[float]], tuple[float, ...]]
"""Type of a compiled program: function from the sequence of input numbers to the tuple
of output numbers."""


class Program:
    """Straight-line program of a traced function: inputs, operations in order of
    evaluation, outputs.

    Calling it takes records shaped like the examples it was traced with and returns a
    record; :meth:`flat` takes and returns plain sequences and is the fast way in.
    Results equal those of the traced function on floats bit for bit.
    """

    def __init__(
        self,
        graph: Graph,
        inputs: Sequence[Node],
        result: Tree,
        examples: tuple[Tree, ...],
    ) -> None:
        self.inputs = list(inputs)
        self._examples = examples
        self._result = result
        self.outputs = [graph.lift(leaf) for leaf in leaves(result)]
        self.nodes = live(self.outputs)
        self.lowered = lower(self.inputs, self.nodes, self.outputs)
        self.flat = python_function(self.lowered)

    def __call__(self, *records: Tree) -> Any:
        """Evaluate the program on dataclasses of floats with the same structure as the
        examples given to the tracer.
        """
        different = mismatch(self._examples, records, "arguments")
        if different:
            raise ValueError(
                f"{different}: integers, text and None are structure; trace again to"
                " change them"
            )
        return self.record(self.flat(leaves(records)))

    def record(self, values: Sequence[Scalar]) -> Any:
        """Arrange a flat result as the dataclass that the traced function returns."""
        return shaped_like(self._result, values)

    def operations(self) -> Counter[str]:
        """Count the occurrences of each operation (constants and inputs not
        counted).
        """
        return Counter(
            node.op for node in self.nodes if node.op not in ("input", "const")
        )


@pause_collection()
def trace(function: Callable[..., Tree], *examples: Tree) -> Program:
    """Trace ``function`` on symbolic arguments shaped like ``examples`` and return its
    program.

    Args:
        function: takes records (dataclasses or tuples of scalars), returns one.
        examples: records whose leaves become the inputs, in order; their integers stay
            structure.

    Raises:
        TracedBranchError: the function branches on a traced value; names file and line.
    """
    graph = Graph()
    inputs = [graph.input(f"x{i}") for i, _ in enumerate(leaves(examples))]
    program = Program(graph, inputs, function(*rebuild(examples, inputs)), examples)
    graph.close()
    return program


def _literal(value: float) -> str:
    if math.isfinite(value):
        return repr(value)
    return "_nan" if math.isnan(value) else "_inf" if value > 0.0 else "(-_inf)"


def _loop(
    block: Node, body: Sequence[Node], name: Callable[[Node], str], divide: str
) -> list[str]:
    """Lines of Python source of a loop over variables that are all updated at the end
    of an iteration.
    """
    count, slots, until = block.value
    variables = ", ".join(f"v{slot.index}" for slot in slots)
    starts, ends = block.args[: len(slots)], block.args[len(slots) :]
    # the comma makes a tuple of a single variable, too
    lines = [
        f"    {variables}, = {', '.join(map(name, starts))},",
        f"    for _ in range({count}):",
    ]
    if until is not None:
        lines += [f"        if not {name(slots[until])} > 0.5:", "            break"]
    lines += [
        f"        v{node.index} = {_expression(node, name, divide)}" for node in body
    ]
    return [*lines, f"        {variables}, = {', '.join(map(name, ends))},"]


def _expression(node: Node, name: Callable[[Node], str], divide: str) -> str:
    if node.op == "item":
        return f"v{node.args[0].value[1][node.value].index}"
    if node.op == "result":
        return f"v{node.args[0].index}[{node.value}]"
    args = [name(arg) for arg in node.args]
    if node.op == "call":
        given = iter(args)
        groups = [
            "".join(f"{next(given)}, " for _ in range(size)) for size in node.value[1]
        ]
        return f"call{node.index}({', '.join(f'({group})' for group in groups)})"
    if node.op == "apply":
        inputs = len(node.value.inputs)
        call = f"apply{node.index}(({''.join(f'{arg}, ' for arg in args[:inputs])}))"
        if not args[inputs:]:
            return call
        others = "".join(f"{arg}, " for arg in args[inputs + 1 :])
        return f"{call} if {args[inputs]} else ({others})"
    form = divide if node.op == "div" else _FORMS.get(node.op)
    return form.format(*args) if form else f"{node.op}({', '.join(args)})"


def python_source(program: Lowered, divide: str = "{0} / {1}") -> str:
    """Source of the Python function ``program``, which evaluates a traced program: one
    assignment per operation.
    """

    def variable(node: Node) -> str:
        return f"({_literal(node.value)})" if node.op == "const" else f"v{node.index}"

    live = {node.index for node in program.nodes}
    targets = ", ".join(
        f"v{node.index}" if node.index in live else "_" for node in program.inputs
    )
    lines = ["def program(x):", *([f"    {targets}, = x"] if program.inputs else [])]
    for node, body in arrange(program.nodes):
        if node.op == "repeat":
            lines += _loop(node, body, variable, divide)
        elif node.op not in ("input", "const"):
            lines.append(f"    v{node.index} = {_expression(node, variable, divide)}")
    results = "".join(f"{variable(node)}, " for node in program.outputs)
    return "\n".join([*lines, f"    return ({results})", ""])


class _CallOnce:
    """External function of a traced program, called only once even if the program is
    evaluated twice.
    """

    def __init__(self, function: Callable[..., Sequence[float]]) -> None:
        self._function = function
        self.made: Sequence[float] | None = None

    def __call__(self, *groups: tuple[float, ...]) -> Sequence[float]:
        if self.made is None:
            self.made = self._function(*groups)
        return self.made


def python_function(program: Lowered) -> Flat:
    """Compile a traced program to a Python function that returns inf or NaN where
    Python floats would raise.

    ``math`` and ``/`` are faster than their IEEE versions but raise; on the first such
    case the same program is run once more with the IEEE versions, which give the same
    bits wherever both are defined.
    """
    calls = {
        f"call{node.index}": _CallOnce(node.value[0])
        for node in program.nodes
        if node.op == "call"
    }
    applied = [node for node in program.nodes if node.op == "apply"]
    shared = {id(node.value): python_function(node.value) for node in applied}
    functions = {f"apply{node.index}": shared[id(node.value)] for node in applied}
    constants = {"_inf": math.inf, "_nan": math.nan} | calls | functions
    fast_names = dict(_FAST) | constants
    exec(compile(python_source(program), "<skyarm program>", "exec"), fast_names)
    fast: Flat = fast_names["program"]
    safe: list[Flat] = []

    def run(x: Sequence[float]) -> tuple[float, ...]:
        for call in calls.values():
            call.made = None
        try:
            return fast(x)
        except (ZeroDivisionError, ValueError, OverflowError):
            if not safe:
                names = dict(_SAFE) | constants
                exec(
                    compile(
                        python_source(program, "div({0}, {1})"),
                        "<skyarm program, IEEE>",
                        "exec",
                    ),
                    names,
                )
                safe.append(names["program"])
            return safe[0](x)

    return run


@positional
class Loop:
    """Traced program of one simulation step: from state, parameters and inputs to next
    state and logged values.

    Inputs come in the order carry, parameters, row, uniforms; outputs are the next
    carry, then what may be logged.

    Attributes:
        program: basic operations of one step.
        carry, parameters, row: numbers of inputs of each kind. uniforms: (channel,
            count) of the random numbers.
        logged: number of outputs that follow the next carry.
        result: the records (carry, log) the step returns, for shaping.
        own_seeds: every lane draws with a seed of its own, not with one for all.
    """

    program: Lowered
    carry: int
    parameters: int
    row: int
    uniforms: Channels
    logged: int
    result: Any
    own_seeds: bool = False

    def stepper(self) -> Flat:
        """Compile the step to a Python function of all inputs in order; the reference
        for all other simulators.
        """
        return python_function(self.program)


@pause_collection()
def trace_loop(
    step: Callable[..., tuple[Tree, Tree]],
    carry: Tree,
    parameters: Tree,
    row: Tree,
    uniforms: Channels = (),
    *,
    loops: bool = False,
    own_seeds: bool = False,
) -> Loop:
    """Trace one step (state, parameters, inputs, random numbers) -> (next state, logged
    values).

    Args:
        step: pure function of records; the carry it returns has the leaves of the one
            it takes.
        carry: example record of what a step hands to the next.
        parameters: example record of constants per lane.
        row: example record of the inputs of one step.
        uniforms: (channel, count) of the numbers uniform in (0, 1) that a step draws.
        loops: keep repetitions as loops, for machine code and Python; other engines
            want them written out.
        own_seeds: every lane draws with a seed of its own
            (:class:`skyarm.compile.llvm.lane_stepper.LaneStepper`).

    Raises:
        ValueError: the step returns a carry of another structure; where one has an int,
            a constant, so has the other.
    """
    graph = Graph(loops=loops)
    examples = (carry, parameters, row)
    groups = [
        [graph.input(f"{name}{i}") for i, _ in enumerate(leaves(record))]
        for name, record in zip("cpr", examples, strict=True)
    ]
    draws = tuple(
        graph.input(f"u{i}") for i in range(sum(count for _, count in uniforms))
    )
    arguments = [
        rebuild(record, group) for record, group in zip(examples, groups, strict=True)
    ]
    result = step(*arguments, draws)
    following, log = map(leaves, result)
    if wrong := mismatch(carry, result[0], "carry"):
        raise ValueError(f"the step returns another carry than it takes: {wrong}")
    outputs = [graph.lift(leaf) for leaf in (*following, *log)]
    inputs = [node for group in (*groups, draws) for node in group]
    program = lower(inputs, live(outputs), outputs)
    graph.close(lowered=True)
    return Loop(
        program,
        len(groups[0]),
        len(groups[1]),
        len(groups[2]),
        uniforms,
        len(log),
        result,
        own_seeds,
    )


def trace_call(function: Callable[..., Tree], *examples: Tree) -> Loop:
    """Trace a function as a step without a state, whose repetitions stay loops.

    Args:
        function: takes records, returns one, which the step logs.
        examples: records whose leaves become the step's inputs, in order; their
            integers stay structure.
    """
    return trace_loop(
        lambda _carry, _parameters, row, _uniforms: ((), function(*row)),
        (),
        (),
        examples,
        loops=True,
    )
