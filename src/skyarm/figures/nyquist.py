"""Nyquist diagrams of loops with the disks that they stay out of."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Circle, Rectangle

from skyarm.figures import style
from skyarm.stability.along import Locus
from skyarm.stability.disk_margins import MOST

ACROSS = 3
"""Diagrams side by side."""

SIDE = 2.1
"""in, of a diagram."""

SPAN = (-3.2, 1.2, -2.2, 2.2)
"""Of both axes: what lies farther off is far from -1."""

CURVE, DISK = "#0b4f8a", "#b2182b"


def nyquist_figure(loci: Sequence[Locus]) -> Figure:
    """Draw each loop's response, the point -1 and the disk that the symmetric disk margin keeps it out of.

    The disk's points are -1 / f for all factors f of the margin: on the real axis from -1 over the lowest gain to -1
    over the highest. At a margin of 2 it is the left half plane.
    """
    across = min(ACROSS, len(loci))
    down = -(-len(loci) // across)
    figure = Figure(
        figsize=(across * SIDE, down * (SIDE + 0.25)),
        layout=ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04),
        facecolor="white",
    )
    FigureCanvasAgg(figure)
    every = figure.subplots(down, across, squeeze=False).ravel()
    for ax, locus in zip(every, loci, strict=False):
        _diagram(style.dress(ax), locus)
    for ax in every[len(loci) :]:
        ax.set_axis_off()
    return figure


def _diagram(ax: Axes, locus: Locus) -> None:
    margin = locus.margin
    low, high = margin.gain
    if margin.disk >= MOST or low <= 0.0:
        ax.add_patch(Rectangle((SPAN[0], SPAN[2]), -SPAN[0], SPAN[3] - SPAN[2], color=DISK, alpha=0.15, linewidth=0.0))
    else:
        left, right = -1.0 / low, -1.0 / high
        ax.add_patch(Circle((0.5 * (left + right), 0.0), 0.5 * (right - left), color=DISK, alpha=0.15, linewidth=0.0))
    L = np.where(np.abs(locus.L) < 1e3, locus.L, np.nan)
    ax.plot(L.real, L.imag, color=CURVE, linewidth=1.1)
    ax.plot(L.real, -L.imag, color=CURVE, linewidth=0.6, linestyle="--")
    ax.plot([-1.0], [0.0], "+", color=DISK, markersize=6)
    ax.set_xlim(*SPAN[:2])
    ax.set_ylim(*SPAN[2:])
    ax.set_aspect("equal")
    title = f"{margin.name}: {margin.disk:.2f} at {margin.frequency:.3g} rad/s"
    ax.set_title(title, fontsize=style.SMALL_SIZE, family=style.FONT)
