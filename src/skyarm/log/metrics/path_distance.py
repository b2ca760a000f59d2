"""Distance of a point from a path, regardless of time."""

from __future__ import annotations

import numpy as np

from skyarm.records.arrays import Array, doubles, lengths

AT_ONCE = 256
"""Number of points compared with the whole path at a time."""


def path_distance(points: Array, path: Array) -> Array:
    """Distance of each point (N, 3) from the polyline through a path's samples (M, 3),
    m.

    Of a flight: ``path_distance(log.tip, log.tip_reference)``, which stays small on a
    slowed path where the error against the reference of that instant does not.

    Args:
        points: (N, 3), m.
        path: (M, 3), m, in order; a step of the path counts as the straight line
            between its ends.

    Returns:
        (N,), m.
    """
    points, path = doubles(points), doubles(path)
    # where the path rests it is one point
    moves = np.append(True, np.any(np.diff(path, axis=0) != 0.0, axis=1))
    path = path[moves]
    if len(path) == 1:
        return lengths(points - path[0])
    begin, along = path[:-1], np.diff(path, axis=0)
    square = (along * along).sum(axis=1)
    distances = np.empty(len(points))
    # in blocks: all distances at once would take points times path of memory
    for start in range(0, len(points), AT_ONCE):
        off = points[start : start + AT_ONCE, None] - begin
        # the nearest point of a segment lies between its ends
        share = np.clip((off * along).sum(axis=2) / square, 0.0, 1.0)
        left = off - share[..., None] * along
        distances[start : start + AT_ONCE] = np.sqrt(
            (left * left).sum(axis=2).min(axis=1)
        )
    return distances
