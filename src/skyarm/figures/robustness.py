"""Robustness maps as static figures: share of successes as shade, the failure boundary as a line."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from skyarm.figures import style
from skyarm.sweep.maps import RobustnessMap

WIDTH, HEIGHT = 4.2, 3.4
"""in."""

COLORS = "cividis"
"""Even in lightness, and read alike with every form of colour vision."""

BOUNDARY = 0.5
"""Share of successes on the failure boundary."""

LINE = "#d7301f"


def robustness_figure(found: RobustnessMap) -> Figure:
    """Draw one map; cells without an episode stay blank."""
    figure = Figure(figsize=(WIDTH, HEIGHT), layout=ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04), facecolor="white")
    FigureCanvasAgg(figure)
    ax = style.dress(figure.subplots())
    ax.grid(visible=False)
    shade = ax.pcolormesh(
        found.across.edges, found.upward.edges, np.ma.masked_invalid(found.rate), cmap=COLORS, vmin=0.0, vmax=1.0
    )
    if found.across.logarithmic:
        style.logarithmic(ax.xaxis)
    if found.upward.logarithmic:
        style.logarithmic(ax.yaxis)
    _boundary(ax, found)
    ax.set_title(found.controller, fontsize=style.TEXT_SIZE, family=style.FONT, parse_math=False)
    ax.set_xlabel(
        found.across.label or found.across.path, fontsize=style.SMALL_SIZE, family=style.FONT, parse_math=False
    )
    ax.set_ylabel(
        found.upward.label or found.upward.path, fontsize=style.SMALL_SIZE, family=style.FONT, parse_math=False
    )
    bar = figure.colorbar(shade, ax=ax)
    bar.ax.tick_params(labelsize=style.SMALL_SIZE, labelfontfamily=style.FONT[0], width=0.5)
    bar.set_label("share of successes", fontsize=style.SMALL_SIZE, family=style.FONT)
    return figure


def _boundary(ax: Axes, found: RobustnessMap) -> None:
    """The line on which half of the episodes succeed, where the map crosses it."""
    rate = found.rate
    if min(rate.shape) < 2 or not np.nanmin(rate) < BOUNDARY < np.nanmax(rate):
        return
    lines = ax.contour(
        found.across.centers,
        found.upward.centers,
        np.ma.masked_invalid(rate),
        levels=[BOUNDARY],
        colors=[LINE],
        linewidths=1.4,
    )
    lines.set_label("half succeed")
