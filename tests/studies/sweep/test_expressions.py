"""Expressions of named numbers: values found by another way; hostile texts are refused
in one line with their place.
"""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from skyarm.studies.sweep.expressions import LONGEST, ExpressionError, read_expression

NUMBERS = {
    "a": 2.0,
    "b_2": -0.75,
    "plant.vehicle.links.0.body.mass": 0.25,
    "plant.payload.tip-2.mass": 1.5,
}


def drawn(chance: random.Random, depth: int) -> tuple[str, float]:
    """A text and its value, made together: no parser has a part in it."""
    kind = chance.choice(
        ["number", "name"]
        if depth == 0
        else ["sum", "product", "sign", "root", "number", "name"]
    )
    if kind == "number":
        value = chance.choice([0.5, 3.0, 12.25, 1e-3, 2e2])
        return chance.choice([repr(value), f"{value:e}", f" {value} "]), value
    if kind == "name":
        name = chance.choice(list(NUMBERS))
        return (f'"{name}"' if "-" in name else name), NUMBERS[name]
    if kind == "sign":
        text, value = drawn(chance, depth - 1)
        return f"-({text})", -value
    if kind == "root":
        text, value = drawn(chance, depth - 1)
        return f"sqrt(({text}) * ({text}))", math.sqrt(value * value)
    (left, one), (right, other) = drawn(chance, depth - 1), drawn(chance, depth - 1)
    if kind == "sum":
        return chance.choice(
            [(f"{left} + ({right})", one + other), (f"{left} - ({right})", one - other)]
        )
    if other != 0.0 and chance.random() < 0.5:
        return f"({left}) / ({right})", one / other
    return f"({left})*({right})", one * other


@pytest.mark.parametrize("text", ["1" + 350 * "0", "1e400", "a * " + 310 * "9"])
def test_a_number_beyond_the_largest_double_is_refused_in_a_line(text: str) -> None:
    with pytest.raises(ExpressionError, match="must be of finite numbers"):
        read_expression(text, NUMBERS)


def test_values_are_those_of_the_text() -> None:
    chance = random.Random(11)
    tried = 0
    while tried < 400:
        text, value = drawn(chance, 4)
        if len(text) > LONGEST:
            continue
        tried += 1
        assert float(read_expression(text, NUMBERS).value(NUMBERS)) == pytest.approx(
            value, rel=1e-12, abs=1e-12
        ), text


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 - 2 - 3", -4.0),
        ("8 / 4 / 2", 1.0),
        ("1 + 2 * 3", 7.0),
        ("(1 + 2) * 3", 9.0),
        ("-a * a", -4.0),
        ("2 * -a", -4.0),
        ("- - a", 2.0),
        ("+a", 2.0),
        ("sqrt(a * a + 0.75 * 0.75 * 0)", 2.0),
        (".5 + 1. + 1e0", 2.5),
        ("a-b_2", 2.75),
        ('"plant.payload.tip-2.mass" / 2', 0.75),
        ("\ta\n", 2.0),
    ],
)
def test_signs_bind_as_in_arithmetic(text: str, value: float) -> None:
    assert float(read_expression(text, NUMBERS).value(NUMBERS)) == value


def test_columns_give_a_column() -> None:
    read = read_expression("sqrt(x*x + z*z) / n", ("x", "z", "n"))
    assert read.names == ("x", "z", "n")
    x = np.array([3.0, 0.0, 5.0])
    np.testing.assert_array_equal(
        read.value({"x": x, "z": np.array([4.0, 2.0, 12.0]), "n": 2.0}), [2.5, 1.0, 6.5]
    )


GRAMMAR = "must be of finite numbers, names"

HOSTILE = [
    ("a.__class__", "at 1: 'a.__class__' must be a named number"),
    (
        "__import__('os')",
        "at 1: '__import__' must not be called; the one function is sqrt",
    ),
    ("exec(a)", "at 1: 'exec' must not be called"),
    ("a(2)", "at 1: 'a' must not be called"),
    ("sqrt", "at 1: 'sqrt' must be a named number"),
    ("sqrt a", "at 1: 'sqrt' must be a named number"),
    ("aa", "at 1: 'aa' must be a named number; did you mean 'a'? there are a, b_2"),
    ("plant.vehicle.links.0.body", "did you mean 'plant.vehicle.links.0.body.mass'?"),
    ("nan", "'nan' must be a named number"),
    ("True", "'True' must be a named number"),
    ("a a", f"at 3: {GRAMMAR}"),
    ("a)", f"at 2: {GRAMMAR}"),
    ("a+" * LONGEST + "a", f"must have at most {LONGEST} characters"),
    *((text, "must be an expression") for text in ("", "   ", 3, None, ["a"])),
    *(
        (text, GRAMMAR)
        for text in (
            "sqrt()",
            "sqrt(a, a)",
            "sqrt(*a)",
            "a ** 2",
            "a // 2",
            "a % 2",
            "a[0]",
            "a, a",
        )
    ),
    *(
        (text, GRAMMAR)
        for text in (
            "a; a",
            "a = 2",
            "2a",
            "1.2.3",
            "(a",
            "a +",
            "1e999",
            "2j",
            "'9'",
            '"',
            "...",
        )
    ),
    *(
        (text, GRAMMAR)
        for text in (
            "\N{CYRILLIC SMALL LETTER A}",
            "\N{LATIN SMALL LETTER E WITH ACUTE}0",
        )
    ),
    *(
        (text, GRAMMAR)
        for text in ("(" * 199 + "a", "a < a", "a == a", "{a}", "[a]", "-" * 200)
    ),
]


def test_another_text_is_refused_in_one_line_with_its_place() -> None:
    missed = []
    for text, words in HOSTILE:
        with pytest.raises(ExpressionError) as caught:
            read_expression(text, NUMBERS, "--over")
        found = str(caught.value)
        if words not in found or not found.startswith("--over = ") or "\n" in found:
            missed.append((text, found))
    assert missed == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 / x", "at 1: must not divide by zero (1 / 0)"),
        (
            "2 + sqrt(x - 1)",
            "at 5: must take the root of a number of at least 0, not of -1",
        ),
        ("1e300 * 1e300 * (x + 1)", "at 1: must give a finite number"),
    ],
)
def test_what_has_no_value_is_said_with_its_place(text: str, words: str) -> None:
    read = read_expression(text, ("x",), "--over")
    with pytest.raises(ExpressionError) as caught:
        read.value({"x": np.array([2.0, 0.0, 3.0])})
    assert words in str(caught.value)
    assert str(caught.value).startswith("--over = ")


def test_a_long_chain_has_its_value() -> None:
    terms = (LONGEST + 1) // 2
    assert (
        float(read_expression("+".join("a" * terms), ("a",)).value({"a": 1.0})) == terms
    )


def test_what_is_not_there_stays_so() -> None:
    found = read_expression("x + 1", ("x",)).value({"x": np.array([np.nan, 1.0])})
    np.testing.assert_array_equal(found, [np.nan, 2.0])
