"""Drawn scenes of vehicles that touch with their shapes, on two plants whose contacts
share no code.
"""

from pathlib import Path

import pytest
from drawn_scenes import APART, PLANTS, compared

QUICK = ("leg_0", "landing_1")

MORE = ("table_1", "table_6", "leg_4", "wall_2", "team_2", "team_3", "fingers_3")


@pytest.mark.parametrize(
    "name",
    [*QUICK, *(pytest.param(each, marks=pytest.mark.thorough) for each in MORE)],
)
def test_both_plants_touch_the_same_bodies_and_end_at_the_same_places(
    name: str, tmp_path: Path
) -> None:
    ends, apart = compared(name, tmp_path)
    own, other = (ends[plant] for plant in PLANTS)
    assert own.status == other.status == "completed"
    assert own.touched.keys() == other.touched.keys() != set()
    assert apart < APART
