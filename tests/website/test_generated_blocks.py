"""Blocks of the pages that the program generates are those that the program has."""

from __future__ import annotations

from pathlib import Path

import pytest
from generated_blocks import (
    BLOCK,
    KINDS,
    bounds,
    filled,
    made,
    pages,
    required_first,
    stale_blocks,
    table,
)

from skyarm.cli.commands import COMMANDS
from skyarm.records.units import Unit


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_no_block_of_a_page_is_stale(page: Path) -> None:
    """`python tests/website/generated_blocks.py --write` fills them; `make docs` calls
    it first.
    """
    assert stale_blocks(page) == [], (
        f"{page.name}: python tests/website/generated_blocks.py --write"
    )


def test_blocks_are_on_the_pages_of_the_reference() -> None:
    names = {page.name for page in pages()}
    assert {
        "scenario_files.md",
        "scenario_plant.md",
        "scenario_reference.md",
        "scenario_world.md",
        "scenario_sensors.md",
        "contact.md",
        "study_files.md",
        "environment_reference.md",
        "vehicle_files.md",
        "actuators.md",
        "command_line.md",
        "metrics.md",
    } <= names
    assert {"log_arrays.md", "checks.md", "python_api.md"} <= names


def test_an_option_states_its_default_once() -> None:
    blocks = [made(f"command {name}") for name in (*COMMANDS, "identify design")]
    assert "`25.0`" in blocks[-1]
    assert "[default" not in "".join(blocks)


def test_a_stale_block_an_open_one_and_an_unknown_kind_are_found(
    tmp_path: Path,
) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "a\n\n<!-- generated: presets -->\nold\n<!-- /generated -->\n\nb\n", "utf-8"
    )
    assert stale_blocks(page) == ["presets"]
    page.write_text(filled(page.read_text("utf-8")), "utf-8")
    assert stale_blocks(page) == []
    assert page.read_text("utf-8").startswith(
        "a\n\n<!-- generated: presets -->\n| preset | law | meaning |\n"
    )
    assert page.read_text("utf-8").endswith("\n\nb\n")
    page.write_text("<!-- generated: presets -->\n", "utf-8")
    assert len(stale_blocks(page)) == 1
    with pytest.raises(ValueError, match="tables: must be one of law, "):
        made("tables presets")
    assert all(
        BLOCK.fullmatch(f"<!-- generated: {kind} -->\n<!-- /generated -->")
        for kind in KINDS
    )


def test_columns_that_no_row_fills_are_left_out() -> None:
    assert (
        table(("a", "b", "c"), [("1", "", "2"), ("3", "", "")])
        == "| a | c |\n|-|-|\n| 1 | 2 |\n| 3 | - |\n"
    )
    assert "a \\| b" in table(("a",), [("a | b",)])


def test_required_fields_stand_first_and_rows_of_a_table_stay_below_it() -> None:
    rows = [
        ("`a`", "", "1"),
        ("`b`", "", "none"),
        ("`b.c`", "", "required"),
        ("`d`", "", "required"),
    ]
    assert [row[0] for row in required_first(rows)] == ["`d`", "`a`", "`b`", "`b.c`"]


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        (Unit("m"), ""),
        (Unit("m", low=0.0), "at least 0"),
        (Unit("m", low=0.0, strict=True), "above 0"),
        (Unit("", low=0.0, high=1.0), "0 to 1"),
        (Unit("", low=0.0, high=1.0, strict=True), "above 0, below 1"),
        (Unit("", high=2.5), "at most 2.5"),
    ],
)
def test_bounds_in_words(unit: Unit, words: str) -> None:
    assert bounds(unit) == words
