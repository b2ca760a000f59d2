"""The page on autopilots lists every option of their tables with its default, and every
fact that their logs hold.
"""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import pytest

import skyarm
from skyarm.control.catalogue import AUTOPILOTS
from support.pages import rows_of

LINKS = Path(skyarm.__file__).parent / "links" / "autopilots"


def rows(head: str) -> dict[str, list[str]]:
    """Words in code of the first column -> cells of their row."""
    return {
        word: row
        for row in rows_of("autopilots.md", head)
        for word in re.findall(r"`([\w*]+)`", row[0])
    }


def facts_of(name: str) -> set[str]:
    """Keys of the dictionary that the link of an autopilot returns as its facts."""
    tree = ast.parse((LINKS / f"{name}.py").read_text("utf-8"))
    (function,) = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name == "facts"
    ]
    return {
        node.value
        for node in ast.walk(function)
        if isinstance(node, ast.Constant) and _is_key(node, function)
    }


def _is_key(node: ast.Constant, function: ast.FunctionDef) -> bool:
    return any(
        node in each.keys for each in ast.walk(function) if isinstance(each, ast.Dict)
    )


def test_every_autopilot_is_a_column_with_its_variable() -> None:
    table = rows_of("autopilots.md", "| question | PX4 |")
    named = {row[0]: row[1:] for row in table}
    assert [each.strip("`") for each in named["name"]] == list(AUTOPILOTS)
    for name, variable in zip(AUTOPILOTS, named["variable with its path"], strict=True):
        assert f'"{variable.strip("`")}"' in (LINKS / f"{name}.py").read_text("utf-8")


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_options_and_defaults_of_the_page_are_those_of_the_autopilot(name: str) -> None:
    options, table = (
        set(AUTOPILOTS[name].options()),
        rows("| option of `[controller]` |"),
    )
    taken = inspect.signature(AUTOPILOTS[name].function()).parameters
    for option, row in table.items():
        said = re.search(r", of (\w+)", row[0])
        assert (option in options) == (said is None or said[1].lower() == name), option
    assert options <= set(table)
    # a default of one autopilot alone is named after a semicolon
    for option in options & {"climb", "preparation", "patience", "instance"}:
        usual, *own = re.split("[;,] ", table[option][2])
        shown = dict(each.lower().rsplit(" ", 1) for each in own).get(name, usual)
        assert float(shown) == taken[option].default, option


@pytest.mark.parametrize("name", AUTOPILOTS)
def test_facts_of_the_page_are_those_of_the_link(name: str) -> None:
    shown = {word for word in rows("| key | meaning |") if "*" not in word}
    patterns = [
        word.removesuffix("*") for word in rows("| key | meaning |") if "*" in word
    ]
    assert all(
        fact in shown or fact.startswith(tuple(patterns)) for fact in facts_of(name)
    ), facts_of(name)


def test_no_fact_of_the_page_is_unknown() -> None:
    known = {fact for name in AUTOPILOTS for fact in facts_of(name)} | {"prepared_s"}
    for word in rows("| key | meaning |"):
        assert any(fact.startswith(word.removesuffix("*")) for fact in known), word
