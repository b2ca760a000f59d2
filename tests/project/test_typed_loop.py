"""The files that explain the closed loop say the type of everything that they pass
on.
"""

from __future__ import annotations

import ast
import importlib
import typing
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

TYPED = (
    "skyarm.simulate.loop_state",
    "skyarm.simulate.period",
    "skyarm.simulate.stages",
    "skyarm.world.component",
)
UNTYPED = {"Any", "object"}


def untyped_words(text: str) -> set[str]:
    """Words of some source that leave a type out, also in a type that is written as a
    text.
    """
    found = set()
    for node in ast.walk(ast.parse(text)):
        names = {getattr(node, "id", ""), getattr(node, "attr", "")}
        if isinstance(node, ast.alias):
            names.add(node.name)
        found |= names & UNTYPED
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            with suppress(SyntaxError):
                found |= untyped_words(node.value.strip())
    return found


def parts_of(alias: object) -> Iterator[object]:
    """A type and all types that it is made of."""
    yield alias
    for each in typing.get_args(alias):
        yield from parts_of(each)


@pytest.mark.parametrize("name", TYPED)
def test_no_type_of_the_loop_is_left_out(name: str) -> None:
    module = importlib.import_module(name)
    assert untyped_words(Path(str(module.__file__)).read_text("utf-8")) == set()
    aliases = {
        word: held for word, held in vars(module).items() if typing.get_args(held)
    }
    assert [
        word
        for word, held in aliases.items()
        if Any in parts_of(held) or object in parts_of(held)
    ] == []


@pytest.mark.parametrize(
    "line",
    [
        "x: Any = 1",
        "def f(x: dict[str, object]): ...",
        "x: typing.Any",
        "from typing import Any as Some",
        'y = cast("dict[str, Any]", x)',
    ],
)
def test_every_spelling_of_an_untyped_value_is_seen(line: str) -> None:
    assert untyped_words(line)


def test_words_of_comments_and_of_sentences_are_no_types() -> None:
    assert (
        untyped_words(
            '"""Any object that is seen."""\nx: tuple[float, ...] = ()  # object of Any'
        )
        == set()
    )
