"""Command ``skyarm plan``: motion of base, arm and rotors from a task."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Annotated

import typer

from skyarm.cli.arguments import Force, Out, name_completion, require_not_another
from skyarm.cli.lines import DIFFERENT, NOT_COMPLETED
from skyarm.cli.output import bar, give, plain, say_cause, tell
from skyarm.records.files import output_file, taken_back, write_atomically
from skyarm.records.files.toml import Entry


def plan(
    task: Annotated[str, name_completion("task")],
    out: Out = "plan.npz",
    scenario: str | None = None,
    report: str | None = None,
    seconds: float = 600.0,
    force: Force = False,
) -> None:
    """Plan a flight of base and arm from a task.

    Phases with goals for tip, base and joints, obstacles and limits; the result flies
    as a reference. Exit code 3 if no plan within the limits was found, 1 if the check
    of its scenario finds a fault.

    Options:
        task: a task's file (.toml) or a shipped task
        out FILE: file of the plan (.npz)
        scenario FILE: scenario that flies the plan (.toml)
        report PAGE: page with the motion and its limits (.html)
        seconds: longest search, s; after it there is no plan
    """
    from skyarm.planning.plan_file import plan_bytes
    from skyarm.planning.plan_report import flight_document, summary, summary_lines
    from skyarm.planning.planner import PlanError
    from skyarm.planning.planner import plan as solve
    from skyarm.planning.task import load_task, require_grippers, vehicle_of_file
    from skyarm.scenario.save import scenario_text

    # an hour, chosen
    if not 0.0 < seconds <= 3600.0:
        raise ValueError(f"--seconds = {seconds:g}: must be above 0 and at most 3600")
    require_not_another(task, "task")
    loaded = load_task(task)
    if scenario is not None:
        require_grippers(loaded)
    files = [
        (out, "--out", ".npz"),
        (scenario, "--scenario", ".toml"),
        (report, "--report", ".html"),
    ]
    with taken_back(*(Path(each).parent for each, _, _ in files if each)):
        file, flight, page = (
            None if each is None else output_file(each, name, suffix, force=force)
            for each, name, suffix in files
        )
        try:
            with bar(f"{loaded.name}: planning") as advance:
                found = solve(
                    loaded,
                    seconds=seconds,
                    on_progress=lambda line: advance(0, 0, line),
                )
        except PlanError as error:
            tell(str(error))
            say_cause(str(error))
            # given and told before the exit, because the document must name the cause
            give(solved=False, cause=str(error))
            raise typer.Exit(NOT_COMPLETED) from None
        assert file is not None
        write_atomically(file, plan_bytes(found))
        numbers = summary(found)
        give(solved=True, file=str(file), **plain(numbers))
        tell(*summary_lines(loaded.name, numbers), f"plan: {file}")
        if page is not None:
            from skyarm.studies.assess.plan_page import plan_page

            write_atomically(page, plan_page(found).encode())
            tell(f"page: {page}")
        if flight is not None:
            # relative to the scenario, so that both can be moved together
            beside = Path(os.path.relpath(file, flight.parent))
            document = flight_document(
                found, beside, vehicle_of_file(task, flight.parent)
            )
            faults = _faults(document, flight.parent)
            give(faults=faults)
            if faults:
                tell(
                    *faults,
                    f"no scenario: skyarm check finds what cannot be flown; {flight} is"
                    " not written",
                )
                # a scenario that cannot be flown is not left behind
                raise typer.Exit(DIFFERENT)
            write_atomically(flight, scenario_text(document).encode())
            tell(
                f"scenario: {flight}; fly it by: skyarm run {shlex.quote(str(flight))}"
            )


def _faults(document: dict[str, Entry], folder: Path) -> list[str]:
    """Faults that ``skyarm check`` finds in a scenario of a folder, one line each."""
    from skyarm.scenario.scenario_file import scenario_from
    from skyarm.studies.assess.assessment import check
    from skyarm.studies.assess.finding import FAULT

    found = check(scenario_from(document, folder))
    return [
        f"fault: {each.question}: {each.text}"
        for each in found.every
        if each.level == FAULT
    ]
