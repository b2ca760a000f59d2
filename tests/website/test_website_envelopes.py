"""The table of docs/laws.md is what flights give, and every law has its section, diagram and row."""

from __future__ import annotations

import re

import pytest
from block_diagrams import svg
from law_diagrams import DIAGRAMS
from law_envelopes import LAWS, entrant, flown, rows, shown

from skyarm.control.catalogue import PRESETS, is_named
from skyarm.records.registry.shipped import SHIPPED

SHIPPED_LAWS = SHIPPED["law"]
QUICK = {"guo2023"}
"""Flown in every run of the tests; the others by `make docs`."""
WITHOUT = {"nmpc"}
"""Its numbers stand on a page of their own: a flight takes seconds."""
TEXT = LAWS.read_text("utf-8")
SECTIONS = dict(re.findall(r"^### (\w+)\n(.*?)(?=^##)", TEXT, re.M | re.S))


def test_every_law_that_ships_has_a_section_a_diagram_and_a_row() -> None:
    assert set(SECTIONS) == set(SHIPPED_LAWS) == set(DIAGRAMS)
    flies = {entrant(name).law for name in rows()}
    assert {PRESETS[law].law if law in PRESETS else law for law in flies} == set(SHIPPED_LAWS) - WITHOUT


def test_the_first_table_names_every_law_once_with_a_controller() -> None:
    table = re.findall(r"^\| \[`(\w+)`\]\(#\1\) \| .+ \| (`\w+`(?:, `\w+`)*) \|$", TEXT, re.M)
    assert sorted(law for law, _ in table) == sorted(SHIPPED_LAWS)
    for law, controller in ((law, name) for law, cell in table for name in re.findall(r"\w+", cell)):
        assert is_named(controller), controller
        flies = PRESETS[controller].law if controller in PRESETS else controller.removesuffix("_tuned")
        assert flies == law


@pytest.mark.parametrize("name", sorted(SHIPPED_LAWS))
def test_a_section_has_what_a_section_of_a_law_has(name: str) -> None:
    section = SECTIONS[name]
    assert f"](images/laws/{name}.svg)" in section
    (source,) = re.findall(r"\*Source\*: (.*?)(?:\n\n|\Z)", section, re.S) or [TEXT.split("*Source*: ")[1]]
    assert re.search(r"\b(19|20)\d\d\b|this\s+project|of the paper", source), "a source has a year, or is ours"


@pytest.mark.parametrize("name", sorted(DIAGRAMS))
def test_a_diagram_is_what_its_description_draws(name: str) -> None:
    drawing = (LAWS.parent / "images" / "laws" / f"{name}.svg").read_text("utf-8")
    assert drawing == svg(DIAGRAMS[name]), "python tests/website/block_diagrams.py draws it again"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.site) for name in rows()]
)
def test_the_numbers_of_a_row_are_those_of_flights(name: str) -> None:
    for text, value in zip(rows()[name], flown(name), strict=True):
        # as printed; flights of other processors may differ in the last digit
        assert text == shown(value) or abs(float(text) - value) <= 0.011 * max(abs(value), 0.5), (name, text, value)
