"""Depth pictures of a flight's cameras and lidars at some instants."""

from __future__ import annotations

import numpy as np

from skyarm.log.flight_log import rows_of
from skyarm.simulate.eyes import Eyes
from skyarm.view.figures.flight_facts import Named, Span
from skyarm.view.figures.style import PAPER, Picture

INSTANTS = 4
"""Largest number of pictures of a camera, from the first to the last."""

TALL, BAR = 1.6, 0.12
"""Height (in) of a picture, and widths of it that a colour bar takes."""


def depth_figure(flights: Named, span: Span) -> Picture:
    """Draw some depth pictures of each camera and lidar over a time interval, in m.

    What has no depth is grey.

    Args:
        flights: words of the legend -> log.
        span: first and last instant, s.

    Raises:
        ValueError: one line: no camera, or none with a picture within the interval.
    """
    rows = []
    for label, log in flights.items():
        eyes, own = Eyes.of_log(log), f"{label}: " * (len(flights) > 1)
        stop = np.searchsorted(log.time, span[1], "right")
        first = np.searchsorted(log.time, np.linspace(*span, INSTANTS))
        parts = [rows_of(log, slice(i, stop)) for i in first]
        for name in eyes.names:
            found = (next(eyes.frames(name, part), None) for part in parts)
            seen = {each.time: each.depth for each in found if each is not None}
            if seen:
                rows.append((own + name, seen))
    if not rows:
        raise ValueError(
            "kind = 'depth': must be another one, for the flights have no pictures of"
            " cameras in this window"
        )
    figure = PAPER.blank(PAPER.wide, TALL * len(rows))
    grid = figure.subplots(len(rows), INSTANTS, squeeze=False)
    for axes, (label, seen) in zip(grid, rows, strict=True):
        depths = np.ma.masked_invalid([*seen.values()])
        least, most = (depths.min(), depths.max()) if depths.count() else (0.0, 1.0)
        for ax in axes[len(seen) :]:
            ax.set_axis_off()
        for ax, time, depth in zip(axes, seen, depths, strict=False):
            ax.set(xticks=[], yticks=[], facecolor=PAPER.grid)
            image = ax.imshow(depth, "viridis_r", aspect="auto", vmin=least, vmax=most)
            ax.set_title(f"{label}, {time:g} s", **PAPER.small_words)
        bar = figure.colorbar(image, ax=axes, pad=0.01)
        bar.ax.tick_params(labelsize=PAPER.small, labelfontfamily=PAPER.font[0])
        bar.set_label("depth [m]", **PAPER.small_words)
    return figure
