"""The tables under *Envelope* on the pages of the laws are what flights give, and every law has its page."""

from __future__ import annotations

import re

import pytest
from block_diagrams import svg
from law_diagrams import DIAGRAMS
from law_envelopes import LAWS, flown, rows, shown, tables

from skyarm.records.registry.shipped import SHIPPED

SHIPPED_LAWS = SHIPPED["law"]
QUICK = {"guo2023"}
"""Flown in every run of the tests; the others by `make docs`."""
ENTRANTS = [(page, name) for page, names in tables().items() for name in names]
WITHOUT = {"nmpc"}
"""Its numbers stand on a page of their own: a flight takes seconds."""


def test_every_law_that_ships_has_a_page_a_diagram_and_a_table() -> None:
    pages = {path.stem for path in LAWS.glob("*.md")} - {"README"}
    assert pages == set(SHIPPED_LAWS) == set(DIAGRAMS)
    assert set(tables()) == pages - WITHOUT


@pytest.mark.parametrize("name", sorted(SHIPPED_LAWS))
def test_a_page_has_what_a_page_of_a_law_has(name: str) -> None:
    text = (LAWS / f"{name}.md").read_text("utf-8")
    assert text.startswith(f"# {name}\n")
    assert f"](../images/laws/{name}.svg)" in text
    heads = re.findall(r"^## (.*)$", text, re.M)
    assert [head for head in heads if head != "Equations"] == ["Source", "Envelope", "Fly it"]
    assert re.search(r"\b(19|20)\d\d\b|this project", text.split("## Source")[1].split("##")[0]), (
        "a source has a year, or is ours"
    )
    assert f"]({name}.md)" in (LAWS / "README.md").read_text("utf-8")


@pytest.mark.parametrize("name", sorted(DIAGRAMS))
def test_a_diagram_is_what_its_description_draws(name: str) -> None:
    drawing = (LAWS.parent / "images" / "laws" / f"{name}.svg").read_text("utf-8")
    assert drawing == svg(DIAGRAMS[name]), "python tests/website/block_diagrams.py draws it again"


@pytest.mark.parametrize(
    ("page", "name"), [pytest.param(*each, marks=[] if each[0] in QUICK else pytest.mark.site) for each in ENTRANTS]
)
def test_the_numbers_of_a_page_are_those_of_flights(page: str, name: str) -> None:
    table = rows(page)
    assert list(table) == tables()[page]
    for text, value in zip(table[name], flown(name), strict=True):
        # as printed; flights of other processors may differ in the last digit
        assert text == shown(value) or abs(float(text) - value) <= 0.011 * max(abs(value), 0.5), (name, text, value)
