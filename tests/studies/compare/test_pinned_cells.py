"""No change of the suites changes what they fly: digests of their cells, taken before
they became one Trial.
"""

from __future__ import annotations

import json

import pinned_cells as pins
import pytest

from support.cases import sampled

HELD: dict[str, str] = json.loads(pins.FILE.read_text("utf-8"))

FEW = (
    "paper-suite/paper_ct",
    "envelope-suite/hexarotor_arm6/centroidal_tip",
    "survive-suite/quadrotor_roll_arm2/centroidal_tip",
    "contact-suite/hybrid_ct",
    "team-suite/two_carry_a_bar/object_wrench",
)


@pytest.mark.parametrize("row", sampled(tuple(pins.ROWS), len(pins.ROWS), keep=FEW))
def test_the_cells_of_a_suite_are_what_they_were(row: str) -> None:
    assert pins.of_row(row) == HELD[row]


def test_every_row_has_cells_or_reasons() -> None:
    assert set(HELD) == set(pins.ROWS)
    assert all(sum(map(int, each.split()[:2])) for each in HELD.values())
