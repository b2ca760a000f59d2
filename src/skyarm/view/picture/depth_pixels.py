"""Grey picture of depths, beside or within another picture."""

from __future__ import annotations

import numpy as np

from skyarm.records.arrays import Array, Pixels

NEAR, FAR = 255.0, 60.0
"""Grey of the nearest and of the farthest depth; what has no depth is black."""


def depth_pixels(depth: Array) -> Pixels:
    """Grey picture (rows, columns, 3) of depths (m), the nearest the brightest."""
    known = np.isfinite(depth)
    ends = depth[known].min(initial=np.inf), depth[known].max(initial=-np.inf)
    grey = np.where(known, np.interp(depth, ends, (NEAR, FAR)), 0.0)
    return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=-1)
