"""The drawing of a bar on cables is that of its script, whose flights follow the closed
form.
"""

from __future__ import annotations

import re

import beam_drawing
import pytest


def test_the_lines_of_the_drawing_solve_the_equation_of_the_bar() -> None:
    for pull in beam_drawing.PULLS:
        for time in (1.0, 6.0):
            angles = [
                beam_drawing.closed_form(pull, time + step) * 3.14159265 / 180.0
                for step in (-1e-3, 0.0, 1e-3)
            ]
            slope = (angles[2] - angles[0]) / 2e-3
            near = angles[1] - angles[1] ** 3 / 6.0 + angles[1] ** 5 / 120.0  # its sine
            assert slope == pytest.approx(-0.5 * pull / 0.19 * near, abs=2e-3)


@pytest.mark.site
def test_the_drawing_is_that_of_its_script_and_its_dots_lie_on_its_lines() -> None:
    text = beam_drawing.drawing()
    assert beam_drawing.DRAWING.read_text("utf-8") == text, (
        "run python tests/website/beam_drawing.py"
    )
    dots = re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', text)
    seconds = [0.5 * k for k in range(12)]
    lines = [
        beam_drawing.place(t, beam_drawing.closed_form(p, t))
        for p in beam_drawing.PULLS
        for t in seconds
    ]
    assert len(dots) == len(lines)
    off = [abs(float(y) - at) for (_, y), (_, at) in zip(dots, lines, strict=True)]
    assert max(off) < 21.0  # px, 4 degrees
