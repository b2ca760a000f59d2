"""Command ``skyarm check``: check if a vehicle can fly, and list the reasons if not."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import name_completion, require_left_out
from skyarm.cli.lines import DIFFERENT
from skyarm.cli.output import bar, give, tell
from skyarm.scenario.scenario_file import is_scenario, kind_of_file
from skyarm.studies.assess.assessment import check as assess
from skyarm.studies.assess.check_sheet import sheet


def check(
    what: Annotated[str, name_completion("vehicle", "scenario")],
    payload: float = 0.0,
    poses: Annotated[int, typer.Option("--arm-poses")] = 1024,
    gravity: float | None = None,
    flights: bool = False,
) -> None:
    """Check whether a vehicle can fly, and why not.

    Thrust, torques, joint limits, workspace, largest payload and side force, units that
    look wrong; of a scenario also its reference against limits. Exit code 1 if a fault
    was found.

    Options:
        what VEHICLE|SCENARIO|SUITE: a file or a shipped name
        payload: mass held at the tip, kg
        poses: number of sampled arm poses
        gravity: with a vehicle: gravity, m/s^2; 9.81 if left out
        flights: of a scenario: largest blow, lateness and load that short flights
            survive
    """
    if kind_of_file(what) == "suite":
        return _check_suite(what)
    with bar(f"{what}: checking"):
        assessment = assess(
            what, payload=payload, poses=poses, gravity=gravity, flights=flights
        )
    give(assessment.plain())
    tell(*sheet(assessment))
    if not assessment.flies:
        raise typer.Exit(DIFFERENT)
    if Path(what).suffix and not is_scenario(what):
        tell(f"next: skyarm new vehicle NAME --from {shlex.quote(what)}")


def _check_suite(file: str) -> None:
    """Plan every flight of a suite, so that what cannot fly is refused here, and say
    what flies.
    """
    from skyarm.studies.compare.suite_file import load_suite

    require_left_out(
        ["--payload", "--arm-poses", "--gravity", "--flights"], " for a suite"
    )
    suite = load_suite(file)
    with bar(f"{file}: checking"):
        cells, refused = suite.plan_cells()
    flights = sum(each.trial.flights * len(each.points) for each in cells)
    give(
        suite=suite.name,
        trials=[each.name for each in suite.trials],
        flights=flights,
        not_flown=dict(refused),
    )
    trials = f"{len(suite.trials)} trial{'s' if len(suite.trials) > 1 else ''}"
    tell(f"{file}: {trials} under {', '.join(suite.laws)}: {flights} flights")
    tell(*(f"{law} does not fly: {why}" for law, why in refused.items()))
    if not cells:
        raise typer.Exit(DIFFERENT)
