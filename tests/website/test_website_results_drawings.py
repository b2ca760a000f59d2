"""Figures of the pages of results are those of their measured tables, and stand on
pages.
"""

from __future__ import annotations

import re

import pytest
from measured_numbers import DOCS
from results_drawings import FIGURES, IMAGES, column, drawing, sums, ticks


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_shows_its_table(name: str) -> None:
    assert (IMAGES / f"{name}.svg").read_text("utf-8") == drawing(FIGURES[name]), (
        "run python tests/website/results_drawings.py"
    )
    page = (DOCS / f"{name}.md").read_text("utf-8")
    assert re.search(rf"^!\[.+\]\(images/{name}\.svg\)$", page, re.M | re.S)


def test_every_row_of_a_table_has_its_place() -> None:
    for figure in FIGURES.values():
        rows = figure.rows()
        assert len(rows) >= 4
        assert {len(values) for _, values in rows} == {max(1, len(figure.series))}
        text = drawing(figure)
        assert all(f">{name}</text>" in text for name, _ in rows)


def test_columns_are_read_and_added() -> None:
    assert dict(column("caught-balls", 1, 2))["centroidal"] == [200.0, 200.0]
    # a row without a number is left out
    assert "PX4 on Cube Orange" not in dict(column("real-flights", 6))
    assert dict(sums("contact-laws"))["centroidal"] == [96.0]


def test_scales_hold_their_numbers() -> None:
    assert ticks(96.0, 0.0, log=False) == [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]
    assert ticks(26.0, 0.0, log=False)[-1] == 30.0
    assert ticks(672.0, 0.03, log=True) == pytest.approx(
        [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0]
    )
