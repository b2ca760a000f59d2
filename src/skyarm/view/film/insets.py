"""Depth pictures in a corner of a film's panels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from skyarm.log.flight_log import Log
from skyarm.records.arrays import Array, Pixels
from skyarm.records.files import must_be_one_of, shown
from skyarm.simulate.eyes import Eyes, Frame
from skyarm.view.film.captions import INK, Box
from skyarm.view.picture.depth_pixels import depth_pixels

SHARE = 0.4
"""Largest part of a panel's width and height that an inset takes."""

EDGE = 2
"""Width (pixels) of an inset's edge."""


def with_insets(
    frames: Iterator[Pixels],
    panels: Sequence[Box],
    logs: Sequence[Log],
    times: Array,
    name: str,
) -> Iterator[Pixels]:
    """Yield the frames of a film with the latest picture of a camera in the panel of
    each flight that has it.

    Raises:
        ValueError: one line: no such camera.
    """
    eyes = [Eyes(log.scenario) for log in logs]
    names = dict.fromkeys(each for own in eyes for each in own.names)
    if name not in names:
        raise ValueError(f"inset = {shown(name)}: {must_be_one_of([*names], name)}")
    # in a panel of several flights the first one's picture is seen
    insets = [
        (box, _latest(own.frames(name, log), times))
        for box, own, log in zip(panels, eyes, logs, strict=False)
        if name in own.names
    ]
    for picture in frames:
        for box, seen in insets:
            _put(picture, box, depth_pixels(next(seen).depth))
        yield picture


def _latest(frames: Iterator[Frame], times: Array) -> Iterator[Frame]:
    """Yield the latest picture at each time (s)."""
    latest = coming = next(frames)
    for time in times:
        while coming is not None and coming.time <= time:
            latest, coming = coming, next(frames, None)
        yield latest


def _put(picture: Pixels, box: Box, inset: Pixels) -> None:
    """Put an inset into the lower right corner of a rectangle."""
    rows, columns, _ = inset.shape
    scale = SHARE * min(box.height / rows, box.width / columns)
    high, wide = (max(1, int(scale * each)) for each in (rows, columns))
    grown = inset[np.arange(high) * rows // high][:, np.arange(wide) * columns // wide]
    place = picture[box.inside][-high - 2 * EDGE :, -wide - 2 * EDGE :]
    place[:] = INK
    place[EDGE:-EDGE, EDGE:-EDGE] = grown
