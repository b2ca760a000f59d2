"""Changes of Python source, one at a time: other operators, operands swapped, terms,
guards and limits dropped, slips.

A change replaces the text of one syntax node and nothing else. Left alone are
docstrings, annotations, decorators, f-strings (they are texts), what is raised or
warned, ``__all__``, ``if TYPE_CHECKING`` and options of the language (``strict=``,
``frozen=``).
"""

from __future__ import annotations

import ast
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

ARITHMETIC = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
}
BOUNDARY = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
}
REVERSED = {
    ast.Lt: ("<", ">="),
    ast.LtE: ("<=", ">"),
    ast.Gt: (">", "<="),
    ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
}
_PAIRS = (
    ("min", "max"),
    ("minimum", "maximum"),
    ("floor", "ceil"),
    ("all", "any"),
    ("add", "sub"),
    ("sin", "cos"),
    ("logical_and", "logical_or"),
    ("apply", "apply_T"),
    ("argmin", "argmax"),
)
RENAMED = {one: two for pair in _PAIRS for one, two in (pair, pair[::-1])}
LIMITS = (
    "min",
    "max",
    "minimum",
    "maximum",
    "clip",
    "abs",
    "absolute",
    "sorted",
    "reversed",
    "round",
)
DROPPED_METHODS = ("normalized", "renormalized", "norm", "strip", "resolve")
SLIPPED = {
    "x": "y",
    "y": "z",
    "z": "x",
    "r0": "r1",
    "r1": "r2",
    "r2": "r0",
    "xx": "yy",
    "yy": "zz",
    "zz": "xx",
}
LANGUAGE = (
    "strict",
    "frozen",
    "kw_only",
    "slots",
    "eq",
    "order",
    "repr",
    "compare",
    "init",
    "maxsize",
)
TOLD = ("warn", "print", "echo", "secho", "TypeVar", "cast", "NewType")


class Change(NamedTuple):
    """Replace the text from `start` to `end` by `new`."""

    start: int
    end: int
    old: str
    new: str
    kind: str


@dataclass(kw_only=True)
class Source:
    """The text of a file and the place of each node in it."""

    text: str
    starts: list[int] = field(default_factory=lambda: [0])

    def __post_init__(self) -> None:
        """Find where lines begin, in characters."""
        for line in self.text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))
        self.lines = self.text.splitlines()

    def at(self, row: int, column: int) -> int:
        """Return the place of a row and a column (in bytes, as the parser counts)."""
        line = self.lines[row - 1]
        return self.starts[row - 1] + (
            column if line.isascii() else len(line.encode()[:column].decode())
        )

    def span(self, node: ast.AST) -> tuple[int, int]:
        """Return where a node begins and ends."""
        first = self.at(node.lineno, node.col_offset)  # type: ignore[attr-defined]
        return first, self.at(node.end_lineno, node.end_col_offset)  # type: ignore[attr-defined]

    def of(self, node: ast.AST) -> str:
        """Return a node's text."""
        first, last = self.span(node)
        return self.text[first:last]

    def swap(self, node: ast.AST, new: str, kind: str) -> Change:
        """Replace a whole node."""
        first, last = self.span(node)
        return Change(first, last, self.text[first:last], new, kind)

    def between(
        self, left: ast.AST, right: ast.AST, old: str, new: str, kind: str
    ) -> Iterator[Change]:
        """Replace the operator between two nodes."""
        first, last = self.span(left)[1], self.span(right)[0]
        place = self.text.find(old, first, last)
        if place >= 0 and "#" not in self.text[first:place]:
            yield Change(place, place + len(old), old, new, kind)


def changes(source: Source) -> Iterator[Change]:
    """Yield every change of a file."""
    for node in _nodes(ast.parse(source.text)):
        yield from (
            change for change in _of_node(source, node) if change.old != change.new
        )


