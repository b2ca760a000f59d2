"""Nyquist diagrams with the disk of the symmetric disk margin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from skyarm.studies.stability.disk_margins import MOST
from skyarm.studies.stability.flight_margins import Locus
from skyarm.view.figures.style import PAPER

ACROSS, DIAGRAM = 3, 2.1
"""Number of diagrams side by side, and size (in) of a diagram."""

SPAN = (-3.2, 1.2, -2.2, 2.2)
"""Ranges of both axes; points beyond are far from -1."""

CURVE, DISK = "#0b4f8a", "#b2182b"


def nyquist_figure(loci: Sequence[Locus]) -> Figure:
    """Draw Nyquist curves of open loops with the point -1 and the disk of the symmetric
    disk margin.

    The disk's points are -1 / f for all factors f of the margin: on the real axis from
    -1 over the lowest gain to -1 over the highest. At a margin of 2 it is the left half
    plane.
    """
    # a quarter of an inch more, chosen, for the title above each
    figure, axes = PAPER.tiles(len(loci), ACROSS, (DIAGRAM, DIAGRAM + 0.25))
    for ax, locus in zip(axes, loci, strict=True):
        _diagram(ax, locus)
    return figure


def _diagram(ax: Axes, locus: Locus) -> None:
    margin = locus.margin
    low, high = margin.gain
    if margin.disk >= MOST or low <= 0.0:
        ax.add_patch(
            Rectangle(
                (SPAN[0], SPAN[2]),
                -SPAN[0],
                SPAN[3] - SPAN[2],
                color=DISK,
                alpha=0.15,
                linewidth=0.0,
            )
        )
    else:
        left, right = -1.0 / low, -1.0 / high
        ax.add_patch(
            Circle(
                (0.5 * (left + right), 0.0),
                0.5 * (right - left),
                color=DISK,
                alpha=0.15,
                linewidth=0.0,
            )
        )
    # a gap where the curve runs far out, not a line across the picture
    L = np.where(np.abs(locus.L) < 1e3, locus.L, np.nan)
    ax.plot(L.real, L.imag, color=CURVE, linewidth=1.1)
    ax.plot(L.real, -L.imag, color=CURVE, linewidth=0.6, linestyle="--")
    ax.plot([-1.0], [0.0], "+", color=DISK, markersize=6)
    ax.set_xlim(*SPAN[:2])
    ax.set_ylim(*SPAN[2:])
    ax.set_aspect("equal")
    title = f"{margin.name}: {margin.disk:.2f} at {margin.frequency:.3g} rad/s"
    ax.set_title(title, **PAPER.small_words)
