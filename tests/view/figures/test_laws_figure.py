"""The picture of all laws: nothing hides behind another dot, and every number is in its
law's row.
"""

from __future__ import annotations

import numpy as np
import pytest

from skyarm.view.figures.comparison_figures import APART, Share, laws_figure


def test_series_that_agree_stand_beside_each_other_in_their_law_s_row():
    figure = laws_figure(
        ["a", "b"],
        {"perfect": [5.0, 7.0], "noisy": [5.0, None]},
        [Share(0.5, 0.4, 0.6), None],
        error_label="e",
        share_label="s",
    )
    left, right = figure.axes
    perfect, noisy = left.lines
    np.testing.assert_allclose(
        np.asarray(perfect.get_xydata()), [[5.0, -APART / 2], [7.0, 1.0 - APART / 2]]
    )
    np.testing.assert_allclose(np.asarray(noisy.get_xydata()), [[5.0, APART / 2]])
    # a dot is 5 pt high, a row 0.27 in
    assert APART * 0.27 * 72 > 5.0
    assert [patch.get_width() for patch in right.patches] == pytest.approx([0.5])
    assert (left.get_xlabel(), right.get_xlabel()) == ("e", "s")


def test_one_series_alone_stands_in_the_middle_of_its_row():
    figure = laws_figure(
        ["a"], {"perfect": [5.0]}, [None], error_label="e", share_label="s"
    )
    assert figure.axes[0].lines[0].get_ydata()[0] == 0.0
