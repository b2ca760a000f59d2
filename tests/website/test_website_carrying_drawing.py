"""The drawing of the laws that carry a bar is that of its script and of the measured
table.
"""

from __future__ import annotations

import carrying_drawing


def test_the_drawing_is_that_of_its_script() -> None:
    assert carrying_drawing.DRAWING.read_text("utf-8") == carrying_drawing.drawing(), (
        "run python tests/website/carrying_drawing.py"
    )


def test_every_law_and_condition_of_the_table_is_drawn_inside_the_axes() -> None:
    rows = carrying_drawing.measured()
    assert {(row[0], row[1]) for row in rows} == {
        (condition, law)
        for condition in carrying_drawing.CONDITIONS
        for law in carrying_drawing.LAWS
    }
    for column, _, low, high, _ in carrying_drawing.PANELS:
        assert all(low <= float(row[column]) <= high for row in rows)
