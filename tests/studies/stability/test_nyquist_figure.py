"""Diagrams of open loops: what lies far off leaves no line across them."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.patches import Circle

from skyarm.studies.stability.disk_margins import LoopMargin
from skyarm.studies.stability.flight_margins import Locus
from skyarm.studies.stability.nyquist_figure import nyquist_figure


def test_a_curve_that_comes_from_far_off_begins_where_it_can_be_seen():
    margin = LoopMargin(
        name="roll", group="rotors", port="commands", disk=1.0, frequency=2.0
    )
    L = np.array([-1e5 + 10.0j, -2.0 - 2e4j, -1.5 - 0.5j, -0.2 - 0.1j])
    (ax,) = nyquist_figure([Locus(margin, L)]).axes
    for line, sign in zip(ax.lines[:2], (1.0, -1.0), strict=True):
        assert np.isnan(line.get_xdata()[:2]).all()
        assert line.get_xdata()[2:].tolist() == [-1.5, -0.2]
        assert line.get_ydata()[2:].tolist() == [-0.5 * sign, -0.1 * sign]


def test_the_disk_goes_through_the_points_of_its_two_gains():
    margin = LoopMargin(
        name="roll", group="rotors", port="commands", disk=1.0, frequency=2.0
    )
    (ax,) = nyquist_figure([Locus(margin, np.array([-0.5 - 0.5j, -0.2 - 0.1j]))]).axes
    (disk,) = [each for each in ax.patches if isinstance(each, Circle)]
    low, high = margin.gain
    ends = [disk.center[0] - disk.radius, disk.center[0] + disk.radius]
    assert ends == pytest.approx([-1.0 / low, -1.0 / high])
    assert disk.center[1] == 0.0
