"""A small chart of characters, with which ``skyarm run`` ends on a terminal."""

from __future__ import annotations

import sys

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WIDTH, HEIGHT = 60, 6
"""Columns and rows of characters between the axes."""

BLOCKS = " \u2581\u2582\u2583\u2584\u2585\u2586\u2587\u2588"
"""A cell filled by eighths, from below."""

ASCII = " .:|"
"""The same by thirds, where the terminal's encoding lacks blocks."""


def chart(time: Array, values: Array, title: str, *, width: int = WIDTH, blocks: bool | None = None) -> list[str]:
    """Lines of a chart of a quantity that is never negative, over time.

    Every column is the largest value in its stretch of time, so that no peak is lost; the axis begins at zero.

    Args:
        time: (N,) s, increasing.
        values: (N,); what is not finite is left out.
        title: what is shown, with its unit.
        width: columns of the drawing.
        blocks: draw with block characters; where standard output can write them, if left out.
    """
    kept = np.isfinite(values)
    if not kept.any():
        return []
    time, values = time[kept], values[kept]
    cells = BLOCKS if (_has_blocks() if blocks is None else blocks) else ASCII
    start, stop = float(time[0]), float(time[-1])
    place = np.minimum(((time - start) / max(stop - start, 1e-12) * width).astype(int), width - 1)
    heights = np.zeros(width)
    np.maximum.at(heights, place, values)
    # of fewer instants than columns each stays until the next
    heights = heights[np.maximum.accumulate(np.where(np.isin(np.arange(width), place), np.arange(width), 0))]
    top = float(values.max()) or 1.0
    steps = len(cells) - 1
    filled = np.ceil(heights / top * HEIGHT * steps - 1e-9).astype(int)
    numbers = [f"{top:.3g}", *[""] * (HEIGHT - 2), "0"]
    margin = max(map(len, numbers))
    lines = [title]
    for row, number in enumerate(numbers):
        below = (HEIGHT - 1 - row) * steps
        drawn = "".join(cells[min(max(count - below, 0), steps)] for count in filled)
        lines.append(f"{number:>{margin}} |{drawn.rstrip()}")
    ends = f"{start:.3g}", f"{stop:.3g} s"
    return [*lines, " " * margin + "  " + ends[0] + ends[1].rjust(width - len(ends[0]))]


def _has_blocks() -> bool:
    try:
        BLOCKS.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return False
    return True
