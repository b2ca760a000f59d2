"""Expressions of named numbers: ``+ - * /``, parentheses, ``sqrt``; read by a small parser, never evaluated as code.

A name is a word or a dotted path (``arm``, ``plant.payload.mass``, ``plant.vehicle.links.0.body.mass``); one that has
other characters stands in double quotes. Numbers are written as in ``0.5`` or ``1e-3``.

    expression = term { ("+" | "-") term }
    term       = factor { ("*" | "/") factor }
    factor     = ("+" | "-") factor | number | name | "sqrt" "(" expression ")" | "(" expression ")"

Every error is one line with the expression and the place, counted in characters from 1.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.files import did_you_mean, shown

Array = npt.NDArray[np.float64]

LONGEST = 500
"""Characters of an expression."""

DEEPEST = 50
"""Parentheses and signs in each other."""

TOKEN = re.compile(
    r"""\s*(?:
        (?P<number> (?:\d+\.?\d*|\.\d+) (?:[eE][+-]?\d+)? (?![\w.]) )
      | (?P<name>   [A-Za-z_]\w* (?:\.\w+)* )
      | "(?P<quoted>[^"]+)"
      | (?P<sign>   [-+*/()] )
    )""",
    re.VERBOSE | re.ASCII,
)

FUNCTION = "sqrt"


class ExpressionError(ValueError):
    """An expression that cannot be read, or that has no value."""


@dataclass(frozen=True, slots=True)
class Token:
    """One word of an expression: its kind, its text, where it begins (from 0)."""

    kind: str
    text: str
    at: int


@dataclass(frozen=True, slots=True)
class Node:
    """A number, a name, or an operation on what is inside it; ``at`` is where it stands in the text."""

    kind: str
    at: int
    text: str = ""
    inside: tuple[Node, ...] = ()


@dataclass(frozen=True, slots=True)
class Expression:
    """An expression as it was read.

    Attributes:
        text: as given. names: that it needs, each once, in order. field: what messages call it.
    """

    text: str
    names: tuple[str, ...]
    root: Node
    field: str = "expression"

    def value(self, numbers: Mapping[str, Any]) -> Array:
        """Its value for numbers or arrays by name, which broadcast.

        Raises:
            ExpressionError: one line: a division by zero, the root of a negative number, or a result that is too large.
        """
        with np.errstate(all="ignore"):
            return self._of(self.root, numbers)

    def _of(self, node: Node, numbers: Mapping[str, Any]) -> Array:
        if node.kind == "number":
            return np.asarray(float(node.text))
        if node.kind == "name":
            return np.asarray(numbers[node.text], dtype=float)
        parts = [self._of(each, numbers) for each in node.inside]
        found = _apply(node, parts)
        # what was NaN before, as a metric of an episode that did not fly, stays so and is no error
        wrong = ~np.isfinite(found) & np.logical_and.reduce([np.isfinite(each) for each in np.broadcast_arrays(*parts)])
        if wrong.any():
            raise ExpressionError(f"{self.field} = {_wrong(self.text, node.at, _why(node, parts, wrong))}")
        return found


def _apply(node: Node, parts: list[Array]) -> Array:
    if node.kind == FUNCTION:
        return np.sqrt(parts[0])
    if len(parts) == 1:
        return -parts[0] if node.kind == "-" else parts[0]
    one, other = parts
    operations = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}
    return np.asarray(operations[node.kind](one, other))


def _why(node: Node, parts: list[Array], wrong: Any) -> str:
    """What is wrong with an operation, for the first numbers that make it so."""
    first = [
        float(each[wrong][0]) if each.ndim else float(each) for each in map(np.asarray, np.broadcast_arrays(*parts))
    ]
    if node.kind == "/" and first[1] == 0.0:
        return f"must not divide by zero ({first[0]:g} / 0)"
    if node.kind == FUNCTION:
        return f"must take the root of a number of at least 0, not of {first[0]:g}"
    return "must give a finite number"


def read_expression(text: Any, known: Collection[str], field: str = "expression") -> Expression:
    """Read an expression.

    Args:
        text: of the expression.
        known: names that it may use.
        field: what messages call it.

    Raises:
        ExpressionError: one line with its place, and what is allowed there.
    """
    if not isinstance(text, str) or not text.strip():
        raise ExpressionError(f"{field} = {shown(text)}: must be an expression of named numbers, as 'a + 2 * b'")
    if len(text) > LONGEST:
        raise ExpressionError(f"{field} = {shown(text)}: must have at most {LONGEST} characters")
    text = " ".join(text.split())  # as messages show it, so that its places are theirs
    try:
        parser = _Parser(text, known)
        root = parser.whole()
    except ExpressionError as error:
        raise ExpressionError(f"{field} = {error}") from None
    return Expression(text=text, names=tuple(dict.fromkeys(parser.names)), root=root, field=field)


def _wrong(text: str, at: int, why: str) -> ExpressionError:
    return ExpressionError(f"{shown(text)}: at {at + 1}: {why}")


def _tokens(text: str) -> Iterator[Token]:
    at = 0
    end = len(text.rstrip())
    while at < end:
        found = TOKEN.match(text, at)
        if found is None or found.lastgroup is None:
            start = at + len(text[at:]) - len(text[at:].lstrip())
            raise _wrong(
                text, start, f"{shown(text[start])} must be a number, a name, '{FUNCTION}' or one of + - * / ( )"
            )
        kind = found.lastgroup
        yield Token("name" if kind == "quoted" else kind, found[kind], found.start(kind))
        at = found.end()


class _Parser:
    """Recursive descent over the tokens, one at a time."""

    def __init__(self, text: str, known: Collection[str]) -> None:
        self.text, self.known = text, known
        self.tokens = [*_tokens(text), Token("end", "", len(text.rstrip()))]
        self.next, self.depth = 0, 0
        self.names: list[str] = []

    def whole(self) -> Node:
        """The whole text as one expression."""
        root = self._sum()
        if self._here.kind != "end":
            raise self._refuse("must be an operator or the end")
        return root

    @property
    def _here(self) -> Token:
        return self.tokens[self.next]

    def _refuse(self, why: str) -> ExpressionError:
        what = shown(self._here.text) if self._here.kind != "end" else "the end"
        return _wrong(self.text, self._here.at, f"{what} {why}")

    def _take(self, *signs: str) -> Token | None:
        """The next token if it is one of these signs."""
        token = self._here
        if token.kind == "sign" and token.text in signs:
            self.next += 1
            return token
        return None

    def _sum(self) -> Node:
        found = self._product()
        while sign := self._take("+", "-"):
            found = Node(sign.text, sign.at, inside=(found, self._product()))
        return found

    def _product(self) -> Node:
        found = self._factor()
        while sign := self._take("*", "/"):
            found = Node(sign.text, sign.at, inside=(found, self._factor()))
        return found

    def _factor(self) -> Node:
        self.depth += 1
        if self.depth > DEEPEST:
            raise self._refuse(f"must not be inside more than {DEEPEST} parentheses and signs")
        found = self._signed_or_primary()
        self.depth -= 1
        return found

    def _signed_or_primary(self) -> Node:
        if sign := self._take("+", "-"):
            return Node(sign.text, sign.at, inside=(self._factor(),))
        if self._take("("):
            return self._closed(self._sum())
        token = self._here
        if token.kind not in ("number", "name"):
            raise self._refuse("must be a number, a name or '('")
        self.next += 1
        if token.kind == "number":
            if not np.isfinite(float(token.text)):
                raise _wrong(self.text, token.at, f"{token.text} must be a finite number")
            return Node("number", token.at, token.text)
        if self._take("("):
            if token.text != FUNCTION:
                raise _wrong(
                    self.text, token.at, f"{shown(token.text)} must not be called; the one function is {FUNCTION}"
                )
            return Node(FUNCTION, token.at, inside=(self._closed(self._sum()),))
        return self._name(token)

    def _closed(self, found: Node) -> Node:
        if not self._take(")"):
            raise self._refuse("must be ')' or an operator")
        return found

    def _name(self, token: Token) -> Node:
        if token.text not in self.known:
            there = ", ".join(self.known) or "none"
            meant = did_you_mean(token.text, self.known)
            raise _wrong(self.text, token.at, f"{shown(token.text)} must be a named number; {meant}there are {there}")
        self.names.append(token.text)
        return Node("name", token.at, token.text)
