"""Ways of the base that a plan begins from: straight ones, and ways around obstacles
found on a grid.

A ball about the base is led from cell to cell by A* and the way is cut short where the
straight line is free. A large ball keeps away from everything; a smaller one passes
where the vehicle must fold, tilt or pass edgewise, which the solver then finds.
Source: Hart, Nilsson, Raphael 1968 (A*).
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Sequence

import numpy as np

from skyarm.algebra import E_Z, Vec3
from skyarm.records.arrays import Array, doubles, float_array, lengths, norm
from skyarm.vehicle import BASE
from skyarm.world.contact.surface import Surface
from skyarm.world.scene.clearance import Volume, surface_distance

CELL = 0.15
"""Edge (m) of a cell of the grid; larger where the scene would have more than
``MOST_CELLS``. Chosen: a way is only where the solver begins."""

MOST_CELLS = 60_000
"""Largest number of cells of the grid: each costs distances to all obstacles, and may
cost a step of the search; chosen."""

MARGIN = 1.5
"""Distance (m) by which the grid is larger than start, goal and obstacles, as far as
``DETOUR`` lets it."""

DETOUR = 1.0
"""Distance that a way may lead away from the straight one, over its length, beside
``MARGIN``."""

BALLS = (1.0, 0.6, 0.3)
"""Radii of the ball, over the vehicle's reach."""


def free_distance(obstacles: Sequence[Surface], points: Array) -> Array:
    """Distance (m) of points (..., 3) from the nearest obstacle."""
    best = np.full(points.shape[:-1], math.inf)
    for each in obstacles:
        place = Vec3(points[..., 0], points[..., 1], points[..., 2])
        gap = surface_distance(Volume("ball", BASE, (place,), 0.0, 0, E_Z), each, 0.0)
        best = np.minimum(best, np.broadcast_to(doubles(gap), best.shape))
    return best


def ways_around(
    obstacles: Sequence[Surface], start: Array, goal: Array, reach: float
) -> list[Array]:
    """Ways (points, 3) from a start to a goal, m: the straight one, then one for each
    ball that passes elsewhere.
    """
    ways = [np.array([start, goal])]
    if not obstacles or np.allclose(start, goal):
        return ways
    points, shape, places = _grid(obstacles, start, goal)
    gaps = free_distance(obstacles, points)
    for share in BALLS:
        ball = share * reach
        # what a large ball passes straight smaller ones do, too
        if _is_free(obstacles, start, goal, ball):
            break
        way = _search(gaps, points, shape, places, ball)
        if way is not None:
            ways.append(
                _cut_short(obstacles, np.array([start, *way[1:-1], goal]), ball)
            )
    return ways


def _grid(
    obstacles: Sequence[Surface], start: Array, goal: Array
) -> tuple[Array, tuple[int, ...], tuple[int, int]]:
    """Points of the grid (cells, 3), its shape, and the cells of start and goal."""
    low, high = np.minimum(start, goal) - MARGIN, np.maximum(start, goal) + MARGIN
    for each in obstacles:
        # a plane has no end that the grid could reach round
        if each.shape != "plane":
            middle = float_array(each.position)
            far = float(each.farthest) + 0.5 * MARGIN
            low, high = np.minimum(low, middle - far), np.maximum(high, middle + far)
    far = MARGIN + DETOUR * norm(goal - start)
    low = np.maximum(low, np.minimum(start, goal) - far)
    high = np.minimum(high, np.maximum(start, goal) + far)
    cell = max(CELL, float(np.prod(high - low) / MOST_CELLS) ** (1.0 / 3.0))
    axes = [np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True)]
    shape = tuple(map(len, axes))
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def nearest(point: Array) -> int:
        steps = np.round((point - low) / cell).astype(int)
        inside = np.clip(steps, 0, np.array(shape) - 1)
        return int(np.ravel_multi_index(tuple(inside), shape))

    return points, shape, (nearest(start), nearest(goal))


STEPS = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]


def _search(
    gaps: Array,
    points: Array,
    shape: tuple[int, ...],
    ends: tuple[int, int],
    ball: float,
) -> Array | None:
    """Shortest way (points, 3) of a ball from cell to cell by A*; None if there is
    none.
    """
    start, goal = ends
    room, ahead = gaps.tolist(), lengths(points - points[goal]).tolist()
    # start and goal are given, even where the ball is too large for them
    room[start], room[goal] = max(room[start], 2.0 * ball), max(room[goal], 2.0 * ball)
    cell = float(points[1, 2] - points[0, 2])
    rows, columns, layers = shape
    ways = [
        (
            a,
            b,
            c,
            (a * columns + b) * layers + c,
            cell * math.sqrt(a * a + b * b + c * c),
        )
        for a, b, c in STEPS
    ]
    costs, before, done = {start: 0.0}, {start: start}, set[int]()
    queue = [(ahead[start], start)]
    while queue:
        _, place = heapq.heappop(queue)
        if place == goal:
            way = [place]
            while before[way[-1]] != way[-1]:
                way.append(before[way[-1]])
            return points[way[::-1]]
        # a cell stands in the queue once for each way that was shorter than those
        # before
        if place in done:
            continue
        done.add(place)
        i, j, k = place // (columns * layers), place // layers % columns, place % layers
        for a, b, c, offset, length in ways:
            if not (0 <= i + a < rows and 0 <= j + b < columns and 0 <= k + c < layers):
                continue
            other = place + offset
            # no distance falls faster than a point moves: the least one on the way
            # between both
            if other in done or room[place] + room[other] - length < 2.0 * ball:
                continue
            # ways close to obstacles are longer, where the ball just fits by 0.3
            # (chosen); 5 cm keep the cost finite beside an obstacle
            cost = costs[place] + length * (1.0 + 0.3 * ball / max(room[other], 0.05))
            if cost < costs.get(other, math.inf):
                costs[other], before[other] = cost, place
                heapq.heappush(queue, (cost + ahead[other], other))
    return None


def _is_free(obstacles: Sequence[Surface], a: Array, b: Array, ball: float) -> bool:
    """True if a ball passes on the straight line between two points."""
    # every 3 cm: chosen, a fifth of a cell
    count = max(2, int(norm(b - a) / 0.03))
    line = a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)
    gaps = free_distance(obstacles, line)
    # ends may be nearer than the ball; they must pass the strict comparison themselves
    return bool((gaps > min(ball, float(gaps[0]), float(gaps[-1])) * 0.999).all())


def _cut_short(obstacles: Sequence[Surface], way: Array, ball: float) -> Array:
    """Way without the points that a straight free line can leave out."""
    kept, at = [0], 0
    while at < len(way) - 1:
        ends = range(len(way) - 1, at, -1)
        ahead = next(
            # the next point always is reached: the search went there
            (k for k in ends if _is_free(obstacles, way[at], way[k], ball)),
            at + 1,
        )
        kept.append(ahead)
        at = ahead
    return way[kept]
