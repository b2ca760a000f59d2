"""Command ``skyarm compare``: compare control laws on a suite or a scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.arguments import (
    Flying,
    Laws,
    On,
    OptionalOut,
    chosen_names,
    is_given,
    law_names,
    name_completion,
    names_of,
    require_left_out,
    require_within,
    shipped_names,
    split_names,
    word_completion,
    workers,
)
from skyarm.cli.lines import say
from skyarm.cli.output import bar, give, tell
from skyarm.records.files import must_be_one_of, shown, unreadable
from skyarm.records.registry import names as registered
from skyarm.records.registry.plugins import loaded_plugins
from skyarm.scenario.scenario_file import kind_of_file
from skyarm.simulate.examine import check_law
from skyarm.studies.compare.compare_laws import SUITES, suite_of
from skyarm.studies.compare.comparison import SUITE
from skyarm.studies.compare.contact_suite import CONTACT, QUICK, WORLDS
from skyarm.studies.compare.contact_tasks import TASKS
from skyarm.studies.compare.envelope import ENVELOPE, TUNED_LAWS
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.compare.own_scenario import LAWS as USUAL_LAWS
from skyarm.studies.compare.run_suite import Suite, fly_suite, other_report
from skyarm.studies.compare.suite import conditions as conditions_of
from skyarm.studies.compare.survive import SURVIVE
from skyarm.studies.compare.survive_trials import TRIALS as SURVIVED
from skyarm.studies.compare.team_conditions import ROWS
from skyarm.studies.compare.team_suite import FLOWN, TEAM
from skyarm.studies.flights.executor import require_place
from skyarm.studies.trial.facts import PAPER

MOST = 1_000_000
"""Largest number of flights of a cell of the comparison; more belong into a sweep,
which stores them on disk."""

FILE = "a suite of your own"

READ_BY = {
    "--only": (SUITE, ENVELOPE, SURVIVE, CONTACT, TEAM, FILE),
    "--plants": (SUITE, CONTACT),
    "--seeds": (SUITE, TEAM, "a scenario"),
    "--vehicle": (ENVELOPE, SURVIVE, FILE),
    "--scenario": (TEAM,),
    "--quick": (ENVELOPE, SURVIVE, CONTACT),
}
"""Option -> comparisons that read it, for options that not all read."""

PLANTS, SEEDS = 1000, 8
"""Default number of perturbed plants of the paper's suite, and of noisy flights on the
true plant."""


def compare(
    suite: Annotated[
        str, typer.Argument(autocompletion=name_completion("suite", "scenario"))
    ] = SUITE,
    out: OptionalOut = None,
    laws: Laws = None,
    only: str | None = None,
    vehicle: Annotated[str, name_completion("vehicle")] = PAPER,
    scenario: Annotated[str, name_completion("scenario")] = FLOWN,
    plants: Annotated[
        int | None,
        typer.Option(
            help=(
                f"perturbed plants, {PLANTS} if left out; with contact-suite: worlds,"
                f" {WORLDS}"
            )
        ),
    ] = None,
    seeds: int = SEEDS,
    seed: int = 0,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick",
            help=(
                f"two values of each axis, one of each condition, {QUICK} worlds of"
                " contact-suite"
            ),
        ),
    ] = False,
    plant: Annotated[str, word_completion(registered="plant")] = "rigid_body",
    flying: Flying = 0,
    on: On = None,
) -> None:
    """Compare laws on a suite of trials, or on a scenario.

    Options:
        suite: paper-, envelope-, survive-, contact-, team-suite, your suite or a
            scenario
        out FOLDER: folder of tables, figure and page; the same command goes on in it
        only NAME,...: conditions, axes or tasks, with commas
        vehicle: with an arm; of suites for any vehicle
        scenario: with team-suite: a scenario with [team]
        seeds: noisy flights on the unperturbed plant
        seed: seed of plants and noise
        plant: rigid_body or mujoco
    """
    require_within("--seeds", seeds, 1, MOST)
    require_within("--plants", PLANTS if plants is None else plants, 1, MOST)
    require_within("--seed", seed, 0)
    if on is not None:
        require_place(on, "--on")
    count = workers(flying)
    if plant not in registered("plant"):
        raise ValueError(
            f"--plant = {plant!r}: {must_be_one_of(registered('plant'), plant)}"
        )
    kind = _kind_of_comparison(suite)
    _require_effect(suite, kind)
    names = names_of("--laws", laws)
    options = dict[str, Any](seed=seed, plant=plant)
    if suite in (ENVELOPE, SURVIVE):
        word, there = ("axes", AXES) if suite == ENVELOPE else ("conditions", SURVIVED)
        options |= {
            word: chosen_names("--only", only, there),
            "vehicle": vehicle,
            "quick": quick,
        }
        if suite == ENVELOPE and vehicle != PAPER:
            options["laws"] = TUNED_LAWS
    elif suite == CONTACT:
        if quick and plants is not None:
            raise ValueError(
                f"--plants: must be left out beside --quick, which flies {QUICK}"
            )
        options |= {
            "tasks": chosen_names("--only", only, TASKS),
            "worlds": plants or (QUICK if quick else WORLDS),
        }
    elif suite == TEAM:
        options |= {
            "rows": chosen_names("--only", only, ROWS),
            "seeds": seeds,
            "scenario": scenario,
        }
    elif suite == SUITE:
        flown = conditions_of(plants or PLANTS, seeds)
        options["conditions"] = {
            name: flown[name] for name in chosen_names("--only", only, flown)
        }
    elif kind == FILE:
        options["only"] = None if only is None else split_names("--only", only)
        if is_given("vehicle"):
            options["vehicle"] = vehicle
    elif (suite.endswith(".toml") and Path(suite).is_file()) or suite in shipped_names(
        "scenario"
    ):
        # two names of one law are refused with its plan
        law_names(names)
        options = {word: value for word, value in options.items() if is_given(word)}
        options |= {"seeds": seeds, "laws": names or USUAL_LAWS}
        names = []
    else:
        missing = f"{unreadable(Path(suite))}; " if suite.endswith(".toml") else ""
        raise ValueError(
            f"suite = {shown(suite)}: {missing}must be one of {', '.join(SUITES)}, a"
            " suite or scenario of your own (.toml), or a shipped scenario"
        )
    asked = suite_of(suite, names or None, "--laws", **options)
    _fly(asked, Path(out or asked.folder), count, on)


def _kind_of_comparison(suite: str) -> str:
    """Kind of a comparison, as ``READ_BY`` names it."""
    if suite in SUITES:
        return suite
    return FILE if kind_of_file(suite) == "suite" else "a scenario"


def _require_effect(suite: str, kind: str) -> None:
    """Raise an error if the user gave an option that has no effect on this kind of
    comparison.
    """
    for option, readers in READ_BY.items():
        if kind not in readers:
            of = suite if kind in (suite, FILE) else f"scenario {suite}"
            require_left_out([option], f" for {of}; it is of {' and '.join(readers)}")


def _fly(suite: Suite[Any], folder: Path, count: int, on: str | None) -> None:
    """Run the missing flights of a comparison, and print and write its report.

    Raises:
        ValueError, OSError: one line.
    """
    todo, _ = suite.plan_cells()
    # one flight of each law suffices, and only a user's law may fail
    for flights in {
        each.entrant.name: each for each in todo if loaded_plugins()
    }.values():
        scenario = flights.scenario()
        for name in scenario.agents:
            check_law(scenario.of(name))  # here, that no process has to
    if other := other_report(suite, folder):
        say(
            f"note: {folder}: the report of {shown(other)} is going to be replaced;"
            " --out names another folder"
        )
    with bar(suite.name, pause=0.0) as advance:
        results = fly_suite(suite, folder, workers=count, on=on, progress=advance)
    report = suite.report(results)
    give(results, folder=folder, title=report.title)
    tell(
        report.markdown(),
        f"{suite.name} in {folder}: report.html, tables.md, {suite.file}.json",
    )
