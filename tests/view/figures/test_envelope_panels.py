"""The envelope's picture: a line for each law, broken where it is lost, with a cross in
the band above.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.view.figures.comparison_figures import (
    ACROSS,
    HIGH,
    LOW,
    LOWEST,
    PAGE,
    PANEL,
    TOP,
    envelope_figure,
)


def point(error, *, lost=False):
    """A flight, m."""
    return {"judged": error, "lost": lost}


AXES = {
    "circle": {
        "unit": "m/s",
        "values": [1.0, 2.0, 3.0],
        "laws": {
            "one": [point(0.001), point(0.01), point(None, lost=True)],
            "other": [point(1e-7), point(0.1), point(50.0)],
        },
    },
    "push_x": {"unit": "N", "values": [1.0], "laws": {"other": [point(0.02)]}},
}


def lines(panel):
    """(x, y, marker) of every line of a panel."""
    return [
        (*np.asarray(line.get_xydata()).T.tolist(), line.get_marker())
        for line in panel.lines
    ]


def test_a_lost_law_has_no_error_and_a_cross_in_the_band():
    figure = envelope_figure(AXES, ["one", "other"])
    panel = figure.axes[0]
    (_, error, _), (crosses, heights, mark), (_, whole, _), (none, _, _) = lines(panel)
    assert error[:2] == [1.0, 10.0]
    assert np.isnan(error[2])
    assert (crosses, mark) == ([2.0], "x")
    assert HIGH < heights[0] < TOP
    assert whole == [LOWEST, 100.0, HIGH], "what is beyond the axis stands at its edge"
    assert none == []
    assert panel.get_yscale() == "log"
    assert [label.get_text() for label in panel.get_xticklabels()] == ["1", "2", "3"]
    assert panel.get_title(loc="left") == "circle [m/s]"


def test_the_scale_begins_below_the_smallest_error_at_a_tenth_of_a_millimetre():
    for error, low in ((1e-3, LOW), (5e-5, 0.01), (2e-6, LOWEST), (None, LOW)):
        axis = {
            "unit": "N",
            "values": [1.0],
            "laws": {"one": [point(error, lost=error is None)]},
        }
        panel = envelope_figure({"x": axis}, ["one"]).axes[0]
        assert np.isclose(panel.get_ylim()[0], low)
        if error is not None:
            assert np.isclose(panel.lines[0].get_ydata()[0], 1e3 * error)


def test_a_law_keeps_its_look_where_others_do_not_fly():
    figure = envelope_figure(AXES, ["one", "other"])
    everywhere, alone = figure.axes[0].lines[2], figure.axes[1].lines[0]
    assert everywhere.get_color() == alone.get_color()
    assert figure.axes[0].lines[0].get_color() != alone.get_color()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "one",
        "other",
        "lost",
    ]


def test_a_known_law_looks_the_same_beside_any_others():
    def color(laws):
        axis = {
            "unit": "N",
            "values": [1.0],
            "laws": {law: [point(0.02)] for law in laws},
        }
        lines = envelope_figure({"x": axis}, laws).axes[0].lines[::2]
        return dict(zip(laws, [line.get_color() for line in lines], strict=True))

    alone, beside = (
        color(["centroidal_tip"]),
        color(["mine", "yours", "nmpc", "centroidal_tip"]),
    )
    assert alone["centroidal_tip"] == beside["centroidal_tip"]
    assert len(set(beside.values())) == 4


def test_panels_are_as_wide_as_the_page_divided_by_their_number_in_a_row():
    many = {f"axis{i}": AXES["push_x"] for i in range(ACROSS)}
    width, height = envelope_figure(many, ["one", "other"]).get_size_inches()
    assert width == pytest.approx(PAGE.width, rel=0.02)
    assert PANEL <= height <= PANEL + 1.0
