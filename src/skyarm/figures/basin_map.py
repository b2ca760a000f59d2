"""The basin of attraction as a static figure: share of caught flights by initial tilt and rate."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from skyarm.figures import style
from skyarm.figures.robustness import BOUNDARY, COLORS, LINE, WIDTH
from skyarm.stability.basin import CAUGHT, RATES, TILTS, Basin

HEIGHT = 3.8
"""in: the caption needs more than a map alone."""

UPSIDE_DOWN = 90.0
"""degrees of tilt beyond which body z points down."""

ENOUGH = 50
"""Flights a bin for its shade: at half caught the share is then good to 0.07."""

SURE = 400
"""Flights a bin for the line of half caught: its share is then good to 0.025."""

BINS = ((TILTS, RATES), (9, 6), (6, 4))
"""(tilts, rates), finest first."""

LETTERS = 78
"""Of a line of the caption."""


def basin_figure(found: Basin) -> Figure:
    """Draw the map, coarser with fewer flights, and of very few each flight as a point.

    Bins without a flight stay blank, beyond the dashed line the flights began upside down.
    """
    figure = Figure(figsize=(WIDTH, HEIGHT), layout=ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04), facecolor="white")
    FigureCanvasAgg(figure)
    ax = style.dress(figure.subplots())
    ax.grid(visible=False)
    bins = bins_for(len(found.caught))
    if bins:
        _shares(figure, ax, found, bins)
    else:
        _points(ax, found)
    ax.axvline(UPSIDE_DOWN, color=style.FRAME, linestyle="--", linewidth=0.8)
    ax.set_xlim(0.0, 180.0)
    ax.set_xticks(range(0, 181, 30))
    title = f"{found.controller} in {found.scenario}: {found.caught.mean():.1%} of {len(found.caught)} flights caught"
    ax.set_title("\n".join(textwrap.wrap(title, 62)), fontsize=style.TEXT_SIZE, family=style.FONT)
    ax.set_xlabel("initial tilt, degrees", fontsize=style.SMALL_SIZE, family=style.FONT)
    ax.set_ylabel("initial body rate, rad/s", fontsize=style.SMALL_SIZE, family=style.FONT)
    caption = "\n".join(textwrap.wrap(f"Caught: {CAUGHT}.", LETTERS))
    figure.supxlabel(caption, fontsize=style.SMALL_SIZE, family=style.FONT, color=style.FRAME)
    return figure


def bins_for(flights: int, enough: int = ENOUGH) -> tuple[int, int] | None:
    """The finest (tilts, rates) with enough flights in each bin; None where there are too few for any."""
    return next((each for each in BINS if flights >= enough * each[0] * each[1]), None)


def _shares(figure: Figure, ax: Axes, found: Basin, bins: tuple[int, int]) -> None:
    """Shade of each bin, and the line on which half are caught where flights enough are there to tell."""
    leaning, turning, share = _map(found, bins)
    shade = ax.pcolormesh(leaning, turning, share, cmap=COLORS, vmin=0.0, vmax=1.0)
    sure = bins_for(len(found.caught), SURE)
    if sure:
        *edges, share = _map(found, sure)
        middles = [0.5 * (each[1:] + each[:-1]) for each in edges]
        if share.min() < BOUNDARY < share.max():
            ax.contour(*middles, share, levels=[BOUNDARY], colors=[LINE], linewidths=1.4)
    bar = figure.colorbar(shade, ax=ax)
    bar.ax.tick_params(labelsize=style.SMALL_SIZE, labelfontfamily=style.FONT[0], width=0.5)
    bar.set_label("share caught", fontsize=style.SMALL_SIZE, family=style.FONT)


def _map(found: Basin, bins: tuple[int, int]) -> tuple[Any, Any, Any]:
    """Edges in degrees of tilt and rad/s of rate, and the share caught of each bin."""
    caught, flown = found.counts(*bins)
    turning, leaning = found.edges(*bins)
    share = np.ma.masked_invalid(np.where(flown > 0, caught / np.maximum(flown, 1), np.nan))
    return np.degrees(leaning), turning, share


def _points(ax: Axes, found: Basin) -> None:
    """Each flight where it began: a disc if caught, a cross if not."""
    for chosen, marker, color, label in (
        (found.caught, "o", "#00204d", "caught"),
        (~found.caught, "x", LINE, "not caught"),
    ):
        at = np.degrees(found.tilt[chosen]), found.rate[chosen]
        ax.plot(*at, marker, color=color, markersize=2.5, markeredgewidth=0.7, linestyle="none", label=label)
    ax.set_ylim(0.0, found.rate_limit or 1.0)
    ax.legend(
        loc="upper right",
        framealpha=0.9,
        borderaxespad=0.3,
        prop={"size": style.SMALL_SIZE, "family": style.FONT},
    )
