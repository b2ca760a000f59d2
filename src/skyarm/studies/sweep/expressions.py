"""Arithmetic expressions of named parameters, and parameters derived by them.

    [vary]
    arm = { uniform = [0.10, 0.20] }  # a name of the study: a word without a dot

    [derived]
    "plant.vehicle.links.1.joint.position.z" = "-arm"             # flown
    "plant.vehicle.links.0.body.com.z" = "-arm / 2"
    reach = "2 * arm"  # only written into the rows

An expression has ``+ - * /``, parentheses, ``sqrt``, numbers, and the names of what
varies or is derived above it. A name is a word or a dotted path; one with other
characters stands in double quotes. It is read by Python's parser, of whose grammar no
more is allowed. Every error is one line with the expression and the place, in
characters from 1.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from skyarm.records.arrays import Array, Columns, doubles
from skyarm.records.files import Fields, did_you_mean, shown
from skyarm.records.immutable import positional

LONGEST = 400
"""Largest number of characters of an expression."""

MOST_DERIVED = 1000
"""Largest number of derived numbers of a study."""

FUNCTION = "sqrt"
"""The only function; its name is therefore no name of a number."""

WORD = r"[A-Za-z_]\w*"

NAME = re.compile(WORD, re.ASCII)

LETTER = "\N{LATIN SMALL LETTER E WITH ACUTE}"
"""Letter in the placeholders for names with dots or quotes, while Python parses an
expression."""

NAMES = re.compile(
    rf'"(?P<quoted>[^"]+)"|(?<![\w.])(?P<plain>{WORD}(?:\.\w+)*)(?P<call>\s*\()?',
    re.ASCII,
)

OPERATIONS: Mapping[type[ast.AST], np.ufunc] = {
    ast.UAdd: np.positive,
    ast.USub: np.negative,
    ast.Call: np.sqrt,
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
}

GRAMMAR = f"must be of finite numbers, names, + - * / ( ) and {FUNCTION}( )"


class ExpressionError(ValueError):
    """Error of an arithmetic expression that is invalid or has no finite value."""


@positional
class Expression:
    """Parsed arithmetic expression of a study's parameters.

    Attributes:
        text: text as given. names: names that it needs, each once, in order. field:
            name of the field in messages.
        tree: Python's. words: words of the tree -> name.
    """

    text: str
    names: tuple[str, ...]
    tree: ast.expr
    words: Mapping[str, str]
    field: str = "expression"

    def value(self, numbers: Mapping[str, npt.ArrayLike]) -> Array:
        """Evaluate the expression for given numbers or arrays by name, which broadcast.

        Raises:
            ExpressionError: one line: a division by zero, the root of a negative
                number, or a result that is too large.
        """
        return self._value(self.tree, numbers)

    def _value(self, node: ast.expr, numbers: Mapping[str, npt.ArrayLike]) -> Array:
        if isinstance(node, ast.Constant):
            return np.asarray(float(str(node.value)))
        if isinstance(node, ast.Name):
            return doubles(numbers[self.words[node.id]])
        given = np.broadcast_arrays(
            *(self._value(each, numbers) for each in _operands(node))
        )
        # errors are told below, with their places
        with np.errstate(all="ignore"):
            values = np.asarray(OPERATIONS[_operation(node)](*given))
        # what was NaN before, as a metric of an episode that did not fly, stays so and
        # is no error
        wrong = ~np.isfinite(values) & np.logical_and.reduce(
            [np.isfinite(each) for each in given]
        )
        if wrong.any():
            *first, last = (float(each[wrong].flat[0]) for each in given)
            why = "must give a finite number"
            if isinstance(node, ast.Call):
                why = f"must take the root of a number of at least 0, not of {last:g}"
            elif last == 0.0:
                why = f"must not divide by zero ({first[0]:g} / 0)"
            raise _wrong(self.field, self.text, node.col_offset, why)
        return values


def read_expression(
    text: object, known: Collection[str], field: str = "expression"
) -> Expression:
    """Parse an arithmetic expression of named parameters.

    Args:
        text: text of the expression.
        known: names that it may use.
        field: name of the field in messages.

    Raises:
        ExpressionError: one line with its place, and what is allowed there.
    """
    if not isinstance(text, str) or not text.strip():
        raise ExpressionError(
            f"{field} = {shown(text)}: must be an expression of named numbers, as 'a +"
            " 2 * b'"
        )
    if len(text) > LONGEST:
        raise ExpressionError(
            f"{field} = {shown(text)}: must have at most {LONGEST} characters"
        )
    text = " ".join(text.split())  # as messages show it, so that its places are theirs
    words: dict[str, str] = {}

    def word(match: re.Match[str]) -> str:
        """Python identifier in place of a dotted parameter name, of equal length to
        keep error positions.
        """
        name = match["quoted"] or match["plain"]
        call = match["call"] or ""
        if call and name != FUNCTION:
            why = f"{shown(name)} must not be called; the one function is {FUNCTION}"
            raise _wrong(field, text, match.start(), why)
        if call:
            return match[0]
        if name not in known:
            there = f"{did_you_mean(name, known)}there are {', '.join(known) or 'none'}"
            raise _wrong(
                field,
                text,
                match.start(),
                f"{shown(name)} must be a named number; {there}",
            )
        short = len(match[0]) < 3  # one or two letters are a word as they are
        words[
            stands := (
                name if short else f"{LETTER}{len(words)}".ljust(len(match[0]), LETTER)
            )
        ] = name
        return stands

    # no letter of the text may be taken for that of a placeholder
    plain = text if text.isascii() else text.replace(LETTER, "\0")
    parsed = NAMES.sub(word, plain)
    try:
        tree = ast.parse(parsed, mode="eval").body
    # the parser answers deep nesting by MemoryError
    except (SyntaxError, ValueError, MemoryError) as error:
        raise _wrong(
            field, text, (getattr(error, "offset", None) or 1) - 1, GRAMMAR
        ) from None
    for node in ast.walk(tree):
        number: Any = getattr(node, "value", "")
        # not math.isfinite, which overflows at whole numbers beyond the largest double
        is_number = type(number) in (int, float) and number <= sys.float_info.max
        is_name = getattr(node, "id", "") in (*words, FUNCTION)
        if is_number or is_name or not isinstance(node, ast.expr):
            continue
        if _operation(node) not in OPERATIONS or (
            isinstance(node, ast.Call) and len(_operands(node)) != 1
        ):
            raise _wrong(field, text, node.col_offset, GRAMMAR)
    return Expression(text, tuple(dict.fromkeys(words.values())), tree, words, field)


def _operands(node: ast.expr) -> list[ast.expr]:
    """Operands of an operation in the syntax tree of an expression."""
    below = [each for each in ast.iter_child_nodes(node) if isinstance(each, ast.expr)]
    return below[1:] if isinstance(node, ast.Call) else below


def _operation(node: ast.expr) -> type[ast.AST]:
    return type(node.op) if isinstance(node, ast.BinOp | ast.UnaryOp) else type(node)


def _wrong(field: str, text: str, at: int, why: str) -> ExpressionError:
    return ExpressionError(f"{field} = {shown(text)}: at {at + 1}: {why}")


def is_own_name(text: str) -> bool:
    """True for a parameter name without a dot: defined by the study, not a parameter
    path of its scenario.
    """
    return NAME.fullmatch(text) is not None


def derived_from(table: object, varied: Collection[str]) -> dict[str, Expression]:
    """Parse the expressions of a study's table ``derived``, by parameter.

    Args:
        table: path or name -> expression.
        varied: names and paths under ``vary``; each name must be used by an expression.

    Raises:
        ValueError: one line: an expression that cannot be read, or a number that varies
            already.
    """
    fields = Fields(table, "derived")
    if len(fields.table) > MOST_DERIVED:
        raise ValueError(
            f"derived = {len(fields.table)} numbers: must be at most {MOST_DERIVED}"
        )
    expressions: dict[str, Expression] = {}
    for name, text in fields.table.items():
        at = f'derived."{name}"'
        if name in varied:
            raise ValueError(f"{at} = {shown(text)}: must not be under vary as well")
        if name == FUNCTION:
            raise ValueError(
                f"{at} = {shown(text)}: must have another name than the function"
                f" {FUNCTION}"
            )
        expressions[name] = read_expression(text, (*varied, *expressions), at)
    used = {name for each in expressions.values() for name in each.names}
    for name in varied:
        if expressions and is_own_name(name) and name not in used:
            raise ValueError(
                f'vary."{name}": must be a path, or be used by an expression under'
                " derived"
            )
    return expressions


def with_derived(
    drawn: Mapping[str, Array], derived: Mapping[str, Expression]
) -> Columns:
    """Varied parameter values together with those that expressions derive from them.

    Raises:
        ExpressionError: one line that names the number: a division by zero, the root of
            a negative number.
    """
    values = dict(drawn)
    count = next((each.size for each in drawn.values()), 1)
    for name, expression in derived.items():
        values[name] = np.array(np.broadcast_to(expression.value(values), (count,)))
    return values
