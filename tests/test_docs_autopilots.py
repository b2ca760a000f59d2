"""The page on autopilots lists every option of their tables with its default, and every
fact that their logs hold.
"""

from __future__ import annotations

import ast
import inspect
import re
from contextlib import nullcontext
from pathlib import Path

import pytest

import skyarm
from skyarm.control.catalogue import AUTOPILOTS, make_controller
from skyarm.control.controller import autopilot_of
from skyarm.control.model import Model
from skyarm.scenario.scenario_record import ScenarioError
from skyarm.vehicle.vehicle_files import load_vehicle
from support.pages import DOCS, rows_of

PAGE = " ".join((DOCS / "autopilots.md").read_text("utf-8").split())
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
    options = set(AUTOPILOTS[name].options())
    table = set(rows("<!-- generated: law px4 -->"))
    assert options - {"gains", "program"} <= table
    assert "`program`, a path, is set in Python only" in PAGE
    taken, px4 = (
        inspect.signature(AUTOPILOTS[each].function()).parameters
        for each in (name, "px4")
    )
    said = re.search(
        r"`preparation` is (\d+) s under ArduPilot and (\d+) s under Betaflight, whose"
        r" `patience` is (\d+) s",
        PAGE,
    )
    assert said
    shown = {
        "ardupilot": {"preparation": said[1]},
        "betaflight": {"preparation": said[2], "patience": said[3]},
    }.get(name, {})
    # what is not said of an autopilot is as in the table, which is of PX4
    for option in options & {"climb", "preparation", "patience"}:
        usual = shown.get(option, px4[option].default)
        assert float(usual) == taken[option].default, option


def test_the_page_says_which_autopilots_have_the_options_of_few() -> None:
    having = {
        option: [name for name in AUTOPILOTS if option in AUTOPILOTS[name].options()]
        for option in ("instance", "outside")
    }
    assert "Only PX4 has `instance`" in PAGE
    assert having["instance"] == ["px4"]
    assert "`outside`, which Betaflight refuses," in PAGE
    assert having["outside"] == [*AUTOPILOTS]
    model = Model(vehicle=load_vehicle("pelican_arm2"))
    for name in AUTOPILOTS:
        autopilot = autopilot_of(make_controller(name, model, outside=True))
        refused = (
            pytest.raises(ScenarioError, match="outside: must be left out")
            if name == "betaflight"
            else nullcontext()
        )
        with refused:
            assert len(autopilot.outside_ports) == 2, name


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
