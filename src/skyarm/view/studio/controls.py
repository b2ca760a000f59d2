"""Clock buttons, sliders and live plots of the studio's web pages."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np

from skyarm.records.arrays import Array
from skyarm.view.studio.clock import SPEEDS, Clock
from skyarm.view.studio.fleet import FlownAgent
from skyarm.view.studio.knobs import AdjustableNumber
from skyarm.view.studio.picture import COLORS
from skyarm.view.studio.sights import PlottedInstant

if TYPE_CHECKING:
    from skyarm.view.studio.server import GuiApi, Series, Slider

CLOCK: dict[str, Callable[[Clock], None]] = {
    "play / pause": lambda clock: setattr(clock, "playing", not clock.playing),
    "step": lambda clock: clock.step(),
    "reset": lambda clock: clock.reset(),
}


def add_clock(
    gui: GuiApi, do: Callable[[Callable[[Clock], None]], None], longest: float
) -> Slider:
    """Add buttons, speed and time of a playback clock to a page; returns the slider of
    the time.

    Args:
        gui: controls of viser.
        do: function that executes their commands.
        longest: s, end of the slider.
    """
    on_user_input(
        gui.add_button_group("clock", tuple(CLOCK)), lambda value: do(CLOCK[value])
    )
    speed = gui.add_dropdown(
        "speed", [f"{speed:g}x" for speed in SPEEDS], initial_value="1x"
    )
    on_user_input(
        speed,
        lambda value: do(lambda clock: setattr(clock, "speed", float(value[:-1]))),
    )
    # steps of 5 ms, the usual control period
    time = gui.add_slider(
        "time (s)", 0.0, longest, 0.005, 0.0, hint="scrub back, and forward again"
    )
    on_user_input(time, lambda value: do(lambda clock: clock.go_to_time(value)))
    return time


def on_user_input(handle: Any, work: Callable[[Any], None]) -> None:
    """Register a callback that is called when the user, not the program, changes an
    input.
    """

    async def used(event: Any) -> None:
        # events of the program itself have no client: they would move the flight back
        if event.client_id is not None:
            work(event.target.value)

    (handle.on_click if hasattr(handle, "on_click") else handle.on_update)(used)


def literal(text: str) -> str:
    """Escape text for Markdown, so that a page shows it unchanged."""
    return re.sub(r"([\\`*\[\]<>{}!#|~$&])", r"\\\1", text)


def swatch(color: Sequence[int]) -> str:
    """Markdown for a square in a colour, given as red, green and blue from 0 to 255."""
    return f'<span style="color: rgb{tuple(color)}">\u25a0</span>'


class KnobPanel:
    """Panel of sliders for adjustable parameters of a simulation.

    Args:
        gui: controls of viser, within the container of the sliders.
        knobs: adjustable parameters, in order.
        moved: function called with path and value when a hand has moved one, from any
            thread.
        opened: folder that stands open at first.
        title: beginning of the names of the folders.
    """

    def __init__(
        self,
        gui: GuiApi,
        knobs: Sequence[AdjustableNumber],
        moved: Callable[[str, float], None],
        opened: str = "",
        title: str = "",
    ) -> None:
        self._sliders: list[tuple[AdjustableNumber, Slider]] = []
        self._folders = []
        for group in dict.fromkeys(knob.group for knob in knobs):
            name = ": ".join(filter(None, (title, group)))
            self._folders.append(
                gui.add_folder(name, expand_by_default=group == opened)
            )
            with self._folders[-1]:
                for knob in (each for each in knobs if each.group == group):
                    hint = ": ".join(filter(None, (knob.path, knob.declared.meaning)))
                    first = knob.clip(knob.value)
                    slider = gui.add_slider(
                        knob.label, knob.low, knob.high, knob.step, first, hint=hint
                    )
                    on_user_input(slider, partial(_move_knob, moved, knob))
                    self._sliders.append((knob, slider))

    def show(self, values: Mapping[str, float]) -> None:
        """Set each slider to the given value of its parameter, else to the scenario's
        value.
        """
        for knob, slider in self._sliders:
            slider.value = knob.clip(values.get(knob.path, knob.value))

    def remove(self) -> None:
        """Remove the sliders from the page."""
        for folder in self._folders:
            folder.remove()


def _move_knob(
    moved: Callable[[str, float], None], knob: AdjustableNumber, value: object
) -> None:
    moved(knob.path, knob.clip(value))


SECONDS = 10.0
"""Time (s) that a plot shows, up to its last instant."""

UNSEEN = "unseen"
"""Scale of a last, invisible series, whose number changes with each drawing; uPlot
recomputes its ticks only if a scale changes, and a plot that is made before its width
is known has none."""

HERTZ = 10.0
"""Rate (Hz) at which plots are redrawn."""

DECIMALS = 3
"""Decimals of drawn values and axis labels; a smaller curve would appear next to labels
of 0."""

TICKS = tuple(
    round(digit * 10.0**power, DECIMALS)
    for power in range(-DECIMALS, 7)
    for digit in (1, 2, 5)
)
"""Candidate steps between the labels of an axis."""

LIMIT = "rgb(200, 40, 40)"

WIDTH, MORE = 1.5, 2.0
"""Line width (pixels) of the last law's curve, and its increase for each earlier law,
so that hidden curves show on both sides."""


class Timed(Protocol):
    """Interface of a flight's data at one instant, with its time."""

    @property
    def time(self) -> float:
        """Flight time (s) of the instant."""


Sample = TypeVar("Sample", bound=Timed)

Sample_co = TypeVar("Sample_co", bound=Timed, covariant=True)

Column = Callable[[Sample], float]
"""Function from an instant, such as a
:class:`~skyarm.view.studio.sights.PlottedInstant`, to a number."""


