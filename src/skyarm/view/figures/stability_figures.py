"""Nyquist diagrams of loops, and the torques that rotors can add to a hover."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from skyarm.stability.along import Locus
from skyarm.stability.disk_margins import MOST
from skyarm.view.figures.style import PAPER

Array = npt.NDArray[np.float64]

ACROSS, SIDE = 3, 2.1
"""Diagrams side by side, and in, of a diagram."""

SPAN = (-3.2, 1.2, -2.2, 2.2)
"""Of both axes: what lies farther off is far from -1."""

CURVE, DISK = "#0b4f8a", "#b2182b"

LINES = ((CURVE, "-"), (DISK, "--"))
"""Colour and dash of the first and the second boundary: either tells them apart."""


def nyquist_figure(loci: Sequence[Locus]) -> Figure:
    """Draw each loop's response, the point -1 and the disk that the symmetric disk margin keeps it out of.

    The disk's points are -1 / f for all factors f of the margin: on the real axis from -1 over the lowest gain to -1
    over the highest. At a margin of 2 it is the left half plane.
    """
    across = min(ACROSS, len(loci))
    down = -(-len(loci) // across)
    figure = PAPER.blank(across * SIDE, down * (SIDE + 0.25))
    every = figure.subplots(down, across, squeeze=False).ravel()
    for ax, locus in zip(every, loci, strict=False):
        _diagram(PAPER.dress(ax), locus)
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
    ax.set_title(title, **PAPER.small_words)


def attainable_torque_figure(boundaries: Sequence[tuple[str, Array]]) -> Figure:
    """Draw boundaries of attainable torque over each other.

    Args:
        boundaries: (label, corners (K, 2)) of at most two arm poses: roll and pitch torque, N m.
    """
    figure, ax = PAPER.single(PAPER.width, 3.0)
    for (label, corners), (color, dash) in zip(boundaries, LINES, strict=False):
        closed = np.vstack([corners, corners[:1]])
        ax.plot(closed[:, 0], closed[:, 1], dash, color=color, linewidth=1.2, label=label)
        ax.fill(closed[:, 0], closed[:, 1], color=color, alpha=0.08)
    ax.plot([0.0], [0.0], "+", color=PAPER.frame, markersize=6)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("roll torque, N m", **PAPER.small_words)
    ax.set_ylabel("pitch torque, N m", **PAPER.small_words)
    figure.legend(loc="outside upper center", ncols=2, frameon=False, prop=PAPER.prop)
    return figure
