"""Errors of predictions over the horizon: the numbers that are given, on logarithmic
axes with units.
"""

from __future__ import annotations

import numpy as np

from skyarm.view.figures.prediction_figure import PredictionCurve, prediction_figure
from skyarm.view.figures.style import image_bytes

HORIZONS = (0.01, 0.1, 1.0)
CURVES = {
    "identified vehicle": PredictionCurve(
        position=(1e-4, 3e-3, 0.1), attitude=(1e-3, 0.02, 0.2)
    ),
    "start vehicle": PredictionCurve(
        position=(2e-4, 6e-3, 0.3), attitude=(2e-3, 0.05, 0.6)
    ),
    "velocity and rate held": PredictionCurve(
        position=(3e-4, 9e-3, 0.5), attitude=(4e-3, 0.06, 0.9)
    ),
}


def test_each_panel_holds_its_errors_of_every_predictor():
    figure = prediction_figure(HORIZONS, CURVES)
    position, attitude = figure.axes
    for panel, field in ((position, "position"), (attitude, "attitude")):
        for line, curve in zip(panel.lines, CURVES.values(), strict=True):
            np.testing.assert_array_equal(line.get_xdata(), HORIZONS)
            np.testing.assert_array_equal(line.get_ydata(), getattr(curve, field))
        assert (panel.get_xscale(), panel.get_yscale(), panel.get_xlabel()) == (
            "log",
            "log",
            "Horizon [s]",
        )
    assert [panel.get_ylabel() for panel in figure.axes] == [
        "Position error, RMS [m]",
        "Attitude error, RMS [rad]",
    ]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(CURVES)
    styles = {
        (line.get_color(), line.get_linestyle(), line.get_marker())
        for line in position.lines
    }
    assert len(styles) == 3
    assert image_bytes(figure).startswith(b"\x89PNG")
