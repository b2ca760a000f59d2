"""Where things stand in a frame of a film: a title, a panel for each flight or one for all, a plot below."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

DESIGNED = 720.0
"""Pixels: the height for which the sizes below are meant; others are scaled."""

TITLE, HEAD, PLOT, GAP = 46.0, 40.0, 178.0, 4.0
"""Pixels of that height: bands of title and names, plot, space between panels."""

LEAST_HEIGHT_OF_PLOT = 240
"""Pixels: a lower frame has no room for a plot."""


@dataclass(frozen=True, slots=True)
class Box:
    """A part of the frame, pixels from its upper left corner."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """Parts of a frame.

    Attributes:
        width, height: of the whole. scale: of texts and bands, 1 at 720 lines.
        title: band at the top. heads: one above each panel, or in one band a part for each flight.
        panels: that are drawn in three dimensions. plot: of the error, None without.
    """

    width: int
    height: int
    scale: float
    title: Box
    heads: tuple[Box, ...]
    panels: tuple[Box, ...]
    plot: Box | None


def frame_layout(width: int, height: int, flights: int, layout: str, *, plot: bool) -> FrameLayout:
    """Divide a frame.

    Args:
        width: pixels.
        height: pixels.
        flights: number of them.
        layout: "side" or "over".
        plot: whether there shall be a plot; a frame that is too low for it has none.
    """
    scale = min(height / DESIGNED, width / (1.2 * DESIGNED))
    title, head, gap = (max(1, round(scale * part)) for part in (TITLE, HEAD, GAP))
    below = round(scale * PLOT) if plot and height >= LEAST_HEIGHT_OF_PLOT else 0
    top = title + head
    tall = height - top - below
    parts = _columns(width, flights, gap)
    heads = tuple(Box(left, title, wide, head) for left, wide in parts)
    panels = tuple(Box(left, top, wide, tall) for left, wide in (parts if layout == "side" else [(0, width)]))
    return FrameLayout(
        width=width,
        height=height,
        scale=scale,
        title=Box(0, 0, width, title),
        heads=heads,
        panels=panels,
        plot=Box(0, height - below, width, below) if below else None,
    )


def _columns(width: int, count: int, gap: int) -> list[tuple[int, int]]:
    """(left, width) of columns that fill the width."""
    edges = [round(i * (width + gap) / count) for i in range(count + 1)]
    return [(left, right - gap - left) for left, right in pairwise(edges)]
