"""Maps and bands as they are drawn: shares counted by hand, the line of half in its place, no band over a curve."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from logs_synthetic import WINDOWS, all_logs
from skyarm.view.figures.paper_figures import JOINT_ERRORS, POSITION_ERRORS, TOOL_ERRORS, paper_figures


def test_the_range_of_a_hold_hides_no_curve():
    found = 0
    for figure in paper_figures(all_logs()["rigid_body"], WINDOWS).values():
        for ax in figure.axes:
            bands = [each.get_zorder() for each in ax.collections if isinstance(each, PolyCollection)]
            curves = [each.get_zorder() for each in ax.get_lines() if not each.get_label().startswith("_")]
            assert not bands or max(bands) < min(curves)
            found += len(bands)
    assert found > 40


def test_an_error_is_the_measured_value_less_the_held_one():
    """The synthetic flight is off by (0.03, 0, -0.04) m, its tip by 0.01 m along y, its first joint by -0.02 rad."""
    log = all_logs()["rigid_body"]["case1"]["CT"]
    drawn = [*POSITION_ERRORS, *TOOL_ERRORS[:2], JOINT_ERRORS[0]]
    for quantity, off in zip(drawn, (0.03, 0.0, -0.04, 0.0, 0.01, -0.02), strict=True):
        assert quantity.of(log) == pytest.approx(np.full(log.time.size, off), abs=1e-12), quantity.label
