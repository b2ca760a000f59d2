"""Command ``skyarm check``: check if a vehicle can fly, and list the reasons if not."""

from __future__ import annotations

from typing import Annotated

import typer

from skyarm.cli.arguments import name_completion
from skyarm.cli.lines import DIFFERENT
from skyarm.cli.output import bar, give, tell
from skyarm.studies.assess.assessment import check as assess
from skyarm.studies.assess.check_sheet import sheet


def check(
    what: Annotated[
        str,
        typer.Argument(
            metavar="VEHICLE|SCENARIO",
            help="a file or a shipped name",
            autocompletion=name_completion("vehicle", "scenario"),
        ),
    ],
    payload: Annotated[float, typer.Option(help="kg held at the tip")] = 0.0,
    poses: Annotated[int, typer.Option("--arm-poses", help="sampled arm poses")] = 1024,
    gravity: Annotated[float | None, typer.Option(help="m/s^2, for a vehicle; 9.81 if left out")] = None,
) -> None:
    """Check whether a vehicle can fly, and why not.

    Thrust, torques, joint limits, workspace, largest payload and side force, units that look wrong; of a scenario also
    its reference against limits. Exit code 1 if a fault was found.
    """
    with bar(f"{what}: checking"):
        assessment = assess(what, payload=payload, poses=poses, gravity=gravity)
    give(assessment.plain())
    tell(*sheet(assessment))
    if not assessment.flies:
        raise typer.Exit(DIFFERENT)
