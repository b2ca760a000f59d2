"""Buttons, menus, sliders and live plots of the studio's web page."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from skyarm.records.arrays import Array
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.view.studio.clock import SPEEDS, Clock
from skyarm.view.studio.fleet import BLOW, GUST, MOST, Flight, law_names
from skyarm.view.studio.knobs import Knob
from skyarm.view.studio.picture import COLORS

if TYPE_CHECKING:
    from skyarm.view.studio.page import Page

NO_LAW = "none"
NO_CASE = "choose"
DIRECTIONS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}

CLOCK: dict[str, Callable[[Clock], None]] = {
    "play / pause": lambda clock: setattr(clock, "playing", not clock.playing),
    "step": lambda clock: clock.step(),
    "reset": lambda clock: clock.reset(),
}


def add_clock(gui: Any, do: Callable[[Callable[[Clock], None]], None], longest: float) -> Any:
    """Add buttons, speed and time of a playback clock to a page; returns the slider of the time.

    Args:
        gui: of viser.
        do: executes their commands.
        longest: s, end of the slider.
    """
    on_user_input(gui.add_button_group("clock", tuple(CLOCK)), lambda value: do(CLOCK[value]))
    speed = gui.add_dropdown("speed", [f"{speed:g}x" for speed in SPEEDS], initial_value="1x")
    on_user_input(speed, lambda value: do(lambda clock: setattr(clock, "speed", float(value[:-1]))))
    time = gui.add_slider("time (s)", 0.0, longest, 0.005, 0.0, hint="scrub back, and forward again")
    on_user_input(time, lambda value: do(lambda clock: clock.go_to_time(value)))
    return time


class Controls:
    """Buttons and menus of the studio's web page: clock, pushes, controllers and scenarios.

    Args:
        gui: of viser.
        page: executes their commands.
        laws: that fly at first.
    """

    def __init__(self, gui: Any, page: Page, laws: list[str]) -> None:
        self.status = gui.add_markdown("Machine code is being made ...")
        self.time = add_clock(gui, page.do, 30.0)
        direction = gui.add_dropdown("push towards", tuple(DIRECTIONS), initial_value="+x")
        pushes = {f"push ({BLOW[0] * BLOW[1]:g} N s)": BLOW, f"gust ({GUST[0]:g} N, {GUST[1]:g} s)": GUST}

        def push(value: str) -> None:
            towards = DIRECTIONS[direction.value]
            page.do(lambda fleet: fleet.push(towards, *pushes[value]))

        on_user_input(gui.add_button_group("disturb", tuple(pushes)), push)
        self.tabs = gui.add_tab_group()
        self.plots = self.tabs.add_tab("plots")
        with self.tabs.add_tab("scenario"):
            with gui.add_folder("laws"):
                for place in range(MOST):
                    self._law(gui, page, place, laws[place] if place < len(laws) else NO_LAW)
            with gui.add_folder("cases"):
                menu = gui.add_dropdown("case", (NO_CASE, *list_scenarios()), initial_value=NO_CASE)
                on_user_input(menu, page.choose_case)
                save = gui.add_button("Save flights", hint="logs, with every change by hand at its control period")
                on_user_input(save, lambda _: page.save())
            box = gui.add_checkbox("follow", False, hint="the camera goes along with the first vehicle")
            on_user_input(box, page.follow)

    def _law(self, gui: Any, page: Page, place: int, first: str) -> None:
        """Create the menu that chooses one of up to three controllers."""
        names = dict.fromkeys([first, *law_names(), *([NO_LAW] if place else [])])
        menu = gui.add_dropdown(f"law {place + 1}", tuple(names), initial_value=first)
        on_user_input(menu, lambda value: page.choose_law(place, None if value == NO_LAW else value))


def on_user_input(handle: Any, work: Callable[[Any], None]) -> None:
    """Register a callback that is called when the user, not the program, changes an input."""

    async def used(event: Any) -> None:
        if event.client_id is not None:
            work(event.target.value)

    (handle.on_click if hasattr(handle, "on_click") else handle.on_update)(used)


def literal(text: str) -> str:
    """Escape text for Markdown, so that a page shows it unchanged."""
    return re.sub(r"([\\`*\[\]<>{}!#|~$&])", r"\\\1", text)


class KnobPanel:
    """Panel of sliders for adjustable parameters of a simulation.

    Args:
        gui: of viser, within the container of the sliders.
        knobs: in order.
        moved: called with path and value when a hand has moved one, from any thread.
        opened: folder that stands open at first.
    """

    def __init__(self, gui: Any, knobs: Sequence[Knob], moved: Callable[[str, float], None], opened: str = "") -> None:
        self._sliders: list[tuple[Knob, Any]] = []
        for group in dict.fromkeys(knob.group for knob in knobs):
            with gui.add_folder(group, expand_by_default=group == opened):
                for knob in (each for each in knobs if each.group == group):
                    hint = ": ".join(filter(None, (knob.path, knob.declared.meaning)))
                    first = knob.clip(knob.value)
                    slider = gui.add_slider(knob.label, knob.low, knob.high, knob.step, first, hint=hint)
                    on_user_input(slider, lambda value, knob=knob: moved(knob.path, knob.clip(value)))  # type: ignore[misc]
                    self._sliders.append((knob, slider))

    def show(self, values: Mapping[str, float]) -> None:
        """Set each slider to the given value of its parameter, else to the scenario's value."""
        for knob, slider in self._sliders:
            slider.value = knob.clip(values.get(knob.path, knob.value))


