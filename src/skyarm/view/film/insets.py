"""Depth pictures in a corner of a film's panels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, Pixels
from skyarm.view.film.captions import Box
from skyarm.view.picture.depth_pixels import depth_pixels

SHARE = 0.4
"""Largest part of a panel's width and height that an inset takes."""

EDGE = 2
"""Width (pixels) of the panel's picture that stays beside an inset."""

Inset = tuple[Box, Iterator[Any]]
"""Panel, and the latest picture at each frame of the film."""


def insets_of(
    name: str, panels: Sequence[Box], logs: Sequence[Log], times: Array
) -> list[Inset]:
    """Latest pictures of a camera or lidar in the panel of each flight; of flights in
    one panel those of the first.
    """
    return [
        (box, _latest(log.frames(name), times))
        for box, log in zip(panels, logs, strict=False)
    ]


def _latest(frames: Iterator[Any], times: Array) -> Iterator[Any]:
    latest = coming = next(frames)
    for time in times:
        while coming is not None and coming.time <= time:
            latest, coming = coming, next(frames, None)
        yield latest


def put_inset(picture: Pixels, inset: Inset) -> None:
    """Put the next picture of an inset into the lower right corner of its panel."""
    box, seen = inset
    pixels = depth_pixels(next(seen).depth)
    rows, columns, _ = pixels.shape
    scale = SHARE * min(box.height / rows, box.width / columns)
    high, wide = (max(1, int(scale * each)) for each in (rows, columns))
    grown = pixels[np.arange(high) * rows // high][:, np.arange(wide) * columns // wide]
    picture[box.inside][-high - EDGE : -EDGE, -wide - EDGE : -EDGE] = grown
