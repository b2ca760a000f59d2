"""Maps of a share of successes: robustness over two varied numbers, and the basin of attraction."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skyarm.stability.basin import CAUGHT, RATES, TILTS, Basin
from skyarm.sweep.maps import RobustnessMap
from skyarm.view.figures.style import PAPER, logarithmic

WIDTH, HEIGHT, BASIN_HEIGHT = 4.2, 3.4, 3.8
"""in: the caption of a basin needs more than a map alone."""

COLORS = "cividis"
"""Even in lightness, and read alike with every form of colour vision."""

BOUNDARY = 0.5
"""Share of successes on the failure boundary."""

LINE = "#d7301f"

UPSIDE_DOWN = 90.0
"""degrees of tilt beyond which body z points down."""

ENOUGH, SURE = 50, 400
"""Flights a bin for its shade, and for the line of half caught: a share is then good to 0.07, and to 0.025."""

BINS = ((TILTS, RATES), (9, 6), (6, 4))
"""(tilts, rates), finest first."""

LETTERS = 78
"""Of a line of the caption."""


def robustness_figure(found: RobustnessMap) -> Figure:
    """Draw the share of successes as shade, the failure boundary as a line; cells without an episode stay blank."""
    figure, ax = PAPER.single(WIDTH, HEIGHT)
    across, upward = found.across, found.upward
    _shade(figure, ax, (across.edges, upward.edges), found.rate, "share of successes")
    for side, axis in ((across, ax.xaxis), (upward, ax.yaxis)):
        if side.logarithmic:
            logarithmic(axis)
    _boundary(ax, (across.centers, upward.centers), found.rate)
    ax.set_title(found.controller, **PAPER.words)
    ax.set_xlabel(across.label or across.path, **PAPER.small_words)
    ax.set_ylabel(upward.label or upward.path, **PAPER.small_words)
    return figure


def basin_figure(found: Basin) -> Figure:
    """Draw the share of caught flights by initial tilt and rate, coarser with fewer flights, of very few as points.

    Bins without a flight stay blank, beyond the dashed line the flights began upside down.
    """
    figure, ax = PAPER.single(WIDTH, BASIN_HEIGHT)
    bins, sure = (bins_for(len(found.caught), enough) for enough in (ENOUGH, SURE))
    if bins:
        edges, share = _binned(found, bins)
        _shade(figure, ax, edges, share, "share caught")
    else:
        _points(ax, found)
    if sure:
        edges, share = _binned(found, sure)
        _boundary(ax, [0.5 * (each[1:] + each[:-1]) for each in edges], share)
    ax.axvline(UPSIDE_DOWN, color=PAPER.frame, linestyle="--", linewidth=0.8)
    ax.set_xlim(0.0, 180.0)
    ax.set_xticks(range(0, 181, 30))
    title = f"{found.controller} in {found.scenario}: {found.caught.mean():.1%} of {len(found.caught)} flights caught"
    ax.set_title("\n".join(textwrap.wrap(title, 62)), **PAPER.words)
    ax.set_xlabel("initial tilt, degrees", **PAPER.small_words)
    ax.set_ylabel("initial body rate, rad/s", **PAPER.small_words)
    caption = "\n".join(textwrap.wrap(f"Caught: {CAUGHT}.", LETTERS))
    figure.supxlabel(caption, **{**PAPER.small_words, "color": PAPER.frame})
    return figure


def bins_for(flights: int, enough: int = ENOUGH) -> tuple[int, int] | None:
    """The finest (tilts, rates) with enough flights in each bin; None where there are too few for any."""
    return next((each for each in BINS if flights >= enough * each[0] * each[1]), None)


def _shade(figure: Figure, ax: Axes, edges: Sequence[Any], share: Any, label: str) -> None:
    """Shade of each cell, with its bar."""
    ax.grid(visible=False)
    shade = ax.pcolormesh(*edges, np.ma.masked_invalid(share), cmap=COLORS, vmin=0.0, vmax=1.0)
    bar = figure.colorbar(shade, ax=ax)
    bar.ax.tick_params(labelsize=PAPER.small, labelfontfamily=PAPER.font[0], width=0.5)
    bar.set_label(label, **PAPER.small_words)


def _boundary(ax: Axes, centers: Sequence[Any], share: Any) -> None:
    """The line on which half of the episodes succeed, where the map crosses it."""
    if min(share.shape) >= 2 and np.nanmin(share) < BOUNDARY < np.nanmax(share):
        look: dict[str, Any] = {"levels": [BOUNDARY], "colors": [LINE], "linewidths": 1.4}
        ax.contour(*centers, np.ma.masked_invalid(share), **look).set_label("half succeed")


def _binned(found: Basin, bins: tuple[int, int]) -> tuple[tuple[Any, Any], Any]:
    """Edges in degrees of tilt and rad/s of rate, and the share caught of each bin."""
    caught, flown = found.counts(*bins)
    turning, leaning = found.edges(*bins)
    return (np.degrees(leaning), turning), np.where(flown > 0, caught / np.maximum(flown, 1), np.nan)


def _points(ax: Axes, found: Basin) -> None:
    """Each flight where it began: a disc if caught, a cross if not."""
    ax.grid(visible=False)
    for chosen, marker, color, label in (
        (found.caught, "o", "#00204d", "caught"),
        (~found.caught, "x", LINE, "not caught"),
    ):
        at = np.degrees(found.tilt[chosen]), found.rate[chosen]
        ax.plot(*at, marker, color=color, markersize=2.5, markeredgewidth=0.7, linestyle="none", label=label)
    ax.set_ylim(0.0, found.rate_limit or 1.0)
    ax.legend(loc="upper right", framealpha=0.9, borderaxespad=0.3, prop=PAPER.prop)
