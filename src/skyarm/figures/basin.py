"""The basin of attraction as a static figure: share of caught flights by initial tilt and rate."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from skyarm.figures import style
from skyarm.figures.robustness import BOUNDARY, COLORS, HEIGHT, LINE, WIDTH
from skyarm.stability.basin import Basin

UPSIDE_DOWN = 90.0
"""degrees of tilt beyond which body z points down."""


def basin_figure(found: Basin) -> Figure:
    """Draw the map; bins without a flight stay blank, beyond the dashed line the flights began upside down."""
    figure = Figure(figsize=(WIDTH, HEIGHT), layout=ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04), facecolor="white")
    FigureCanvasAgg(figure)
    ax = style.dress(figure.subplots())
    ax.grid(visible=False)
    caught, flown = found.counts()
    share = np.ma.masked_invalid(np.where(flown > 0, caught / np.maximum(flown, 1), np.nan))
    tilts, rates = np.degrees(found.tilt_edges), found.rate_edges
    shade = ax.pcolormesh(tilts, rates, share, cmap=COLORS, vmin=0.0, vmax=1.0)
    middles = [0.5 * (edges[1:] + edges[:-1]) for edges in (tilts, rates)]
    if share.min() < BOUNDARY < share.max():
        ax.contour(*middles, share, levels=[BOUNDARY], colors=[LINE], linewidths=1.4)
    ax.axvline(UPSIDE_DOWN, color=style.FRAME, linestyle="--", linewidth=0.8)
    ax.set_xticks(range(0, 181, 30))
    title = f"{found.controller}: {found.caught.mean():.1%} of {len(found.caught)} flights caught"
    ax.set_title(title, fontsize=style.TEXT_SIZE, family=style.FONT)
    ax.set_xlabel("initial tilt, degrees", fontsize=style.SMALL_SIZE, family=style.FONT)
    ax.set_ylabel("initial body rate, rad/s", fontsize=style.SMALL_SIZE, family=style.FONT)
    bar = figure.colorbar(shade, ax=ax)
    bar.ax.tick_params(labelsize=style.SMALL_SIZE, labelfontfamily=style.FONT[0], width=0.5)
    bar.set_label("share caught", fontsize=style.SMALL_SIZE, family=style.FONT)
    return figure
