"""Colours of a depth picture, beside or within another picture."""

from __future__ import annotations

import numpy as np

from skyarm.records.arrays import Array, Pixels

SHADES = np.array(
    [[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]]
)
"""Colours from near to far, as those of Matplotlib's viridis."""

NOTHING = (217, 217, 217)
"""Colour of what has no depth."""


def depth_pixels(depth: Array) -> Pixels:
    """Colours (rows, columns, 3) of depths (m), from the nearest to the farthest."""
    pixels, known = np.full((*depth.shape, 3), NOTHING, np.uint8), np.isfinite(depth)
    far = depth[known] - depth[known].min(initial=np.inf)
    share = far / far.max(initial=1e-9) * (len(SHADES) - 1)
    for i, shade in enumerate(SHADES.T):
        pixels[known, i] = np.interp(share, range(len(shade)), shade)
    return pixels
