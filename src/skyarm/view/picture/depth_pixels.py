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
    known = np.isfinite(depth)
    least = depth[known].min(initial=np.inf)
    range_ = depth[known].max(initial=-np.inf) - least
    share = np.where(known, depth - least, 0.0) / max(range_, 1e-9)
    colors = [np.interp(share, np.linspace(0.0, 1.0, len(SHADES)), c) for c in SHADES.T]
    return np.where(known[..., None], np.stack(colors, -1), NOTHING).astype(np.uint8)
