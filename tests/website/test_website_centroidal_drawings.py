"""The drawings of docs/centroidal_law.md are what their script draws, and fit a
telephone.
"""

from __future__ import annotations

import re

import pytest
from centroidal_drawings import ARM, DRAWINGS, FOLDER, GOAL, LEAN, WIDTH, turned

PAGE = (FOLDER.parent / "centroidal_law.md").read_text("utf-8")


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_what_the_script_draws(name: str) -> None:
    shown = (FOLDER / name).read_text("utf-8")
    assert shown == DRAWINGS[name](), "run python tests/website/centroidal_drawings.py"
    assert f"](images/{name})" in PAGE


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_fits_a_telephone_and_its_letters_can_be_read(name: str) -> None:
    shown = DRAWINGS[name]()
    assert WIDTH <= 390
    assert min(map(int, re.findall(r'font-size="(\d+)"', shown))) >= 12
    assert all(
        0.0 <= float(x) <= WIDTH for x in re.findall(r'<text x="([\d.]+)"', shown)
    )
    assert "currentColor" in shown
    assert "#fff" not in shown


def test_the_tip_is_off_its_goal_by_the_tilt_of_a_stiff_arm_and_by_nothing_else() -> (
    None
):
    length = ARM[0] + ARM[1] + 32.0
    assert (0.0, length) == GOAL
    assert turned((0.0, 0.0), (0.0, length), -LEAN)[0] == pytest.approx(
        0.276 * length, rel=1e-2
    )