def is_python(text: str) -> bool:
    """Return whether a changed text still is Python."""
    try:
        compile(text, "mutant", "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return False
    return True


def _nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """Walk the tree but for what is left alone."""
    skipped: set[int] = set()
    for node in ast.walk(tree):
        if id(node) in skipped:
            skipped.update(id(child) for child in ast.iter_child_nodes(node))
            continue
        skipped.update(id(part) for part in _left_alone(node))
        yield node


def _left_alone(node: ast.AST) -> list[ast.AST]:
    """Return the parts of a node that no change touches."""
    parts: list[ast.AST | None] = []
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        parts = [node.returns, *node.decorator_list]
    elif isinstance(node, ast.ClassDef):
        parts = [*node.decorator_list]
    elif isinstance(node, (ast.arg, ast.AnnAssign)):
        parts = [node.annotation]
    elif isinstance(node, ast.Call) and _called(node) in TOLD:
        parts = [*node.args, *node.keywords]
    elif _is_left_alone(node):
        parts = list(ast.iter_child_nodes(node))
    return [part for part in parts if part is not None]


def _is_left_alone(node: ast.AST) -> bool:
    """Return whether no change touches a node at all."""
    return (
        isinstance(node, (ast.Raise, ast.JoinedStr))
        or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
        or (isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__")
        or (isinstance(node, ast.keyword) and node.arg in LANGUAGE)
    )


def _called(node: ast.Call) -> str:
    """Return the last part of a called name."""
    return (
        node.func.attr
        if isinstance(node.func, ast.Attribute)
        else getattr(node.func, "id", "")
    )


def _of_node(source: Source, node: ast.AST) -> Iterator[Change]:
    """Yield every change of one node."""
    if (
        isinstance(node, ast.BinOp)
        and type(node.op) in ARITHMETIC
        and not _is_text(node.left)
        and not _is_text(node.right)
    ):
        yield from _binary(source, node)
    elif isinstance(node, ast.UnaryOp):
        yield from _unary(source, node)
    elif isinstance(node, ast.Constant):
        yield from _constant(source, node)
    elif isinstance(node, ast.Compare) and len(node.ops) == 1:
        yield from _comparison(source, node)
    elif isinstance(node, ast.BoolOp):
        other = " or " if isinstance(node.op, ast.And) else " and "
        yield source.swap(
            node,
            "(" + other.join(f"({source.of(v)})" for v in node.values) + ")",
            f"and, or -> {other.strip()}",
        )
    elif isinstance(node, (ast.If, ast.IfExp, ast.While)):
        yield source.swap(
            node.test, f"not ({source.of(node.test)})", "condition reversed"
        )
        if (
            isinstance(node, ast.If)
            and not node.orelse
            and isinstance(
                node.body[-1], (ast.Raise, ast.Return, ast.Continue, ast.Break)
            )
        ):
            yield source.swap(node.test, "False", "guard dropped")
    elif isinstance(node, ast.comprehension):
        yield from (
            source.swap(test, f"not ({source.of(test)})", "condition reversed")
            for test in node.ifs
        )
    elif isinstance(node, ast.Call):
        yield from _call(source, node)
    elif (
        isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Load)
        and node.attr in SLIPPED
    ):
        last = source.span(node)[1]
        yield Change(
            last - len(node.attr), last, node.attr, SLIPPED[node.attr], "component slip"
        )
    elif isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Load):
        yield from _subscript(source, node)


def _is_text(node: ast.AST) -> bool:
    """Return whether a node is a text or a sequence written out: ``+`` joins those."""
    if isinstance(node, ast.BinOp):
        return _is_text(node.left) or _is_text(node.right)
    return isinstance(node, (ast.JoinedStr, ast.Tuple, ast.List, ast.ListComp)) or (
        isinstance(node, ast.Constant) and isinstance(node.value, (str, bytes))
    )


def _binary(source: Source, node: ast.BinOp) -> Iterator[Change]:
    """Yield another operator, swapped operands, one operand alone."""
    left, right = source.of(node.left), source.of(node.right)
    old, new = ARITHMETIC[type(node.op)]
    yield from source.between(node.left, node.right, old, new, "arithmetic")
    if isinstance(node.op, (ast.Sub, ast.Div, ast.FloorDiv, ast.Mod)):
        yield source.swap(node, f"(({right}) {old} ({left}))", "operands swapped")
    kind = (
        "term dropped" if isinstance(node.op, (ast.Add, ast.Sub)) else "factor dropped"
    )
    yield source.swap(node, f"({left})", kind)
    if isinstance(node.op, (ast.Add, ast.Mult)):
        yield source.swap(node, f"({right})", kind)


