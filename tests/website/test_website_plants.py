"""Differences between the plants that docs/data/the_paper.md shows are those that are
flown.
"""

from __future__ import annotations

import pytest
from plants_compared import INTEGRATORS, compared, row
from staged_pages import DOCS

PAGE = DOCS / "data" / "the_paper.md"
ROWS = PAGE.read_text("utf-8").partition("## Plants compared")[2]


@pytest.mark.site
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_the_plants_differ_as_the_page_says(integrator: str) -> None:
    assert row(integrator, *compared(integrator)[:2])[:-1] in ROWS


def test_every_integrator_has_a_row() -> None:
    assert all(f"| `{name}` | " in ROWS for name in INTEGRATORS)
