"""Web page of simulated flights: clock, sliders, plots and laws side by side."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from skyarm.control.catalogue import OWN
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.view.studio.controls import (
    Chart,
    KnobPanel,
    add_clock,
    charts,
    literal,
    on_user_input,
    swatch,
)
from skyarm.view.studio.fleet import (
    BLOW,
    GUST,
    MOST,
    Fleet,
    Flight,
    FlownAgent,
    law_names,
)
from skyarm.view.studio.knobs import AdjustableNumber
from skyarm.view.studio.page_loop import PageLoop
from skyarm.view.studio.picture import COLORS, FleetPicture
from skyarm.view.studio.sights import PlottedInstant

if TYPE_CHECKING:
    from skyarm.view.studio.server import GuiApi, Menu, Tab, ViserServer

NO_LAW = "none"
NO_CASE = "choose"
"""Words of the menus for no flight and for no other scenario."""

DIRECTIONS = {
    "+x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "+y": (0, 1, 0),
    "-y": (0, -1, 0),
    "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}


class Controls:
    """Buttons and menus of the studio's web page: clock, pushes, controllers and
    scenarios.

    Args:
        gui: controls of viser.
        page: page that executes their commands.
        laws: laws that fly at first.
    """

    def __init__(self, gui: GuiApi, page: Page, laws: list[str]) -> None:
        self.status = gui.add_markdown("Machine code is being made ...")
        # the end moves on with the flights, 30 s at a time (_draw_slowly)
        self.time = add_clock(gui, page.do, 30.0)
        direction = gui.add_dropdown(
            "push towards", tuple(DIRECTIONS), initial_value="+x"
        )
        pushes = {
            f"push ({BLOW[0] * BLOW[1]:g} N s)": BLOW,
            f"gust ({GUST[0]:g} N, {GUST[1]:g} s)": GUST,
        }

        def push(value: str) -> None:
            towards = DIRECTIONS[direction.value]
            page.do(lambda fleet: fleet.push(towards, *pushes[value], page.agent))

        on_user_input(gui.add_button_group("disturb", tuple(pushes)), push)
        self._menus: list[Menu] = []
        self.tabs = gui.add_tab_group()
        # the two last ones are filled anew with the flights; they stay, and so does the
        # one that is chosen
        self.plots, menus, self.world, self.laws = map(
            self.tabs.add_tab, ("plots", "scenario", "world", "laws")
        )
        with menus:
            with gui.add_folder("laws"):
                for place in range(MOST):
                    self._law(
                        gui, page, place, laws[place] if place < len(laws) else NO_LAW
                    )
            with gui.add_folder("cases"):
                menu = gui.add_dropdown(
                    "case", (NO_CASE, *list_scenarios()), initial_value=NO_CASE
                )
                on_user_input(menu, page.choose_case)
                save = gui.add_button(
                    "Save flights",
                    hint="logs, with every change by hand at its control period",
                )
                on_user_input(save, lambda _: page.save())
            box = gui.add_checkbox(
                "follow", False, hint="the camera goes along with the first vehicle"
            )
            on_user_input(box, page.follow)

    def _law(self, gui: GuiApi, page: Page, place: int, first: str) -> None:
        """Create a menu for choosing the controller of one of up to three flights."""
        names = dict.fromkeys([first, *law_names(), *([NO_LAW] if place else [])])
        menu = gui.add_dropdown(f"law {place + 1}", tuple(names), initial_value=first)
        on_user_input(
            menu,
            lambda value: page.choose_law(place, None if value == NO_LAW else value),
        )

    def add_agents(self, gui: GuiApi, page: Page, names: Collection[str]) -> None:
        """Create the menu of the vehicle that plots, sliders and pushes belong to; none
        for the only one.
        """
        for menu in self._menus:
            menu.remove()
        self._menus = []
        if len(names) > 1:
            hint = "plots, sliders and pushes are of this one"
            # half a place less: right above the tabs
            self._menus = [
                gui.add_dropdown(
                    "vehicle", tuple(names), hint=hint, order=self.tabs.order - 0.5
                )
            ]
            on_user_input(self._menus[0], page.choose_agent)


class Page(PageLoop):
    """Web page of the studio that simulates flights in real time and compiles them in a
    background thread.

    Args:
        server: server of viser.
        fleet: initial one, without flights. laws: laws of its flights; None is the
            scenario's own.
        out: folder of saved flights.
    """

    def __init__(
        self, server: ViserServer, fleet: Fleet, laws: Sequence[str | None], out: Path
    ) -> None:
        super().__init__(server, "machine code")
        self._out = out
        self._moves: dict[int | None, dict[str, float]] = {}
        self._making = 0
        self._turn = 0
        self._due = list[int]()
        self._picture: FleetPicture = FleetPicture(server)
        self._controls = Controls(server.gui, self, [law or OWN for law in laws])
        self._panels: list[tuple[int | None, KnobPanel]] = []
        self._charts: list[Chart[PlottedInstant]] = []
        self._begin(fleet, laws)

    # orders, from any thread

    def do(self, work: Callable[[Fleet], None]) -> None:
        """Queue a function that changes the flights, to be called before the next
        frame.
        """

        def done() -> None:
            work(self.fleet)
            self._show_values()

        self._orders.put(done)

    def choose_law(self, place: int, law: str | None) -> None:
        """Queue a change of the controller of the flight with a menu's index; None
        removes the flight.
        """

        def choose() -> None:
            if law is not None:
                self._make(self.fleet, law, place)
            elif place < len(self.fleet.flights):
                self.fleet.leave(place)
                self._rebuild()

        self._orders.put(choose)

    def choose_agent(self, name: str) -> None:
        """Queue a change of the vehicle that plots, sliders and pushes belong to."""

        def choose() -> None:
            if name in self.fleet.scenario.agents:
                self.agent = name
                with self._server.atomic():
                    self._fill_tabs()
                self._show_values()

        self._orders.put(choose)

    def choose_case(self, name: str) -> None:
        """Load a shipped scenario by name, under the current controllers."""

        def choose() -> None:
            if name in list_scenarios():
                laws = [flight.law for flight in self.fleet.flights]
                self._begin(Fleet(name), laws or [None])

        self._orders.put(choose)

    def save(self) -> None:
        """Write a log of each flight."""
        self._orders.put(lambda: self._say(self.fleet.save(self._out)))

    def move(self, place: int | None, path: str, value: float) -> None:
        """Queue a parameter change of one flight, or of all flights if ``place`` is
        None.
        """
        self._orders.put(
            lambda: self._moves.setdefault(place, {}).__setitem__(path, value)
        )

    # the loop

    def _advance(self, seconds: float) -> None:
        # laws that are chosen together begin together
        if self.fleet.flights and not (self._making and not self.fleet.tick):
            self.fleet.advance(seconds)

    def _draw(self) -> None:
        self._picture.draw(self.fleet.flights)

    def _close(self) -> None:
        super()._close()
        self.fleet.close()

    def _handle_inputs(self) -> None:
        """Execute the queued inputs, then the last move of each slider."""
        super()._handle_inputs()
        moves = self._moves
        self._moves = {}
        if moves:
            self._picture.hurry()
        for place, values in moves.items():
            # a flight may be gone, or still be compiled, when its slider's value comes
            if (place or 0) < len(self.fleet.flights):
                self._try(partial(self.fleet.move, values, place))

    # laws and scenarios

    def _begin(self, fleet: Fleet, laws: Sequence[str | None]) -> None:
        """Show a scenario at its initial state, and start compiling its flights."""
        scenario = fleet.scenario
        self.fleet = fleet
        self.agent = next(iter(scenario.agents))
        with self._server.atomic():
            # no flight is there whose values they could show, or that they could move
            self._clear_tabs()
        self._controls.add_agents(self._server.gui, self, scenario.agents)
        self._picture.build(scenario, [law or scenario.law_names for law in laws])
        for place, law in enumerate(laws):
            self._make(fleet, law, place)

    def _make(self, fleet: Fleet, law: str | None, place: int) -> None:
        """Compile a flight in the background and add it when it is ready."""
        self._making += 1
        self._worker.submit(self._compile_flight, fleet, law, place)

    def _compile_flight(self, fleet: Fleet, law: str | None, place: int) -> None:
        """Make a flight in the background thread; its end, or its error, is queued."""
        try:
            flight: Flight | None = fleet.make_flight(law)
            words = ""
        except Exception as error:  # of a law of the user's own it may be any
            name = law or fleet.scenario.law_names
            flight = None
            words = f"{name}: {' '.join(str(error).split())}"
        self._orders.put(lambda: self._join(fleet, flight, place, words))

    def _join(
        self, fleet: Fleet, flight: Flight | None, place: int, words: str
    ) -> None:
        """Add a compiled flight, unless the scenario was changed meanwhile."""
        self._making -= 1
        self._say(words)
        if flight is not None and fleet is self.fleet:
            fleet.join(flight, place if place < len(fleet.flights) else None)
            self._rebuild()

    def _rebuild(self) -> None:
        """Rebuild vehicles, sliders and plots after a flight was added or removed."""
        with self._server.atomic():
            # the picture is built once, after the last of them
            if not self._making:
                self._picture.build(
                    self.fleet.scenario, [flight.title for flight in self.fleet.flights]
                )
            self._fill_tabs()

    def _fill_tabs(self) -> None:
        """Replace sliders and plots by those of the present flights and the chosen
        vehicle.
        """
        self._clear_tabs()
        vehicles = self._vehicles
        with self._controls.plots:
            self._charts = charts(self._server.gui, vehicles)
        # what all flights share stands there once
        for each in vehicles[:1]:
            self._add_panel(
                self._controls.world, None, each.shared_knobs, "wind and forces"
            )
        for i, each in enumerate(vehicles):
            self._add_panel(
                self._controls.laws, i, each.own_knobs, "" if i else "law", each.title
            )

    def _clear_tabs(self) -> None:
        """Remove sliders and plots."""
        for _, panel in self._panels:
            panel.remove()
        for chart in self._charts:
            chart.remove()
        self._panels = []
        self._charts = []

    @property
    def _vehicles(self) -> list[FlownAgent]:
        """The chosen vehicle in each flight."""
        return [flight.agents[self.agent] for flight in self.fleet.flights]

    def _add_panel(
        self,
        tab: Tab,
        place: int | None,
        knobs: Sequence[AdjustableNumber],
        opened: str,
        title: str = "",
    ) -> None:
        """Add a panel of sliders to a tab, for one flight by its place or for all
        (None).
        """
        with tab:
            panel = KnobPanel(
                self._server.gui, knobs, partial(self.move, place), opened, title
            )
            self._panels.append((place, panel))

    def _show_values(self) -> None:
        """Set the sliders to the current values, after a step back or a reset."""
        for place, panel in self._panels:
            panel.show(self.fleet.flights[place or 0].values)

    def _draw_slowly(self) -> None:
        """Update plots, status text and clock, at a lower rate than the 3D picture."""
        fleet = self.fleet
        # each plot at a third of the rate: they are most of what is sent
        self._turn = (self._turn + 1) % 3
        for chart in self._charts[self._turn :: 3]:
            chart.draw()
        if (due := [flight.due for flight in fleet.flights]) != self._due:
            self._due = due
            self._show_values()
        slider = self._controls.time
        # the range of the clock's slider grows by 30 s at a time
        longest = max(30.0, 30.0 * -(-fleet.furthest // (30 * fleet.rate)))
        if slider.max != longest:
            slider.max = longest
        if fleet.playing:
            slider.value = fleet.time
        self._controls.status.content = self._status()

    def _status(self) -> str:
        """Status text of the page: clock, and tip error and contact force of each
        flight.
        """
        fleet = self.fleet
        lines = [f"**{literal(fleet.scenario.title or fleet.source)}**", fleet.words]
        for each, color in zip(self._vehicles, COLORS, strict=False):
            last = each.last
            lost = each.flight.lost
            words = (
                f"lost at {last.time:.2f} s: {lost}"
                if lost
                else f"tip error {1e3 * last.error:.1f} mm"
            )
            touching = (
                f", contact {last.contact:.2f} N" if last.contact and not lost else ""
            )
            lines.append(f"{swatch(color)} {each.title}: {words}{touching}")
        if self._making:
            lines.append("Machine code is being made ...")
        return self._with_report(lines)
