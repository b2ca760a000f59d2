"""The tables of docs/data/results_laws.md are what flights give; every law has its card
in docs/laws, diagram and row.
"""

from __future__ import annotations

import re

import pytest
from block_diagrams import svg
from law_diagrams import DIAGRAMS
from law_envelopes import entrant, flown, rows, shown
from page_snippets import DOCS
from written_words import words

from skyarm.control.catalogue import LAWS, PRESETS, is_named, make_controller
from skyarm.records.registry.shipped import SHIPPED
from support.laws import MODEL

SHIPPED_LAWS = SHIPPED["law"]
QUICK = {"guo2023"}
"""Flown in every run of the tests; the others by `make docs`."""
WITHOUT = {"nmpc"}
"""Its numbers stand on a page of their own: a flight takes seconds."""
TEXT = (DOCS / "laws.md").read_text("utf-8")
SECTIONS = {
    path.stem: path.read_text("utf-8") for path in sorted((DOCS / "laws").glob("*.md"))
}
"""Law -> its card."""


def test_every_law_that_ships_has_a_section_a_diagram_and_a_row() -> None:
    assert set(SECTIONS) == set(SHIPPED_LAWS) == set(DIAGRAMS)
    flies = {entrant(name).law for name in rows()}
    assert {PRESETS[law].law if law in PRESETS else law for law in flies} == set(
        SHIPPED_LAWS
    ) - WITHOUT


def test_the_first_table_names_every_law_once_with_a_controller() -> None:
    table = re.findall(
        r"^\| \[`(\w+)`\]\(laws/\1\.md\) \| .+ \| (`\w+`(?:, `\w+`)*) \|$", TEXT, re.M
    )
    assert sorted(law for law, _ in table) == sorted(SHIPPED_LAWS)
    for law, controller in (
        (law, name) for law, cell in table for name in re.findall(r"\w+", cell)
    ):
        assert is_named(controller), controller
        flies = (
            PRESETS[controller].law
            if controller in PRESETS
            else controller.removesuffix("_tuned")
        )
        assert flies == law


CARD = (
    "**Use it when** ",
    "**Not when** ",
    "<!-- generated: card ",
    "```sh\nskyarm run ",
    "```text\n",
    "![Block diagram of ",
    "*Assumed*: ",
    "*Source*: ",
    "*Options*:\n\n<!-- generated: law ",
    "*Results*: ",
)
"""Parts of a card in their order."""
CARD_WORDS = 260


@pytest.mark.parametrize("name", sorted(SHIPPED_LAWS))
def test_every_card_is_of_one_form(name: str) -> None:
    card = SECTIONS[name]
    # prose is wrapped; a blank is either
    places = [
        (
            match.start()
            if (match := re.search(re.escape(part).replace("\\ ", r"\s"), card))
            else -1
        )
        for part in CARD
    ]
    assert -1 not in places, CARD[places.index(-1)]
    assert places == sorted(places)
    assert card.startswith(f"# {name}\n")
    assert f"](../images/laws/{name}.svg)" in card
    assert f"\n<!-- generated: card {name} -->\n" in card
    assert re.search(rf"^<!-- generated: law {name}( -\w+)* -->$", card, re.M)
    (source,) = re.findall(r"\*Source\*: (.*?)\n\n", card, re.S)
    assert re.search(r"\b(19|20)\d\d\b|this\s+project|of the paper", source), (
        "a source has a year, or is ours"
    )


@pytest.mark.parametrize("name", sorted(SHIPPED_LAWS))
def test_a_card_says_what_the_law_can_do(name: str) -> None:
    (row,) = re.findall(
        r"^\| (yes) \| (commands it|no) \| (commands them|kept at rest)"
        r" \| (yes|no) \| (yes|no) \|$",
        SECTIONS[name],
        re.M,
    )
    options, compiled = LAWS[name].options(), make_controller(name, MODEL).compiled
    answers = ("interaction" in options, "sideways" in options, compiled, compiled)
    assert [each.startswith(("yes", "commands")) for each in row[1:]] == list(answers)


@pytest.mark.parametrize("name", sorted(SHIPPED_LAWS))
def test_a_card_is_a_page_of_a_minute(name: str) -> None:
    assert words(SECTIONS[name]) <= CARD_WORDS


@pytest.mark.parametrize("name", sorted(DIAGRAMS))
def test_a_diagram_is_what_its_description_draws(name: str) -> None:
    drawing = (DOCS / "images" / "laws" / f"{name}.svg").read_text("utf-8")
    assert drawing == svg(DIAGRAMS[name]), (
        "python tests/website/block_diagrams.py draws it again"
    )


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in QUICK else pytest.mark.site)
        for name in rows()
    ],
)
def test_the_numbers_of_a_row_are_those_of_flights(name: str) -> None:
    for text, value in zip(rows()[name], flown(name), strict=True):
        # as printed; flights of other processors may differ in the last digit
        assert text == shown(value) or abs(float(text) - value) <= 0.011 * max(
            abs(value), 0.5
        ), (name, text, value)
