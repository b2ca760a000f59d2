"""Command ``skyarm check``: check if a vehicle can fly, and list the reasons if not."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import name_completion
from skyarm.cli.lines import DIFFERENT
from skyarm.cli.output import bar, give, tell
from skyarm.records.files import write_atomically
from skyarm.records.files.own_inputs import inputs_kept
from skyarm.scenario.scenario_file import is_scenario, kind_of_file
from skyarm.studies.assess.assessment import check as assess
from skyarm.studies.assess.check_sheet import sheet
from skyarm.studies.assess.former_words import upgrade_file


def check(
    what: Annotated[
        str,
        typer.Argument(
            metavar="VEHICLE|SCENARIO",
            help="a file or a shipped name",
            autocompletion=name_completion("vehicle", "scenario"),
        ),
    ],
    payload: Annotated[float, typer.Option(help="mass held at the tip, kg")] = 0.0,
    poses: Annotated[int, typer.Option("--arm-poses", help="number of sampled arm poses")] = 1024,
    gravity: Annotated[float | None, typer.Option(help="with a vehicle: gravity, m/s^2; 9.81 if left out")] = None,
    flights: Annotated[
        bool,
        typer.Option("--flights", help="of a scenario: largest blow, lateness and load that short flights survive"),
    ] = False,
    upgrade: Annotated[
        bool,
        typer.Option(
            "--upgrade",
            help="rewrite a file of an earlier version in the present words, with its comments; also FILE.py",
        ),
    ] = False,
) -> None:
    """Check whether a vehicle can fly, and why not.

    Thrust, torques, joint limits, workspace, largest payload and side force, units that look wrong; of a scenario also
    its reference against limits. Exit code 1 if a fault was found.

    Words of an earlier version are listed with what replaces them.
    """
    if upgrade:
        _write_upgrade(Path(what))
        if kind_of_file(what) not in ("vehicle", "scenario"):
            return
    try:
        with bar(f"{what}: checking"):
            assessment = assess(what, payload=payload, poses=poses, gravity=gravity, flights=flights)
    except ValueError:
        _tell_former_words(what)
        raise
    give(assessment.plain())
    tell(*sheet(assessment))
    if not assessment.flies:
        raise typer.Exit(DIFFERENT)
    if Path(what).suffix and not is_scenario(what):
        tell(f"next: skyarm new vehicle NAME --from {shlex.quote(what)}")


def _write_upgrade(path: Path) -> None:
    """Write a file of an earlier version anew, its former text beside it, and list the changes."""
    found = upgrade_file(path)
    give(changes=[{"field": each.field, "before": each.before, "now": each.now} for each in found.changes])
    if found.changes:
        kept = path.with_name(f"{path.name}.before")
        if kept.exists():
            raise ValueError(f"{path}: {kept} is there already: move it, it is the file before an earlier --upgrade")
        write_atomically(kept, path.read_bytes())
        with inputs_kept():  # this command alone writes over the file that it read
            write_atomically(path, found.text.encode())
        tell(*map(str, found.changes), f"written: {path}; the file before it is kept: {kept}")
    else:
        tell(f"{path}: has no word of an earlier version")
    tell(*found.notes)
    if found.fault:
        raise ValueError(f"{path}: {found.fault}")


def _tell_former_words(what: str) -> None:
    """List the words of an earlier version in a file that this version does not read."""
    if kind_of_file(what) not in ("vehicle", "scenario"):
        return
    found = upgrade_file(Path(what))
    if found.changes:
        count = f"{len(found.changes)} word{'s' if len(found.changes) > 1 else ''} of an earlier version"
        tell(f"{what}: {count}; 'skyarm check {what} --upgrade' writes the file anew", *map(str, found.changes))
