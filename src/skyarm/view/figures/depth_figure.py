"""Depth pictures of a flight's cameras and lidars at some instants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import SubFigure

from skyarm.log.flight_log import Log, rows_of
from skyarm.simulate.drawn_scenario import drawn_scenario
from skyarm.view.figures.flight_facts import Named, Span, within
from skyarm.view.figures.style import PAPER, Picture

if TYPE_CHECKING:
    from skyarm.simulate.eyes import Eyes, RangeImage

INSTANTS = 4
"""Largest number of pictures of a camera, from the first to the last."""

FLAT = 0.3
"""Height over width below which pictures are one below the other."""

SHAPES = 0.04, 1.5
"""Least and largest height over width of a drawn picture."""

SHARE, WORDS = 0.87, 0.36
"""Share of the figure's width that pictures take, and height (in) of their words."""


def depth_figure(flights: Named, span: Span) -> Picture:
    """Draw some depth pictures of each camera and lidar over a time interval, in m.

    What has no depth is grey.

    Args:
        flights: words of the legend -> log.
        span: first and last instant, s.

    Raises:
        ValueError: one line: no camera, or none with a picture within the interval.
    """
    # made of contact, which other figures do without
    from skyarm.simulate.eyes import Eyes

    found: list[tuple[str, list[RangeImage]]] = []
    for label, log in flights.items():
        eyes = Eyes.of_log(log)
        own = f"{label}: " * (len(flights) > 1)
        found += [(own + name, _pictures(eyes, name, log, span)) for name in eyes.names]
    rows = [(label, seen, _shape(seen[0])) for label, seen in found if seen]
    if not rows:
        cure = (
            f"a longer one has some of {', '.join(label for label, _ in found)}"
            if found
            else "a [sensors.NAME] of kind = 'depth_camera' or 'lidar' takes them"
        )
        raise ValueError(
            "kind = 'depth': must be another one, for the flights have no pictures of"
            f" cameras in this window; {cure}"
        )
    heights = [
        len(seen) * (SHARE * PAPER.wide * shape + WORDS)
        if shape < FLAT
        else SHARE * PAPER.wide / INSTANTS * shape + WORDS
        for _, seen, shape in rows
    ]
    figure = PAPER.blank(PAPER.wide, sum(heights))
    parts = figure.subfigures(len(rows), 1, squeeze=False, height_ratios=heights)
    for part, row in zip(parts[:, 0], rows, strict=True):
        _draw(part, *row)
    return figure


def _pictures(eyes: Eyes, name: str, log: Log, span: Span) -> list[RangeImage]:
    """Different pictures that are nearest to the instants of an interval."""
    # logged times are whole periods but for rounding, of which a cast would lose one
    ticks = np.rint(log.time * drawn_scenario(log).rates.control).astype(int).tolist()
    due = np.array([i for i, tick in enumerate(ticks) if eyes.is_due(name, tick)], int)
    due = due[within(log, span)[due]]
    if not due.size:
        return []
    away = np.abs(log.time[due] - np.linspace(*span, INSTANTS)[:, None])
    rows = np.unique(due[away.argmin(axis=1)]).tolist()
    return [next(eyes.frames(name, rows_of(log, slice(i, i + 1)))) for i in rows]


def _shape(seen: RangeImage) -> float:
    """Height over width of a picture, of a lidar in angles."""
    rows, columns = seen.distance.shape
    left, right, low, high = seen.camera.sensor.fan or (columns, 0.0, 0.0, rows)
    return float(np.clip((high - low) / (left - right), *SHAPES))


def _draw(
    part: SubFigure, label: str, pictures: Sequence[RangeImage], shape: float
) -> None:
    """Draw the pictures of one camera or lidar and their colour bar."""
    flat = shape < FLAT
    size = (len(pictures), 1) if flat else (1, INSTANTS)
    axes = list(part.subplots(*size, squeeze=False).flat)
    for ax in axes[len(pictures) :]:
        ax.set_axis_off()
    # one scale of colours for all pictures, so that their depths compare
    depths = np.ma.masked_invalid([each.depth for each in pictures])
    least, most = (depths.min(), depths.max()) if depths.count() else (0.0, 1.0)
    fan = pictures[0].camera.sensor.fan
    extent = None if fan is None else np.degrees(fan).tolist()
    for ax, seen, depth in zip(axes, pictures, depths, strict=False):
        PAPER.dress(ax).grid(visible=False)
        ax.set(facecolor=PAPER.grid, box_aspect=shape)
        # reversed: near is bright, as in the insets of films
        image = ax.imshow(
            depth, "viridis_r", aspect="auto", vmin=least, vmax=most, extent=extent
        )
        ax.set_title(f"{label}, {seen.time:g} s", **PAPER.small_words)
        if fan is None:
            ax.set(xticks=[], yticks=[])
        elif flat or ax is axes[0]:
            ax.set_ylabel("elevation [deg]", **PAPER.small_words)
        if fan is not None and (not flat or seen is pictures[-1]):
            ax.set_xlabel("azimuth [deg]", **PAPER.small_words)
    bar = part.colorbar(image, ax=axes[: len(pictures)], pad=0.01)
    bar.ax.tick_params(labelsize=PAPER.small, labelfontfamily=PAPER.font[0])
    bar.set_label("depth [m]" if fan is None else "range [m]", **PAPER.small_words)
