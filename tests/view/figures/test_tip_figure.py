"""The tip's error over time, from logs whose errors are known."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from logs_synthetic import STEADY, synthetic_log
from skyarm.view.figures.paper_figures import SMALLEST, tip_figure


def test_lines_are_the_largest_errors_of_short_stretches_in_millimetres():
    log = synthetic_log("case3_wind", "rigid_body", "CT", seconds=5.0)
    log = dataclasses.replace(log, tool_held=log.tool_held + 1.0)
    peak = log.tool.copy()
    peak[503] += np.array([0.0, 0.09, 0.0])  # at 2.515 s, onto the 10 mm along y
    exact = dataclasses.replace(log, tool=log.tool_reference)
    ended = dataclasses.replace(log, info={**log.info, "status": "diverged"})
    figure = tip_figure({"a": dataclasses.replace(log, tool=peak), "b": exact, "c": ended}, STEADY, "title")
    ax = figure.axes[0]
    a, b, c = (line for line in ax.lines if not str(line.get_label()).startswith("_"))
    assert [line.get_label() for line in (a, b, c)] == ["a", "b", "c (diverged)"]
    time, error = np.asarray(a.get_xdata()), np.asarray(a.get_ydata())
    np.testing.assert_allclose(np.diff(time), 0.05, rtol=1e-9)
    assert error[50] == pytest.approx(100.0)
    assert time[50] == pytest.approx(2.5)
    np.testing.assert_allclose(np.delete(error, 50), 10.0, rtol=1e-9)
    # an axis of powers has no zero
    np.testing.assert_allclose(np.asarray(b.get_ydata()), SMALLEST)
    assert ax.get_yscale() == "log"
    assert ax.get_ylabel() == "Error of the tip [mm]"
