"""Depth pictures in a corner of a film's panels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, Pixels
from skyarm.records.files import must_be_one_of, shown
from skyarm.scenario.scenario_record import cameras_of
from skyarm.simulate.drawn_scenario import drawn_scenario
from skyarm.view.film.captions import HEAD, INK, PAPER, Box, write_line
from skyarm.view.picture.depth_pixels import depth_pixels

SHARE = 0.4
"""Largest part of a panel's width and height that an inset takes."""

EDGE, LINE = 2, 1
"""Widths (pixels) of the panel's picture that stays beside an inset, and of the line
around it."""

WORDS = 0.75
"""Size of an inset's words against those of the film."""

Inset = tuple[Box, Iterator[Any]]
"""Panel, and the latest picture at each frame of the film."""


def insets_of(
    name: str, panels: Sequence[Box], logs: Sequence[Log], times: Array
) -> list[Inset]:
    """Latest pictures of a camera or lidar in the panel of each flight; of flights in
    one panel those of the first.

    Raises:
        ValueError: one line: a flight without that camera.
    """
    for _, log in zip(panels, logs, strict=False):
        known = cameras_of(drawn_scenario(log))
        if name not in known:
            allowed = (
                must_be_one_of(known, name)
                if known
                else f"must be left out, there is no camera; [sensors.{name}] with kind"
                " = 'depth_camera' or 'lidar' is one"
            )
            flight = shown(log.info.get("scenario"))
            raise ValueError(f"inset = {shown(name)}: flight {flight}: {allowed}")
    return [
        (box, _latest(log.frames(name), times))
        for box, log in zip(panels, logs, strict=False)
    ]


def _latest(frames: Iterator[Any], times: Array) -> Iterator[Any]:
    """Yield at each time (s) the last picture that was taken by then, at first the
    first.
    """
    latest = coming = next(frames)
    for time in times:
        while coming is not None and coming.time <= time:
            latest, coming = coming, next(frames, None)
        yield latest


def put_inset(picture: Pixels, inset: Inset, scale: float) -> None:
    """Put the next picture of an inset into the lower right corner of its panel, below
    the sensor's name and depths.

    Args:
        picture: film frame.
        inset: panel and its pictures.
        scale: scale of texts, 1 at 720 lines.
    """
    box, seen = inset
    latest = next(seen)
    pixels = depth_pixels(latest.depth)
    rows, columns, _ = pixels.shape
    zoom = SHARE * min(box.height / rows, box.width / columns)
    high, wide = (max(1, int(zoom * each)) for each in (rows, columns))
    # the nearest pixel: a mean of near and far would be a depth that nothing has
    grown = pixels[np.arange(high) * rows // high][:, np.arange(wide) * columns // wide]
    right, low = box.left + box.width - EDGE, box.top + box.height - EDGE
    band = round(WORDS * HEAD * scale)
    left, top = right - wide - LINE, low - high - LINE
    picture[top - band - LINE : low, left - LINE : right] = INK
    picture[top : top + high, left : left + wide] = grown
    known = latest.depth[np.isfinite(latest.depth)]
    ends = (
        f", bright {known.min():.2g} m, dark {known.max():.2g} m" if known.size else ""
    )
    write_line(
        picture,
        Box(left, top - band, wide, band),
        latest.sensor + ends,
        WORDS * scale,
        ink=PAPER,
        paper=INK,
    )
