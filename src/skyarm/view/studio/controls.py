"""Controls and plots of the page: the clock, pushes, laws, cases, the view, sliders and curves."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from skyarm.scenario.scenario_file import list_scenarios
from skyarm.view.studio.fleet import BLOW, GUST, MOST, SPEEDS, Fleet, Flight, law_names
from skyarm.view.studio.knobs import Knob
from skyarm.view.studio.picture import COLORS
from skyarm.view.studio.sights import Sight

if TYPE_CHECKING:
    from skyarm.view.studio.page import Page

NO_LAW = "none"
NO_CASE = "choose"
DIRECTIONS = {"+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0), "+z": (0, 0, 1), "-z": (0, 0, -1)}


class Controls:
    """The controls of the page.

    Args:
        gui: of viser. orders: page that carries them out.
        laws: that fly at first.
    """

    def __init__(self, gui: Any, orders: Page, laws: list[str]) -> None:
        self._gui, self._orders = gui, orders
        self.status = gui.add_markdown("Machine code is being made ...")
        self._clock()
        self._push()
        self.tabs = gui.add_tab_group()
        self.plots = self.tabs.add_tab("plots")
        with self.tabs.add_tab("scenario"):
            self._laws(laws)
            self._cases()
            self._view()

    def _clock(self) -> None:
        """Play, step, speed, and the way back."""
        do = self._orders.do
        buttons = self._gui.add_button_group("clock", ("play / pause", "step", "reset"))
        _on_click(buttons, lambda value: do(CLOCK[value]))
        speeds = [f"{speed:g}x" for speed in SPEEDS]
        speed = self._gui.add_dropdown("speed", speeds, initial_value="1x")
        _on_click(speed, lambda value: do(lambda fleet: setattr(fleet, "speed", float(value[:-1]))))
        self.time = self._gui.add_slider("time (s)", 0.0, 30.0, 0.005, 0.0, hint="scrub back, and forward again")
        _on_click(self.time, lambda value: do(lambda fleet: _scrub(fleet, value)))

    def _push(self) -> None:
        """A push and a gust, and where they go."""
        self._where = self._gui.add_dropdown("push towards", tuple(DIRECTIONS), initial_value="+x")
        words = {f"push ({BLOW[0] * BLOW[1]:g} N s)": BLOW, f"gust ({GUST[0]:g} N, {GUST[1]:g} s)": GUST}
        buttons = self._gui.add_button_group("disturb", tuple(words))

        def push(value: str) -> None:
            direction = DIRECTIONS[self._where.value]
            self._orders.do(lambda fleet: fleet.push(direction, *words[value]))

        _on_click(buttons, push)

    def _laws(self, laws: list[str]) -> None:
        """A menu for each law that may fly."""
        with self._gui.add_folder("laws"):
            for place in range(MOST):
                first = laws[place] if place < len(laws) else NO_LAW
                names = [
                    *dict.fromkeys([*([NO_LAW] if place else []), *([first] if first != NO_LAW else []), *law_names()])
                ]
                menu = self._gui.add_dropdown(f"law {place + 1}", tuple(names), initial_value=first)
                self._menu(menu, place)

    def _menu(self, menu: Any, place: int) -> None:
        _on_click(menu, lambda value: self._orders.choose_law(place, None if value == NO_LAW else value))

    def _cases(self) -> None:
        """The shipped scenarios, and saving."""
        with self._gui.add_folder("cases"):
            menu = self._gui.add_dropdown("case", (NO_CASE, *list_scenarios()), initial_value=NO_CASE)
            _on_click(menu, self._orders.choose_case)
            save = self._gui.add_button("Save flights", hint="logs, with every change by hand at its control period")
            _on_click(save, lambda _: self._orders.save())

    def _view(self) -> None:
        """The camera."""
        box = self._gui.add_checkbox("follow", False, hint="the camera goes along with the first vehicle")
        _on_click(box, self._orders.follow)


CLOCK: dict[str, Callable[[Fleet], None]] = {
    "play / pause": lambda fleet: setattr(fleet, "playing", not fleet.playing),
    "step": Fleet.step,
    "reset": Fleet.reset,
}


def _scrub(fleet: Fleet, time: float) -> None:
    """Stop at an instant."""
    fleet.playing = False
    fleet.go(min(round(time * fleet.rate), fleet.furthest))


def _on_click(handle: Any, work: Callable[[Any], None]) -> None:
    """Do something when a hand, not the studio, has used an input."""

    async def by_hand(event: Any) -> None:
        if event.client_id is not None:
            work(event.target.value)

    (handle.on_click if hasattr(handle, "on_click") else handle.on_update)(by_hand)


def literal(text: str) -> str:
    """Text from files and messages as a page's markdown shows it as it is: nothing in it is a link or code."""
    return re.sub(r"([\\`*\[\]<>{}!#|~$&])", r"\\\1", text)


Moved = Callable[[str, float], None]


class KnobPanel:
    """Sliders of some knobs.

    Args:
        gui: of viser, within the container that they shall stand in.
        knobs: in order.
        moved: called with path and value when a hand has moved one, from any thread.
        open_groups: folders that stand open at first.
    """

    def __init__(self, gui: Any, knobs: Sequence[Knob], moved: Moved, open_groups: Sequence[str] = ()) -> None:
        self._knobs = {knob.path: knob for knob in knobs}
        self._sliders: dict[str, Any] = {}
        for group in dict.fromkeys(knob.group for knob in knobs):
            with gui.add_folder(group, expand_by_default=group in open_groups):
                for knob in knobs:
                    if knob.group == group:
                        self._sliders[knob.path] = _slider(gui, knob, moved)

    def show(self, values: Mapping[str, float]) -> None:
        """Set the sliders to numbers by path; those that are not given, to the scenario's."""
        for path, slider in self._sliders.items():
            slider.value = self._knobs[path].clip(values.get(path, self._knobs[path].value))


def _slider(gui: Any, knob: Knob, moved: Moved) -> Any:
    """The slider of one knob."""
    meaning = knob.declared.meaning
    hint = f"{knob.path}: {meaning}" if meaning else knob.path
    slider = gui.add_slider(knob.label, knob.low, knob.high, knob.step, knob.clip(knob.value), hint=hint)

    async def by_hand(event: Any) -> None:
        if event.client_id is not None:  # what the studio sets itself is no hand
            moved(knob.path, knob.clip(event.target.value))

    slider.on_update(by_hand)
    return slider


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
        rows = [flight.recent(SECONDS) for flight in self._flights]
        longest = max(rows, key=len, default=[])
        count = max(2, len(longest))

        def pad(values: Sequence[float]) -> Any:
            return np.array([*values, *[math.nan] * (count - len(values))])

        times = [seen.time for seen in longest]
        start = times[0] if times else 0.0
        time = pad(times) if len(times) > 1 else np.array([start, start + 1e-3])
        curves = [pad([round(column(one), DECIMALS) for one in seen]) for seen in rows for column in self._columns]
        limit = [] if self._limit is None else [np.full(count, self._limit)]
        return (time, *curves, *limit)


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