def _unary(source: Source, node: ast.UnaryOp) -> Iterator[Change]:
    """Yield the operand without its sign or its ``not``."""
    if isinstance(node.op, ast.USub):
        yield source.swap(node, f"({source.of(node.operand)})", "sign dropped")
    elif isinstance(node.op, ast.Not):
        yield source.swap(node, f"({source.of(node.operand)})", "not dropped")


def _constant(source: Source, node: ast.Constant) -> Iterator[Change]:
    """Yield a number beside this one, or the other truth."""
    value = node.value
    if isinstance(value, bool):
        yield source.swap(node, str(not value), "truth reversed")
    elif isinstance(value, int):
        yield source.swap(node, str(value + 1), "whole number + 1")
        yield source.swap(node, str(value - 1) if value else "(-1)", "whole number - 1")
    elif isinstance(value, float) and value != 0.0:
        yield source.swap(node, repr(value * 1.01), "constant 1 % up")


def _comparison(source: Source, node: ast.Compare) -> Iterator[Change]:
    """Yield the other boundary and the other side."""
    for table, kind in ((BOUNDARY, "boundary"), (REVERSED, "comparison reversed")):
        if type(node.ops[0]) in table:
            old, new = table[type(node.ops[0])]
            yield from source.between(node.left, node.comparators[0], old, new, kind)


def _call(source: Source, node: ast.Call) -> Iterator[Change]:
    """Yield a function's rival, its limit dropped, its arguments exchanged."""
    name, plain = (
        _called(node),
        not node.keywords and not any(isinstance(a, ast.Starred) for a in node.args),
    )
    if name in RENAMED:
        last = source.span(node.func)[1]
        yield Change(last - len(name), last, name, RENAMED[name], "another function")
    if name in LIMITS and plain and node.args:
        yield from (
            source.swap(node, f"({source.of(a)})", "limit dropped")
            for a in node.args[: 1 if name == "clip" else 2]
        )
    if name == "where" and plain and len(node.args) == 3:
        condition, yes, no = (source.of(a) for a in node.args)
        yield source.swap(
            node,
            f"{source.of(node.func)}({condition}, {no}, {yes})",
            "condition reversed",
        )
    if isinstance(node.func, ast.Attribute) and plain:
        owner = source.of(node.func.value)
        if name == "rotation" and not node.args:
            yield source.swap(node, f"{source.of(node)}.T", "rotation transposed")
        if name == "cross" and len(node.args) == 1:
            yield source.swap(
                node, f"({source.of(node.args[0])}).cross({owner})", "operands swapped"
            )
        if name in DROPPED_METHODS and not node.args:
            yield source.swap(node, f"({owner})", "method dropped")
    yield from _exchanged(source, node)


def _exchanged(source: Source, node: ast.Call) -> Iterator[Change]:
    """Yield two neighbouring keyword arguments with each other's value, and an update
    left out of ``replace``.
    """
    named = [k for k in node.keywords if k.arg is not None and k.arg not in LANGUAGE]
    for one, two in itertools.pairwise(named):
        a, b = source.of(one.value), source.of(two.value)
        if a != b:
            first, last = source.span(one)[0], source.span(two)[1]
            middle = source.text[source.span(one)[1] : source.span(two)[0]]
            yield Change(
                first,
                last,
                source.text[first:last],
                f"{one.arg}={b}{middle}{two.arg}={a}",
                "keyword values swapped",
            )
    if _called(node) == "replace" and len(node.args) == 1 and len(named) > 1:
        for dropped in named:
            kept = ", ".join(
                source.of(part)
                for part in (
                    *node.args,
                    *(k for k in node.keywords if k is not dropped),
                )
            )
            yield source.swap(node, f"{source.of(node.func)}({kept})", "update dropped")


def _subscript(source: Source, node: ast.Subscript) -> Iterator[Change]:
    """Yield the other end of a queue."""
    other = {"0": "-1", "-1": "0", "1:": ":-1", ":-1": "1:"}.get(source.of(node.slice))
    if other is not None:
        yield source.swap(node.slice, other, "queue index slip")