SECONDS = 10.0
"""That a plot shows."""

HERTZ = 10.0
"""At which plots are drawn anew."""

DECIMALS = 3
"""That are drawn, and that the labels of an axis have: a curve below them would stand beside labels of 0."""

LIMIT = "rgb(200, 40, 40)"

Column = Callable[[Any], float]
"""Number of an instant, such as a :class:`~skyarm.view.studio.sights.Sight`."""


class Plotted(Protocol):
    """Flight whose last instants, each with its time in s, are plotted."""

    @property
    def title(self) -> str:
        """Name of the flight."""

    def recent(self, seconds: float) -> Sequence[Any]:
        """Instants of the last seconds."""


class Chart:
    """Live plot of one or several quantities over the last seconds, with a curve per flight.

    Args:
        gui: of viser. title: with the unit.
        flights: whose curves are drawn, in their colours.
        columns: name -> number of an instant; of several the later ones are dashed.
        limit: a level that is drawn, if there is one.
    """

    def __init__(
        self,
        gui: Any,
        title: str,
        flights: Sequence[Plotted],
        columns: Mapping[str, Column],
        limit: float | None = None,
    ) -> None:
        self._flights, self._columns, self._limit = list(flights), list(columns.values()), limit
        series: list[dict[str, object]] = [{"label": "time (s)"}]
        for flight, color in zip(flights, COLORS, strict=False):
            for j, name in enumerate(columns):
                label = f"{flight.title} {name}".strip()
                dash = {} if j == 0 else {"dash": [3 + 2 * j, 3]}
                series.append({"label": label, "stroke": f"rgb{color}", "width": 1.5, **dash})
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
        """Update the plot with the last seconds of all flights."""
        self._node.data = self._data()

    def remove(self) -> None:
        """Remove the plot from the page."""
        self._node.remove()

    def _data(self) -> tuple[Array, ...]:
        """Return the time axis and all curves of the plot, padded with NaN to one length."""
        rows = [flight.recent(SECONDS) for flight in self._flights]
        longest: Sequence[Any] = max(rows, key=len, default=[])
        times = [seen.time for seen in longest]
        if len(times) < 2:  # an axis needs two instants
            times = [times[0] if times else 0.0, (times[0] if times else 0.0) + 1e-3]
        curves = []
        for seen in rows:
            for column in self._columns:
                curve = np.full(len(times), math.nan)
                curve[: len(seen)] = np.round([column(one) for one in seen], DECIMALS)
                curves.append(curve)
        limit = [] if self._limit is None else [np.full(len(times), self._limit)]
        return (np.array(times), *curves, *limit)


def charts(gui: Any, flights: Sequence[Flight]) -> list[Chart]:
    """Create all live plots for some flights."""
    return [Chart(gui, title, flights, columns, limit) for title, columns, limit in _chart_rows(flights)]


def _chart_rows(flights: Sequence[Flight]) -> Iterator[tuple[str, dict[str, Column], float | None]]:
    """Yield (title, curve functions by label, limit or None) of each live plot."""
    yield "tip error (mm)", {"": lambda seen: 1e3 * seen.error}, None
    yield "tilt (deg)", {"": lambda seen: math.degrees(seen.tilt)}, None
    if not flights:
        return
    first = flights[0].first
    surfaces = [surface.name for contact in first.worlds for surface in contact.surfaces]
    if surfaces:
        yield "contact force (N)", {name: _force(name) for name in surfaces}, None
    # of joints whose drives take another setpoint no effort is known
    joints = [link.joint for link in first.plant.vehicle.links]
    driven = [i for i in range(len(joints)) if not any(each.first.commands_setpoints[i] for each in flights)]
    if driven:
        limited = all(math.isfinite(float(joints[i].effort_limit)) for i in driven)
        efforts = {joints[i].name: _effort(i, limited) for i in driven}
        yield (
            "joint efforts (% of limit)" if limited else "joint efforts (N m or N)",
            efforts,
            100.0 if limited else None,
        )
    if first.plant.vehicle.rotors:
        rotors = {"least": lambda seen: 100.0 * min(seen.rotors), "most": lambda seen: 100.0 * max(seen.rotors)}
        yield "slowest and fastest rotor (% of limit)", rotors, 100.0


def _force(surface: str) -> Column:
    """Make a function that reads the normal force of a surface on the vehicle, N, at an instant."""
    return lambda seen: seen.contacts[surface]


def _effort(joint: int, limited: bool) -> Column:
    """Make a function that reads a joint's effort at an instant, in % of its limit if it has one."""
    return lambda seen: 100.0 * abs(seen.efforts[joint]) if limited else seen.efforts[joint]