class Plotted(Protocol[Sample_co]):
    """Interface of a flight whose latest instants are plotted live."""

    @property
    def title(self) -> str:
        """Name of the flight."""

    def recent(self, seconds: float) -> Sequence[Sample_co]:
        """Data of the flight's last seconds."""


class Chart(Generic[Sample]):
    """Live plot of one or several quantities over the last seconds, with a curve per
    flight.

    Args:
        gui: controls of viser. title: title with the unit.
        flights: flights whose curves are drawn, in their colours.
        columns: name -> number of an instant; of several the later ones are dashed.
        limit: a level that is drawn, if there is one.
    """

    def __init__(
        self,
        gui: GuiApi,
        title: str,
        flights: Sequence[Plotted[Sample]],
        columns: Mapping[str, Column[Sample]],
        limit: float | None = None,
    ) -> None:
        self._flights = list(flights)
        self._columns = list(columns.values())
        self._limit = limit
        self._turns = itertools.cycle((0.0, 1.0))
        series: list[Series] = [{"label": "time (s)"}]
        for i, (flight, color) in enumerate(zip(flights, COLORS, strict=False)):
            width = WIDTH + MORE * (len(flights) - 1 - i)
            for j, name in enumerate(columns):
                label = " ".join(
                    filter(None, (flight.title, name, "(dashed)" if j else ""))
                )
                series.append({"label": label, "stroke": f"rgb{color}", "width": width})
                if j:
                    series[-1]["dash"] = (3 + 2 * j, 3)
        if limit is not None:
            series.append(
                {"label": "limit", "stroke": LIMIT, "width": 1, "dash": (8, 4)}
            )
        several = len(series) > 2
        series.append({"label": UNSEEN, "scale": UNSEEN})
        self._node = gui.add_uplot(
            self._data(),
            tuple(series),
            title=title,
            # a range that is not stated follows the data's, and strays from it in a
            # busy tab
            scales={"x": {"time": False, "range": (-SECONDS, 0.0)}},
            axes=(
                {"size": 32, "incrs": (1, 2, 5), "space": 40},
                {"size": 58, "incrs": TICKS},
            ),
            legend={"show": several, "live": False},
            height=140,
            padding=(10, 24, 0, 0),
        )

    def draw(self) -> None:
        """Update the plot with the last seconds of all flights."""
        self._node.data = self._data()

    def remove(self) -> None:
        """Remove the plot from the page."""
        self._node.remove()

    def _data(self) -> tuple[Array, ...]:
        """Return times (s) before the last instant and all curves of the plot, padded
        with NaN to one length.
        """
        rows = [flight.recent(SECONDS) for flight in self._flights]
        longest = max(rows, key=len, default=[])
        times = [seen.time - longest[-1].time for seen in longest]
        if len(times) < 2:  # an axis needs two instants
            times = [-1e-3, 0.0]
        curves = []
        for seen in rows:
            for column in self._columns:
                # a curve ends where its flight was lost: the rest of the axis stays
                # empty
                curve = np.full(len(times), math.nan)
                curve[: len(seen)] = np.round([column(one) for one in seen], DECIMALS)
                curves.append(curve)
        # the last curve is unseen and changes at each call
        limit = [] if self._limit is None else [np.full(len(times), self._limit)]
        return (
            np.array(times),
            *curves,
            *limit,
            np.full(len(times), next(self._turns)),
        )


def charts(gui: GuiApi, flights: Sequence[FlownAgent]) -> list[Chart[PlottedInstant]]:
    """Create all live plots for one vehicle in some flights."""
    return [
        Chart(gui, title, flights, columns, limit)
        for title, columns, limit in _chart_rows(flights)
    ]


def _chart_rows(
    flights: Sequence[FlownAgent],
) -> Iterator[tuple[str, dict[str, Column[PlottedInstant]], float | None]]:
    """Yield (title, curve functions by label, limit or None) of each live plot."""
    yield "tip error (mm)", {"": lambda seen: 1e3 * seen.error}, None
    yield "tilt (deg)", {"": lambda seen: math.degrees(seen.tilt)}, None
    if not flights:
        return
    first = flights[0].first
    surfaces = [
        surface.name for contact in first.worlds for surface in contact.surfaces
    ]
    if surfaces:
        yield "contact force (N)", {name: _force(name) for name in surfaces}, None
    # of joints whose drives take another setpoint no effort is known
    joints = first.agent.vehicle.joints
    driven = [
        i
        for i in range(len(joints))
        if not any(each.first.agent.commands_setpoints[i] for each in flights)
    ]
    if driven:
        # one axis, one unit: shares only if every joint has a limit
        limited = all(math.isfinite(float(joints[i].effort_limit)) for i in driven)
        efforts = {joints[i].name: _effort(i, limited) for i in driven}
        yield (
            "joint efforts (% of limit)" if limited else "joint efforts (N m or N)",
            efforts,
            100.0 if limited else None,
        )
    if first.agent.vehicle.rotors:
        rotors = {
            "least": lambda seen: 100.0 * min(seen.rotors),
            "most": lambda seen: 100.0 * max(seen.rotors),
        }
        yield "slowest and fastest rotor (% of limit)", rotors, 100.0


def _force(surface: str) -> Column[PlottedInstant]:
    """Make a function that reads the normal force (N) of a surface on the vehicle at an
    instant.
    """
    return lambda seen: seen.contacts.get(surface, 0.0)


def _effort(joint: int, limited: bool) -> Column[PlottedInstant]:
    """Make a function that reads a joint's effort at an instant, in % of its limit if
    it has one.
    """
    return lambda seen: (
        100.0 * abs(seen.efforts[joint]) if limited else seen.efforts[joint]
    )
