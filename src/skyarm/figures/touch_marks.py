"""Marks of when, and where on its tip's path, a flight touched its world and let go."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from skyarm.figures.flight_facts import FlightFacts
from skyarm.figures.flight_panels import FlightPanel
from skyarm.figures.picture_styles import PictureStyle
from skyarm.figures.projection import View
from skyarm.log.flight_log import Log

TOUCH_WORDS = ("touch", "loss")
"""Words of the legend for a filled mark and an open one."""


def mark_touches(ax: Axes, panel: FlightPanel, facts: Mapping[str, FlightFacts], style: PictureStyle) -> dict[str, Any]:
    """Marks on the time axis of a panel where points touch and let go; words of the legend -> artist."""
    handles: dict[str, Any] = {}
    if panel.touching == ():
        return handles
    for i, flight in enumerate(facts.values()):
        chosen = [
            each for each in flight.touching if panel.touching is None or (each.surface, each.point) in panel.touching
        ]
        color = style.look(i).color
        for word, marker, times, face in (
            (TOUCH_WORDS[0], "^", [t for each in chosen for t in each.starts], color),
            (TOUCH_WORDS[1], "v", [t for each in chosen for t in each.ends], style.face),
        ):
            if not times:
                continue
            look: dict[str, Any] = {"color": color, "markerfacecolor": face, "markersize": 0.55 * style.small}
            (mark,) = ax.plot(
                times, [0.0] * len(times), marker, transform=ax.get_xaxis_transform(), clip_on=False, zorder=5.0,
                markeredgewidth=0.08 * style.small, label=f"_{word}", **look,
            )  # fmt: skip
            handles.setdefault(word, mark)
    return handles


def touch_places(
    ax: Axes,
    view: View,
    named: Mapping[str, Log],
    facts: Mapping[str, FlightFacts],
    style: PictureStyle,
    span: tuple[float, float],
) -> dict[str, Any]:
    """Where on its path a tip was when it touched and let go."""
    handles: dict[str, Any] = {}
    for i, (label, log) in enumerate(named.items()):
        color = style.look(i).color
        for word, marker, face in ((TOUCH_WORDS[0], "^", color), (TOUCH_WORDS[1], "v", style.face)):
            touching = [each for each in facts[label].touching if each.at_tip]
            found = [t for each in touching for t in (each.starts if marker == "^" else each.ends)]
            times = [t for t in found if span[0] <= t <= span[1]]
            if times:
                at = view.flat(log.tip[np.searchsorted(log.time, times).clip(max=log.time.size - 1)]).T
                look: dict[str, Any] = {"color": color, "markerfacecolor": face, "markersize": 0.6 * style.small}
                (mark,) = ax.plot(*at, marker, label=f"_{word}", zorder=4.5, **look)
                handles.setdefault(word, mark)
    return handles
