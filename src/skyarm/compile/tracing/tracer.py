"""Tracer: runs a function on symbolic values and records the straight-line program that
it computes.

Equal expressions become one node, so common subexpressions are shared; constants are
folded by computing them with the same float functions; only rewritings that are exact
in IEEE arithmetic are made (structural 0 and 1, signs).
"""

from __future__ import annotations

import gc
import operator
import struct
import sys
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any

from skyarm.algebra import Scalar
from skyarm.algebra.scalars import floats, register
from skyarm.algebra.scalars.elementary import COMPOSED
from skyarm.algebra.scalars.taylor import Taylor
from skyarm.records.immutable import positional

_COMMUTATIVE = frozenset({"add", "mul", "and", "or"})

CONDITIONS = frozenset({"lt", "le", "and", "or", "not"})
"""Names of the operations whose result is a truth value."""

FOLD: dict[str, Callable[..., Scalar]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": floats.divide,
    "neg": operator.neg,
    "lt": operator.lt,
    "le": operator.le,
    "where": floats.where,
    "and": floats.logical_and,
    "or": floats.logical_or,
    "not": floats.logical_not,
    "abs": floats.absolute,
    **{
        name: getattr(floats, name)
        for name in (
            "sqrt",
            "floor",
            "copysign",
            "power_of_two",
            "exponent",
            "mantissa",
        )
    },
    **COMPOSED,
}
"""Python function of each operation of a traced program, for the folding of
constants."""


class TracedBranchError(TypeError):
    """Error: a traced value was used as a Python condition."""


def _caller() -> str:
    """Source file and line of the user's code that misused a symbolic value."""
    frame = sys._getframe(2)
    while frame.f_code.co_filename.startswith("<") and frame.f_back is not None:
        frame = frame.f_back  # the comparison that a dataclass generates
    return f"{frame.f_code.co_filename}:{frame.f_lineno}"


_PAUSES, _PAUSING = list[bool](), Lock()
"""For each pause of the garbage collector, of any thread, whether it collected before;
and who may change them."""


@contextmanager
def pause_collection() -> Iterator[None]:
    """Context manager, and decorator, that pauses Python's garbage collector, for all
    threads of the process.

    The collector would visit a growing graph again and again, a fifth of the time of
    tracing, and find no garbage.
    """
    with _PAUSING:
        _PAUSES.append(gc.isenabled())
        gc.disable()
    try:
        yield
    finally:
        with _PAUSING:
            # the last of several threads takes what the first has found
            if _PAUSES.pop():
                gc.enable()


def _comparison(op: str, *, turned: bool = False) -> Callable[[Node, Scalar], Any]:
    """Make a comparison operator, which adds a condition to the traced program.

    ``turned``: a > b is b < a.
    """

    def method(self: Node, other: Scalar) -> Any:
        # its own comparison takes the value of the series
        if type(other) is Taylor:
            return NotImplemented
        pair = (other, self) if turned else (self, other)
        return self.graph.call(op, *pair)

    return method


