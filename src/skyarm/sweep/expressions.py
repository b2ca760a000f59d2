"""Expressions of named numbers: ``+ - * /``, parentheses, ``sqrt``; read by a small parser, never evaluated as code.

A name is a word or a dotted path (``arm``, ``plant.payload.mass``, ``plant.vehicle.links.0.body.mass``); one that has
other characters stands in double quotes. Numbers are written as in ``0.5`` or ``1e-3``.

    expression = term { ("+" | "-") term }
    term       = factor { ("*" | "/") factor }
    factor     = ("+" | "-") factor | number | name | "sqrt" "(" expression ")" | "(" expression ")"

Every error is one line with the expression and the place, counted in characters from 1. Python's own parser knows no
names with dots before digits and gives no such places.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping
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

OPERATIONS = {
    ("+", 1): np.positive,
    ("-", 1): np.negative,
    (FUNCTION, 1): np.sqrt,
    ("+", 2): np.add,
    ("-", 2): np.subtract,
    ("*", 2): np.multiply,
    ("/", 2): np.divide,
}
"""(sign, number of operands) -> function."""


class ExpressionError(ValueError):
    """An expression that cannot be read, or that has no value."""


@dataclass(frozen=True, slots=True)
class Token:
    """A token of an expression: its kind, its text, where it begins (from 0); of an operation its operands."""

    kind: str
    text: str
    at: int
    operands: int = 0


@dataclass(frozen=True, slots=True)
class Expression:
    """A parsed expression.

    Attributes:
        text: as given. names: that it needs, each once, in order. program: in postfix order.
        field: its name in messages.
    """

    text: str
    names: tuple[str, ...]
    program: tuple[Token, ...]
    field: str = "expression"

    def value(self, numbers: Mapping[str, Any]) -> Array:
        """Its value for numbers or arrays by name, which broadcast.

        Raises:
            ExpressionError: one line: a division by zero, the root of a negative number, or a result that is too large.
        """
        stack: list[Array] = []
        for step in self.program:
            if step.kind == "number":
                stack.append(np.asarray(float(step.text)))
            elif step.kind == "name":
                stack.append(np.asarray(numbers[step.text], dtype=float))
            else:
                given = np.broadcast_arrays(*stack[-step.operands :])
                del stack[-step.operands :]
                stack.append(self._result(step, given))
        return stack[0]

    def _result(self, step: Token, given: Any) -> Array:
        with np.errstate(all="ignore"):
            found = np.asarray(OPERATIONS[step.text, step.operands](*given))
        # what was NaN before, as a metric of an episode that did not fly, stays so and is no error
        wrong = ~np.isfinite(found) & np.logical_and.reduce([np.isfinite(each) for each in given])
        if wrong.any():
            first = [float(each[wrong].flat[0]) for each in given]
            why = "must give a finite number"
            if step.text == "/" and first[1] == 0.0:
                why = f"must not divide by zero ({first[0]:g} / 0)"
            elif step.text == FUNCTION:
                why = f"must take the root of a number of at least 0, not of {first[0]:g}"
            raise ExpressionError(f"{self.field} = {_wrong(self.text, step.at, why)}")
        return found


def read_expression(text: Any, known: Collection[str], field: str = "expression") -> Expression:
    """Read an expression.

    Args:
        text: of the expression.
        known: names that it may use.
        field: its name in messages.

    Raises:
        ExpressionError: one line with its place, and what is allowed there.
    """
    if not isinstance(text, str) or not text.strip():
        raise ExpressionError(f"{field} = {shown(text)}: must be an expression of named numbers, as 'a + 2 * b'")
    if len(text) > LONGEST:
        raise ExpressionError(f"{field} = {shown(text)}: must have at most {LONGEST} characters")
    text = " ".join(text.split())  # as messages show it, so that its places are theirs
    try:
        program = _Parser(text, known).program
    except ExpressionError as error:
        raise ExpressionError(f"{field} = {error}") from None
    names = tuple(dict.fromkeys(step.text for step in program if step.kind == "name"))
    return Expression(text=text, names=names, program=tuple(program), field=field)


def _wrong(text: str, at: int, why: str) -> ExpressionError:
    return ExpressionError(f"{shown(text)}: at {at + 1}: {why}")


def _tokens(text: str) -> Iterator[Token]:
    at = 0
    while at < len(text):
        found = TOKEN.match(text, at)
        if found is None or found.lastgroup is None:
            start = at + len(text[at:]) - len(text[at:].lstrip())
            allowed = f"must be a number, a name, '{FUNCTION}' or one of + - * / ( )"
            raise _wrong(text, start, f"{shown(text[start])} {allowed}")
        kind = found.lastgroup
        yield Token("name" if kind == "quoted" else kind, found[kind], found.start(kind))
        at = found.end()
    yield Token("end", "the end", len(text))


class _Parser:
    """Recursive descent over the tokens of a whole text; ``program`` is it in postfix order."""

    def __init__(self, text: str, known: Collection[str]) -> None:
        self.text, self.known, self.depth = text, known, 0
        self.tokens, self.program = [*_tokens(text)], list[Token]()
        self._sum()
        self._require("end", "must be an operator or the end")

    def _require(self, kind: str, why: str) -> None:
        """Refuse the next token if it is of another kind, or another sign."""
        token = self.tokens[0]
        if kind not in (token.kind, token.text):
            what = token.text if token.kind == "end" else shown(token.text)
            raise _wrong(self.text, token.at, f"{what} {why}")

    def _take(self, signs: str) -> Token | None:
        """The next token if it is one of these signs."""
        token = self.tokens[0]
        return self.tokens.pop(0) if token.kind == "sign" and token.text in signs else None

    def _emit(self, token: Token, operands: int) -> None:
        self.program.append(Token("operation", token.text, token.at, operands))

    def _chain(self, signs: str, operand: Callable[[], None]) -> None:
        operand()
        while sign := self._take(signs):
            operand()
            self._emit(sign, 2)

    def _sum(self) -> None:
        self._chain("+-", lambda: self._chain("*/", self._factor))

    def _factor(self) -> None:
        self.depth += 1
        if self.depth > DEEPEST:
            self._require("nothing", f"must not be inside more than {DEEPEST} parentheses and signs")
        if sign := self._take("+-"):
            self._factor()
            self._emit(sign, 1)
        elif self._take("("):
            self._closed_sum()
        else:
            self._operand()
        self.depth -= 1

    def _closed_sum(self) -> None:
        self._sum()
        self._require(")", "must be ')' or an operator")
        self.tokens.pop(0)

    def _operand(self) -> None:
        """A number, a name or a function of a sum."""
        if self.tokens[0].kind != "name":
            self._require("number", "must be a number, a name or '('")
        token = self.tokens.pop(0)
        if token.kind == "number":
            if not np.isfinite(float(token.text)):
                raise _wrong(self.text, token.at, f"{token.text} must be a finite number")
            self.program.append(token)
        elif self._take("("):
            if token.text != FUNCTION:
                why = f"{shown(token.text)} must not be called; the one function is {FUNCTION}"
                raise _wrong(self.text, token.at, why)
            self._closed_sum()
            self._emit(token, 1)
        elif token.text in self.known:
            self.program.append(token)
        else:
            there = f"{did_you_mean(token.text, self.known)}there are {', '.join(self.known) or 'none'}"
            raise _wrong(self.text, token.at, f"{shown(token.text)} must be a named number; {there}")
