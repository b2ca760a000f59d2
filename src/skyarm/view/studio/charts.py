"""Plots beside the scene: tip error, tilt, contact, efforts and rotor speeds of every law over the last seconds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from skyarm.view.studio.fleet import Flight
from skyarm.view.studio.picture import COLORS
from skyarm.view.studio.sights import Sight

SECONDS = 10.0
"""That a plot shows."""

HERTZ = 10.0
"""At which plots are drawn anew."""

DECIMALS = 3
"""That are drawn, and that the labels of an axis have: a curve below them would stand beside labels of 0."""

LIMIT = "rgb(200, 40, 40)"

Column = Callable[[Sight], float]


class Chart:
    """One plot: a curve of every flight for each of its columns.

    Args:
        gui: of viser. title: with the unit.
        flights: whose curves are drawn, in their colours.
        columns: name -> number of an instant; of several the later ones are drawn thinner.
        limit: a level that is drawn, if there is one.
    """

    def __init__(
        self, gui: Any, title: str, flights: Sequence[Flight], columns: dict[str, Column], limit: float | None = None
    ) -> None:
        self._flights, self._columns, self._limit = list(flights), list(columns.values()), limit
        series: list[dict[str, Any]] = [{"label": "time (s)"}]
        for i, flight in enumerate(flights):
            red, green, blue = COLORS[i]
            for j, name in enumerate(columns):
                label = f"{flight.title} {name}".strip()
                dash = {} if j == 0 else {"dash": [3 + 2 * j, 3]}
                series.append({"label": label, "stroke": f"rgb({red}, {green}, {blue})", "width": 1.5, **dash})
        if limit is not None:
            series.append({"label": "limit", "stroke": LIMIT, "width": 1, "dash": [8, 4]})
        self._node = gui.add_uplot(
            self._data(),
            tuple(series),
            title=title,
            scales={"x": {"time": False}},
            axes=({"size": 32}, {"size": 46}),
            legend={"show": False},
            height=140,
        )

    def draw(self) -> None:
        """Show the last seconds."""
        self._node.data = self._data()

    def remove(self) -> None:
        """Take the plot off the page."""
        self._node.remove()

    def _data(self) -> tuple[Any, ...]:
        rows = [flight.seen(SECONDS) for flight in self._flights]
        longest = max(rows, key=len, default=[])
        count = max(2, len(longest))
        time = np.full(count, math.nan)
        time[: len(longest)] = [seen.time for seen in longest]
        if len(longest) < 2:
            time[:] = [0.0, 1e-3] if not longest else [longest[0].time, longest[0].time + 1e-3]
        curves = []
        for seen in rows:
            for column in self._columns:
                curve = np.full(count, math.nan)
                curve[: len(seen)] = [round(column(one), DECIMALS) for one in seen]
                curves.append(curve)
        if self._limit is not None:
            curves.append(np.full(count, self._limit))
        return (time, *curves)


def charts(gui: Any, flights: Sequence[Flight]) -> list[Chart]:
    """The plots of some flights: four, and one of contact where there is a world."""
    links = flights[0].first.plant.vehicle.links if flights else ()
    # of joints whose drives take another setpoint no effort is known
    torques = [i for i in range(len(links)) if not any(flight.first.commands_setpoints[i] for flight in flights)]
    limited = bool(torques) and all(math.isfinite(_limit(flights[0], i)) for i in torques)
    found = [
        Chart(gui, "tip error (mm)", flights, {"": lambda seen: 1e3 * seen.error}),
        Chart(gui, "tilt (deg)", flights, {"": lambda seen: math.degrees(seen.tilt)}),
    ]
    surfaces = [surface.name for contact in flights[0].first.worlds for surface in contact.surfaces] if flights else []
    if surfaces:
        found.append(Chart(gui, "contact force (N)", flights, {name: _force(name) for name in surfaces}))
    if torques:
        efforts = {links[i].joint.name: _effort(i, 100.0 if limited else 1.0) for i in torques}
        title = "joint efforts (% of limit)" if limited else "joint efforts (N m or N)"
        found.append(Chart(gui, title, flights, efforts, 100.0 if limited else None))
    rotors = {"least": lambda seen: 100.0 * min(seen.rotors), "most": lambda seen: 100.0 * max(seen.rotors)}
    if flights and flights[0].first.plant.vehicle.rotors:
        found.append(Chart(gui, "slowest and fastest rotor (% of limit)", flights, rotors, 100.0))
    return found


def _force(surface: str) -> Column:
    """Sum of a surface's normal forces on the vehicle, N."""
    return lambda seen: sum(each.normal for each in seen.touching if each.surface == surface)


def _limit(flight: Flight, joint: int) -> float:
    return float(flight.first.plant.vehicle.links[joint].joint.effort_limit)


def _effort(joint: int, scale: float) -> Column:
    """Size of a joint's effort against its limit, or its value where there is none."""
    return lambda seen: scale * (abs(seen.efforts[joint]) if scale != 1.0 else seen.efforts[joint])
