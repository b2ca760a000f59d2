"""Labels of a drawing, each where it covers no other one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from skyarm.figures.picture_styles import PictureStyle

Array = npt.NDArray[np.float64]

DISTANCES = (0.9, 1.4, 2.0, 2.8, 3.8, 5.0, 6.5)
"""Of a label from its point, in font sizes, nearest first."""

DIRECTIONS = 16

GAP = 0.12
"""Least gap between two labels, in font sizes."""

LEADER = 1.6
"""Distance from which a thin line leads from a label to its point, in font sizes."""


class Labels:
    """Labels of one panel, placed one after the other.

    Args:
        ax: with its limits set. style: of the picture. points: (N, 2) in data units that labels should leave free.
    """

    def __init__(self, ax: Axes, style: PictureStyle, points: Array) -> None:
        self.ax, self.style = ax, style
        self._taken: list[Bbox] = []
        self._points = ax.transData.transform(points) if points.size else np.zeros((0, 2))

    def put(self, text: str, at: Array, *, size: float | None = None, color: str | None = None) -> Text:
        """Write a label near a point (2,), where it covers no label and as few points as can be."""
        size = self.style.small if size is None else size
        words = {**self.style.small_words, "fontsize": size, "color": color or self.style.ink}
        label = self.ax.text(
            float(at[0]), float(at[1]), text, ha="center", va="center", zorder=9.0, linespacing=1.0, **words
        )
        label.set_path_effects([withStroke(linewidth=0.3 * size, foreground=self.style.face, alpha=0.8)])
        dots = size * self.ax.figure.dpi / 72.0
        here = self.ax.transData.transform(at)
        box = label.get_window_extent()
        best = min(self._tries(here, box, dots), key=lambda found: found[0])
        _, place, box = best
        x, y = self.ax.transData.inverted().transform(place)
        label.set_position((float(x), float(y)))
        self._taken.append(box.padded(GAP * dots))
        if math.dist(place, here) > LEADER * dots + 0.5 * box.width:
            self._lead(here, box, dots)
        return label

    def _tries(self, here: Array, box: Bbox, dots: float) -> list[tuple[float, Array, Bbox]]:
        """(cost, middle, box) of each place, in dots."""
        found = []
        inside = self.ax.bbox
        for distance in DISTANCES:
            for k in range(DIRECTIONS):
                angle = 2.0 * math.pi * (k + 0.5) / DIRECTIONS
                way = np.array([math.cos(angle), math.sin(angle)])
                room = 0.5 * np.array([box.width * abs(way[0]), box.height * abs(way[1])])
                place = here + way * (distance * dots) + np.sign(way) * room
                tried = Bbox.from_bounds(place[0] - 0.5 * box.width, place[1] - 0.5 * box.height, box.width, box.height)
                found.append((distance + self._cost(tried, inside, dots), place, tried))
        return found

    def _cost(self, box: Bbox, inside: Any, dots: float) -> float:
        wide = box.padded(GAP * dots)
        covered = sum(wide.overlaps(each) for each in self._taken)
        out = not (inside.x0 <= box.x0 and box.x1 <= inside.x1 and inside.y0 <= box.y0 and box.y1 <= inside.y1)
        x, y = self._points.T
        hits = int(((box.x0 <= x) & (x <= box.x1) & (box.y0 <= y) & (y <= box.y1)).sum())
        return 1000.0 * covered + 500.0 * out + 1.0 * min(hits, 8)

    def _lead(self, here: Array, box: Bbox, dots: float) -> None:
        """A thin line from the label's edge to the point."""
        edge = np.array([np.clip(here[0], box.x0, box.x1), np.clip(here[1], box.y0, box.y1)])
        ends = self.ax.transData.inverted().transform([edge, here])
        self.ax.plot(*ends.T, color=self.style.frame, linewidth=0.07 * self.style.small, zorder=8.0, label="_leader")
        del dots
