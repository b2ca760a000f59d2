"""Command ``skyarm margins``: eigenvalues and stability margins of the linearised
closed loop.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import (
    Law,
    OptionalOut,
    Scenario,
    one_law,
    require_not_another,
    require_within,
)
from skyarm.cli.lines import NOT_COMPLETED, say_suspicious
from skyarm.cli.output import (
    bar,
    give,
    plain,
    plugin_facts,
    tell,
    tell_report,
    write_json,
)
from skyarm.control.safety import with_safety_layer
from skyarm.control.safety.safety_layer import SafetyParameters
from skyarm.records.files import output_file, taken_back, write_atomically
from skyarm.scenario.payload_tables import scheduled_changes
from skyarm.scenario.scenario_file import load_scenario
from skyarm.scenario.scenario_record import Scenario as Record

DPI = 150

MOST_INSTANTS = 10_000
"""Largest number of instants along a flight; each takes about half a second."""


def margins(
    scenario: Scenario,
    laws: Law = None,
    instants: int = 4,
    safety: bool = False,
    file: OptionalOut = None,
    page: Annotated[str | None, typer.Option("--html")] = None,
) -> None:
    """Linearise the closed loop: eigenvalues, margins.

    In hover and along the scenario: delay and gain of the actuators, disk margins of
    every loop, alone and together. Exit code 3 if the flight ended before its time.

    Options:
        instants: number of instants along the flight at which margins are computed,
            next to hover
        safety: add the safety layer to the law
        file FILE: JSON file for eigenvalues and margins
        page PAGE: page with Nyquist diagrams (.html)
    """
    from skyarm.studies.stability.flight_margins import evidence, hover_loci
    from skyarm.studies.stability.frozen_scenario import without_adaptation
    from skyarm.studies.stability.margins_report import margin_lines, margins_page

    planned = _prepare(scenario, one_law(laws), safety=safety)
    require_within("--instants", instants, 0, MOST_INSTANTS)
    frozen = without_adaptation(planned)
    # files are checked before the computation, which takes minutes
    with taken_back(*(Path(each).parent for each in (file, page) if each)):
        written = None if file is None else output_file(file, "--out", ".json")
        drawn = None if page is None else output_file(page, "--html", ".html")
        with bar(planned.name) as advance:
            examined = evidence(
                frozen, instants, lambda done, total: advance(done, total, "instants")
            )
    tell_report(margin_lines(examined))
    if frozen is not planned:
        tell("the law's slow adaptation of load and friction is held")
    if examined.left_out:
        tell(f"disturbances are left out: {', '.join(examined.left_out)}")
    if scheduled_changes(planned):
        tell(
            "changes in flight are left out: these are the margins of the scenario as"
            " it begins"
        )
    if not examined.completed:
        tell("the flight ended before its time: no instants beyond")
    document = {"schema": 1, **plain(examined), **plugin_facts()}
    give(document, **({} if drawn is None else {"page": drawn}))
    if drawn is not None:
        from skyarm.studies.stability.nyquist_figure import nyquist_figure
        from skyarm.view.figures.style import image_bytes

        with bar("Nyquist diagrams"):
            loci = hover_loci(planned)
            picture = image_bytes(nyquist_figure(loci), dpi=DPI) if loci else b""
            write_atomically(drawn, margins_page(examined, loci, picture).encode())
        tell(f"page: {drawn}")
    if written is not None:
        tell(f"written: {write_json(written, document)}")
    if not examined.completed:
        raise typer.Exit(NOT_COMPLETED)


def _prepare(scenario: str, controller: str | None, *, safety: bool) -> Record:
    """Load a scenario for the stability margins, with another controller or the safety
    layer if requested.

    Raises:
        ValueError: one line.
    """
    require_not_another(scenario, "scenario")
    loaded = load_scenario(scenario, controller=controller).alone("stability margins")
    say_suspicious(loaded)
    # a law that has the layer already needs no second one
    if not safety or isinstance(loaded.agent.controller.par, SafetyParameters):
        return loaded
    return loaded.with_controller(with_safety_layer(loaded.agent.controller))
