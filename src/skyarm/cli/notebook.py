"""Display of scenarios, logs and other records in a notebook: the text of the
corresponding command, and a picture.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from skyarm.cli.output import PLAIN, Terminal, tell
from skyarm.log.flight_log import Log
from skyarm.log.flight_summary import facts, summary
from skyarm.log.team_log import TeamLog
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.assessment import Assessment
from skyarm.studies.assess.check_sheet import sheet
from skyarm.studies.assess.data_sheet import sheet as vehicle_sheet
from skyarm.studies.assess.data_sheet import vehicle_facts
from skyarm.vehicle import Vehicle
from skyarm.view.figures.flight_plot import plot
from skyarm.view.figures.vehicle_drawing import vehicle_drawing
from skyarm.view.pages import Line, heading, image, table_of

WIDTH = 100
"""Number of characters of a line of a table."""

OF_AGENT, OF_ALL = (
    ("faults", "sensors", "drives", "payloads"),
    (
        "air",
        "forces",
        "changes",
        "endings",
    ),
)
"""Fields of a vehicle, and of what all vehicles share, with any number of records,
which are counted by class."""


def scenario_lines(scenario: Scenario) -> Iterable[Line]:
    """Lines of a scenario: title, vehicle, law, plant, surroundings."""
    several = scenario.is_team
    rows = dict[str, str]()
    kinds = dict[str, str]()
    for name, agent in scenario.agents.items():
        of = f" of {name}" if several else ""
        rows |= {f"vehicle{of}": agent.vehicle.name, f"law{of}": agent.controller.name}
        kinds |= {f"{each}{of}": _kinds(getattr(agent, each)) for each in OF_AGENT}
    gravity = float(next(iter(scenario.agents.values())).plant.gravity)
    rows |= {
        "plant": f"{scenario.kind} ({scenario.integrator}), g = {gravity:g} m/s^2",
        "duration": (
            f"{scenario.duration:g} s, control at {scenario.rates.control} Hz, seed"
            f" {scenario.seed}"
        ),
        "wind": type(scenario.wind).__name__,
        **kinds,
        **{each: _kinds(getattr(scenario, each)) for each in OF_ALL},
    }
    return heading(f"{scenario.name}: {scenario.title}"), table_of(
        ("", ""), [each for each in rows.items() if each[1]], left=2
    )


def _kinds(records: Iterable[object]) -> str:
    """Classes of some records, as text."""
    return ", ".join(type(each).__name__ for each in records)


SHOWN: Mapping[
    type, tuple[Callable[[Any], Iterable[Line]], Callable[[Any], Any] | None]
] = {
    Log: (lambda log: summary(log, facts(log)), lambda log: plot(log, kind="tracking")),
    TeamLog: (lambda log: summary(log, facts(log)), None),
    Scenario: (
        scenario_lines,
        lambda scenario: vehicle_drawing(scenario.agent.vehicle),
    ),
    Vehicle: (
        lambda vehicle: vehicle_sheet(vehicle, vehicle_facts(vehicle, 9.81))[:1],
        vehicle_drawing,
    ),
    Assessment: (sheet, None),
}
"""Class -> functions that return its lines, and its picture."""


def words_and_picture(record: object) -> tuple[str, str]:
    """Summary of a record as text, and its picture as HTML; the picture is empty if it
    cannot be drawn.
    """
    lines, draw = SHOWN[type(record)]
    words = io.StringIO()
    tell(
        *lines(record),
        screen=Terminal(file=words, width=WIDTH, force_jupyter=False, **PLAIN),
    )
    try:
        picture = (
            ""
            if draw is None
            else image(type(record).__name__, "", draw(record)._repr_png_())
        )
    except Exception:  # the words are there
        picture = ""
    return words.getvalue(), picture