class Node:
    """Symbolic value of a traced program: an operation with its operands.

    Its operators fold an integer only where that is exact for every float (x - 0, x *
    1, x / 1), so that a program keeps the bits of plain Python arithmetic;
    :mod:`skyarm.algebra.scalars.fold` folds structural zeros on every engine alike. A
    Taylor series on the right takes the operation over.
    """

    __slots__ = ("args", "graph", "index", "op", "value")
    __array_ufunc__ = None  # a NumPy scalar on the left must leave the operation to us

    def __init__(
        self, graph: Graph, index: int, op: str, args: tuple[Node, ...], value: Any
    ) -> None:
        self.graph = graph
        self.index = index
        self.op = op
        self.args = args
        self.value = value

    def __add__(self, other: Scalar) -> Scalar:
        """Add an addition to the traced program."""
        return NotImplemented if type(other) is Taylor else self.graph.add(self, other)

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Scalar:
        """Add a subtraction to the traced program."""
        if type(other) is int and other == 0:
            return self
        return NotImplemented if type(other) is Taylor else self.graph.sub(self, other)

    def __rsub__(self, other: Scalar) -> Scalar:
        """Add a subtraction with this value on the right to the traced program."""
        return self.graph.sub(other, self)

    def __mul__(self, other: Scalar) -> Scalar:
        """Add a multiplication to the traced program."""
        if type(other) is int and other in (-1, 1):
            return self if other == 1 else -self
        return NotImplemented if type(other) is Taylor else self.graph.mul(self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> Scalar:
        """Add a division to the traced program."""
        # exact, so that it folds; other integers divide as data
        if type(other) is int and other in (-1, 1):
            return self if other == 1 else -self
        return (
            NotImplemented
            if type(other) is Taylor
            else self.graph.call("div", self, other)
        )

    def __rtruediv__(self, other: Scalar) -> Scalar:
        """Add a division by this value to the traced program."""
        return self.graph.call("div", other, self)

    def __neg__(self) -> Scalar:
        """Add a negation to the traced program."""
        return self.graph.neg(self)

    def __abs__(self) -> Scalar:
        """Add an absolute value to the traced program."""
        return self.graph.call("abs", self)

    __lt__, __le__ = _comparison("lt"), _comparison("le")
    __gt__, __ge__ = _comparison("lt", turned=True), _comparison("le", turned=True)

    def __eq__(self, other: object) -> bool:
        """Refuse equality: it would compare symbolic values, not numbers."""
        raise TracedBranchError(
            f"{_caller()}: == on a traced value; compare by < or <="
        )

    __hash__ = object.__hash__

    def __and__(self, other: Scalar) -> Scalar:
        """Add the logical and of two conditions to the traced program."""
        return self.graph.call("and", self, other)

    def __or__(self, other: Scalar) -> Scalar:
        """Add the logical or of two conditions to the traced program."""
        return self.graph.call("or", self, other)

    def __bool__(self) -> bool:
        """Refuse a Python branch on a symbolic value, which has no number while
        tracing.
        """
        raise TracedBranchError(
            f"{_caller()}: branch on a traced value; use"
            " skyarm.algebra.scalars.where(condition, a, b)"
        )

    def __float__(self) -> float:
        """Refuse conversion to float: a symbolic value has no number while tracing."""
        raise TracedBranchError(f"{_caller()}: float() of a traced value")

    def __repr__(self) -> str:
        """Text of a symbolic value: operation and indices of the operands."""
        return f"Node({self.op}, {', '.join(str(a.index) for a in self.args)})"


def is_condition(node: Node) -> bool:
    """True if the value of an operation is a truth value, not a number."""
    while node.op == "where":
        node = node.args[1]
    return node.op in CONDITIONS or isinstance(node.value, bool)


@positional
class Lowered:
    """Traced program that consists of basic operations only.

    Attributes:
        inputs, outputs: inputs and outputs in their order. nodes: live operations, in
            an order of evaluation.
    """

    inputs: tuple[Node, ...]
    nodes: tuple[Node, ...]
    outputs: tuple[Node, ...]


class Graph:
    """All symbolic values of a traced program as a graph, in order of creation.

    Args:
        loops: keep a repetition (:mod:`skyarm.compile.tracing.lower`) as a loop, and a
            shared function as one; else they are written out.

    Attributes:
        functions: functions of :func:`skyarm.compile.tracing.lower.compiled_once` by
            their keys; None without.
    """

    def __init__(self, *, loops: bool = False) -> None:
        self.nodes: list[Node] = []
        self.loops = loops
        self._loops_made = 0
        self._known: dict[Hashable, Node] = {}
        self.functions: (
            dict[Hashable, list[tuple[tuple[object, object], Lowered, object]]] | None
        ) = {} if loops else None

    def close(self, *, lowered: bool = False) -> None:
        """Empty the graph, so that its values are freed with the last program that uses
        them.

        Args:
            lowered: the program has been written in basic operations: the values need
                no operands any more, whatever still refers to one of them.
        """
        for node in self.nodes if lowered else ():
            node.args = ()
        self.nodes.clear()
        self._known.clear()
        if self.functions is not None:
            self.functions.clear()

    def input(self, name: str) -> Node:
        """Add an input to the traced program."""
        return self._make("input", (), name, ("input", name))

    def constant(self, value: Scalar) -> Node:
        """Symbolic value of a constant number or truth value."""
        if (
            isinstance(value, bool)
            or getattr(getattr(value, "dtype", None), "kind", "") == "b"
        ):
            truth = bool(value)  # NumPy's is no bool, and would become 1.0
            return self._make("const", (), truth, ("bool", truth))
        number = float(value)
        # a number is its own key but where zeros differ by their sign, and NaN from
        # itself
        plain = number < 0.0 or number > 0.0
        return self._make(
            "const",
            (),
            number,
            number if plain else ("const", struct.pack("<d", number)),
        )

    def lift(self, value: Scalar) -> Node:
        """Convert any scalar to a symbolic value of the traced program."""
        if isinstance(value, Node):
            if value.graph is not self:
                raise TypeError(
                    "a value of another trace reached this one: pass it as an argument"
                )
            return value
        return self.constant(value)

    def call(self, op: str, *values: Scalar) -> Node:
        """Symbolic value of an operation; equal operations are shared, and constants
        are folded.
        """
        # lists, not generators: this runs ten thousand times a trace
        args = [self.lift(value) for value in values]
        if len(args) == 2:
            return self._pair(op, *args)
        if op == "where" and (args[1] is args[2] or args[0].op == "const"):
            return args[1] if args[1] is args[2] or args[0].value else args[2]
        if args[0].op == "const" and all(arg.op == "const" for arg in args):
            return self.constant(FOLD[op](*[arg.value for arg in args]))
        return self._make(op, tuple(args), None, (op, *[arg.index for arg in args]))

    def _pair(self, op: str, x: Node, y: Node) -> Node:
        """Symbolic value of an operation with two operands (the most frequent case,
        kept short for speed).
        """
        if x.op == "const" and y.op == "const":
            return self.constant(FOLD[op](x.value, y.value))
        # sorted operands: a + b and b + a are one node
        if y.index < x.index and op in _COMMUTATIVE:
            x, y = y, x
        key = (op, x.index, y.index)
        node = self._known.get(key)
        return self._make(op, (x, y), None, key) if node is None else node

    def add(self, a: Scalar, b: Scalar) -> Node:
        """Return a + b; a + (-b) becomes a - b."""
        x, y = self.lift(a), self.lift(b)
        if y.op == "neg":
            return self._pair("sub", x, y.args[0])
        if x.op == "neg":
            return self._pair("sub", y, x.args[0])
        return self._pair("add", x, y)

    def sub(self, a: Scalar, b: Scalar) -> Node:
        """Return a - b; a - (-b) becomes a + b."""
        x, y = self.lift(a), self.lift(b)
        if y.op == "neg":
            return self._pair("add", x, y.args[0])
        return self._pair("sub", x, y)

    def mul(self, a: Scalar, b: Scalar) -> Node:
        """Return a * b; signs are moved out, so that (-a) b and a b share their
        product.
        """
        x, y = self.lift(a), self.lift(b)
        if x.op == "neg" and y.op == "neg":
            return self._pair("mul", x.args[0], y.args[0])
        if x.op == "neg":
            return self.neg(self._pair("mul", x.args[0], y))
        if y.op == "neg":
            return self.neg(self._pair("mul", x, y.args[0]))
        return self._pair("mul", x, y)

    def neg(self, a: Scalar) -> Node:
        """Return -a; -(-a) becomes a."""
        x = self.lift(a)
        return x.args[0] if x.op == "neg" else self.call("neg", x)

    def slot(self) -> Node:
        """Add a loop variable: the start value at first, then the value of the previous
        iteration.
        """
        return self._make("slot", (), self._loops_made, ("slot", len(self.nodes)))

    def repeat(
        self,
        count: int,
        slots: list[Node],
        starts: list[Node],
        ends: list[Node],
        *,
        until: int | None = None,
    ) -> list[Node]:
        """Close a loop over the loop variables ``slots``; return their values after the
        last iteration.

        ``until`` is the number of a slot: while it is at most 0.5 in every lane, at the
        start or later, further rounds change nothing and need not be made.
        """
        # the key is unique: equal loops and calls are not merged
        self._loops_made += 1
        block = self._make(
            "repeat",
            (*starts, *ends),
            (count, tuple(slots), until),
            ("repeat", len(self.nodes)),
        )
        return [self.item(block, k) for k in range(len(slots))]

    def item(self, block: Node, k: int) -> Node:
        """Value of loop variable ``k`` after the last iteration of a loop."""
        return self._make("item", (block,), k, ("item", block.index, k))

    def external(
        self,
        function: Callable[..., Sequence[float]],
        groups: Sequence[Sequence[Scalar]],
        count: int,
    ) -> list[Node]:
        """Record a call of a Python function that cannot be compiled; return ``count``
        result nodes.

        Calls are made in the order of their tracing. ``function`` takes one tuple for
        each group.
        """
        args = tuple(self.lift(value) for group in groups for value in group)
        # never merged, since a call may have effects
        value = (function, tuple(map(len, groups)))
        block = self._make("call", args, value, ("call", len(self.nodes)))
        return [self.result(block, k) for k in range(count)]

    def apply(self, function: Lowered, args: Sequence[Node]) -> Node:
        """Record a call of a traced function, which is compiled once.

        Args:
            function: the program.
            args: its inputs; of a call that is made only where a condition holds in a
                lane, then the condition and the results elsewhere.
        """
        key = ("apply", id(function), *[arg.index for arg in args])
        return self._make("apply", tuple(args), function, key)

    def result(self, call: Node, k: int) -> Node:
        """Symbolic value of result ``k`` of a call of a function."""
        return self._make("result", (call,), k, ("result", call.index, k))

    def _make(self, op: str, args: tuple[Node, ...], value: Any, key: Hashable) -> Node:
        node = self._known.get(key)
        if node is None:
            node = self._known[key] = Node(self, len(self.nodes), op, args, value)
            self.nodes.append(node)
        return node


class _NodeFunctions:
    """Scalar functions such as sin and where on symbolic values of a traced program."""

    def __getattr__(self, name: str) -> Callable[..., Node]:
        op = {
            "divide": "div",
            "absolute": "abs",
            "logical_and": "and",
            "logical_or": "or",
            "logical_not": "not",
        }.get(name, name)
        if op not in FOLD:
            raise AttributeError(name)
        return lambda *values: next(
            value.graph for value in values if isinstance(value, Node)
        ).call(op, *values)


register(Node, _NodeFunctions())
