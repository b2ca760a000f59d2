"""The roll and pitch torques that rotors can add to a level hover, as a figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from skyarm.figures import style

Array = npt.NDArray[np.float64]

LINES = (("#0b4f8a", "-"), ("#b2182b", "--"))
"""Colour and dash of the first and the second boundary: either tells them apart."""


def attainable_torque_figure(boundaries: Sequence[tuple[str, Array]]) -> Figure:
    """Draw boundaries of attainable torque over each other.

    Args:
        boundaries: (label, corners (K, 2)) of at most two arm poses: roll and pitch torque, N m.
    """
    figure = Figure(
        figsize=(style.COLUMN_WIDTH, 3.0), layout=ConstrainedLayoutEngine(w_pad=0.04, h_pad=0.04), facecolor="white"
    )
    FigureCanvasAgg(figure)
    ax = style.dress(figure.subplots())
    for (label, corners), (color, dash) in zip(boundaries, LINES, strict=False):
        closed = np.vstack([corners, corners[:1]])
        ax.plot(closed[:, 0], closed[:, 1], dash, color=color, linewidth=1.2, label=label)
        ax.fill(closed[:, 0], closed[:, 1], color=color, alpha=0.08)
    ax.plot([0.0], [0.0], "+", color=style.FRAME, markersize=6)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("roll torque, N m", fontsize=style.SMALL_SIZE, family=style.FONT)
    ax.set_ylabel("pitch torque, N m", fontsize=style.SMALL_SIZE, family=style.FONT)
    prop = {"size": style.SMALL_SIZE, "family": style.FONT}
    figure.legend(loc="outside upper center", ncols=2, frameon=False, prop=prop)
    return figure
