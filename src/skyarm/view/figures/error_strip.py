"""Plot below a film's pictures: tip error or contact force over time, one curve per
flight, as pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from skyarm.records.arrays import Array, Pixels
from skyarm.records.immutable import positional
from skyarm.view.figures.style import PAGE, plain_numbers

DPI = 100.0
"""Resolution (dots per inch) of the plot, chosen: its size is stated in pixels, and
only the points of texts and lines depend on this number."""
TEXT = 12.5
"""Text size (pt) at 720 lines."""

SMALLEST, LARGEST = 1e-5, 1e2
"""Errors (m) at which smaller ones (on a logarithmic axis) and larger ones are drawn,
so that none stretches the axis."""

RATIO_OF_LOGARITHM = 30.0
"""Ratio of the median errors of two flights above which the axis is logarithmic: at
720 lines a linear axis of 119 pixels would leave the lower one 4 pixels."""

POINTS = 1500
"""Number of points of a curve, more than the usual film has columns for it; each is the
largest error of its interval."""


@positional
class Curve:
    """Curve of one flight in a film's plot, with its colour: tip error (m) or force (N)
    over time (s).
    """

    time: Array
    error: Array
    color: tuple[float, float, float]


@positional
class Strip:
    """Rendered plot of a film: pixels (height, width, 3), and the pixel positions of
    its time axis.

    Attributes:
        left, right: columns of the first and last instant. top, bottom: rows of the
            axes' edges.
    """

    pixels: Pixels
    left: float
    right: float
    top: int
    bottom: int


def error_strip(
    curves: Sequence[Curve],
    span: tuple[float, float],
    width: int,
    height: int,
    scale: float,
    *,
    forces: bool = False,
) -> Strip:
    """Render the plot of tip errors or contact forces over time that a film shows below
    its pictures.

    Args:
        curves: at least one.
        span: first and last instant, s.
        width: pixels.
        height: pixels.
        scale: scale of texts, 1 at 720 lines.
        forces: whether the curves are contact forces, N; else errors of the tip, m.
    """
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
    canvas: Any = FigureCanvasAgg(figure)
    style = replace(PAGE, text=TEXT * scale, small=TEXT * scale)
    # pixels left of the axes for numbers and a label, chosen; ticks and pads do not
    # shrink with the texts
    edge = 78.0 * scale + 10.0
    bottom, top = (40.0 * scale + 9.0) / height, 1.0 - 10.0 * scale / height
    ax = figure.add_axes(
        (edge / width, bottom, 1.0 - (edge + 26.0 * scale) / width, top - bottom)
    )
    style.dress(ax)
    logarithmic = not forces and _far_apart(curves)
    unit = 1.0 if forces else 1e3
    for curve in curves:
        clipped = np.clip(curve.error, SMALLEST if logarithmic else 0.0, LARGEST)
        every = max(1, len(clipped) // POINTS)
        whole = len(clipped) // every * every
        # the largest of each interval: a thinned curve would lose its peaks
        error = unit * clipped[:whole].reshape(-1, every).max(axis=1)
        ax.plot(
            curve.time[:whole:every], error, color=curve.color, linewidth=1.7 * scale
        )
    if logarithmic:
        ax.set_yscale("log")
        plain_numbers(ax.yaxis)
        ax.yaxis.set_minor_formatter(NullFormatter())
    else:
        ax.set_ylim(0.0, max(ax.get_ylim()[1], unit * SMALLEST))
        ax.yaxis.set_major_locator(MaxNLocator(nbins=3))
    ax.set_xlim(*span)
    ax.set_xlabel("time, s", labelpad=1.0, **style.words)
    ax.set_ylabel("force, N" if forces else "tip error, mm", **style.words)
    canvas.draw()
    box = ax.get_window_extent()
    # the canvas is drawn into again: the pixels must not change
    pixels = np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
    return Strip(
        pixels,
        float(box.x0),
        float(box.x1),
        # row 0 of an image is at the top, that of a figure at the bottom
        round(height - box.y1),
        round(height - box.y0),
    )


def _far_apart(curves: Sequence[Curve]) -> bool:
    # a median: one peak must not decide on the scale
    medians = [max(float(np.median(curve.error)), SMALLEST) for curve in curves]
    return max(medians) / min(medians) > RATIO_OF_LOGARITHM
