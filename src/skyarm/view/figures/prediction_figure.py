"""Figure of open-loop predictions: errors of position and attitude against the horizon,
for several predictors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.lines import Line2D

from skyarm.records.immutable import positional
from skyarm.view.figures.style import PAPER, Picture, logarithmic

PANEL, LEGEND = (3.58, 2.35), 0.3
"""Size (in) of a panel, and height of the legend."""

MARKERS = ("o", "^", "s", "D")
"""Markers of the predictors in their order, except the last, which needs no model."""


@positional
class PredictionCurve:
    """Root mean square errors of a predictor for several prediction horizons.

    Attributes:
        position: m. attitude: rad.
    """

    position: Sequence[float]
    attitude: Sequence[float]


def prediction_figure(
    horizons: Sequence[float], curves: Mapping[str, PredictionCurve]
) -> Picture:
    """Draw errors of position and attitude against the horizon on logarithmic axes, a
    line for each predictor.

    Args:
        horizons: s, rising.
        curves: name of a predictor -> its errors; the first one is drawn the strongest,
            the last one dotted.
    """
    figure, panels = PAPER.tiles(2, 2, PANEL, LEGEND)
    handles = dict[str, Line2D]()
    for k, (name, curve) in enumerate(curves.items()):
        look = PAPER.desired if k == len(curves) - 1 and k > 0 else PAPER.look(k)
        marker = "" if k == len(curves) - 1 else MARKERS[k % len(MARKERS)]
        for panel, values in zip(panels, (curve.position, curve.attitude), strict=True):
            (handles[name],) = panel.plot(
                horizons, values, marker=marker, markersize=3.2, **look.line
            )
    for panel, label, unit in zip(
        panels,
        ("Position error, RMS", "Attitude error, RMS"),
        ("m", "rad"),
        strict=True,
    ):
        logarithmic(panel.xaxis)
        logarithmic(panel.yaxis)
        panel.set_xlabel("Horizon [s]", **PAPER.words)
        PAPER.name_axis(panel, label, unit)
    PAPER.legend(figure, handles)
    return figure
