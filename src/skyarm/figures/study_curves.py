"""A metric over each varied number of a study: a line for each law, its spread as a band."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator

from skyarm.figures import style
from skyarm.scenario.numbers import labelled
from skyarm.sweep.banded_curves import BandedCurves

COLUMNS = 3
WIDTH, HEIGHT, FURNITURE = 3.1, 2.3, 0.5
"""in: of one panel, and of legend and margins."""

ROUNDING = 1e-9
"""Extent below which values differ by rounding; it does not fill a panel."""

COLORS = ("#08306b", "#e6762b", "#1b7837", "#762a83", "#6b6b6b", "#b2182b")
DASHES: Sequence[Any] = ("-", (0, (3.2, 1.3)), (0, (6.0, 1.5, 1.0, 1.5)), (0, (6.0, 2.5)), (0, (2.0, 2.0)), ":")
"""Of the laws, in order; further ones begin again."""


def curves_figure(curves: Sequence[BandedCurves], label: str) -> Figure:
    """Draw a panel for each varied number, all on one value axis.

    Args:
        curves: from :func:`skyarm.sweep.banded_curves.metric_curves`; one at least.
        label: of the metric, with its unit.
    """
    columns = min(COLUMNS, len(curves))
    rows = -(-len(curves) // columns)
    layout = ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04)
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * rows + FURNITURE), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for ax in panels[len(curves) :]:
        ax.set_axis_off()
    for i, (ax, lines) in enumerate(zip(panels, curves, strict=False)):
        _panel(style.dress(ax), lines)
        if i % columns == 0:
            ax.set_ylabel(label, fontsize=style.SMALL_SIZE, family=style.FONT, parse_math=False)
    found = [line for lines in curves for each in lines.curves for line in (each.low, each.middle, each.high)]
    seen = np.concatenate(found)
    seen = seen[np.isfinite(seen)]
    if seen.size and np.ptp(seen) < ROUNDING:
        panels[0].set_ylim(*style.limits([seen], floor=bool((seen >= 0.0).all()), span=ROUNDING, cap=np.inf))
    handles, labels = panels[0].get_legend_handles_labels()
    style.legend(figure, handles, labels)
    return figure


def _panel(ax: Axes, lines: BandedCurves) -> None:
    for i, each in enumerate(lines.curves):
        color, dash = COLORS[i % len(COLORS)], DASHES[i % len(DASHES)]
        ax.fill_between(each.x, each.low, each.high, color=color, alpha=0.16, linewidth=0.0)
        ax.plot(each.x, each.middle, label=each.controller, color=color, linestyle=dash, linewidth=1.1)
    if lines.over.logarithmic:
        style.logarithmic(ax.xaxis)
    else:
        ax.xaxis.set_major_locator(MaxNLocator(nbins=5))
    label = labelled(lines.over.words, lines.over.unit)
    ax.set_xlabel(label, fontsize=style.SMALL_SIZE, family=style.FONT, parse_math=False)
