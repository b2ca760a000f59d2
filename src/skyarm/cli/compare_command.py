"""``skyarm compare``: laws side by side, on a suite or on a scenario."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.arguments import (
    Flying,
    chosen_names,
    name_completion,
    require_left_out,
    require_within,
    shipped_names,
    split_names,
    workers,
)
from skyarm.cli.output import bar, give, tell
from skyarm.control.catalogue import is_named, must_be_named, require_different
from skyarm.records.files import must_be_one_of, require_writable, shown, taken_back
from skyarm.records.registry import names as registered
from skyarm.simulate.user_code import check_law, require_shapes
from skyarm.studies.compare.comparison import SUITE, Comparison
from skyarm.studies.compare.contact_suite import CONTACT, QUICK, WORLDS, ContactSuite
from skyarm.studies.compare.contact_tasks import LAWS as CONTACT_LAWS
from skyarm.studies.compare.contact_tasks import OWN, TASKS
from skyarm.studies.compare.entrants import ENTRANTS, Entrant, own_entrant
from skyarm.studies.compare.envelope import ENVELOPE, LAWS, TUNED_LAWS, Envelope
from skyarm.studies.compare.envelope_axes import AXES
from skyarm.studies.compare.envelope_setting import PAPER
from skyarm.studies.compare.own_scenario import LAWS as USUAL_LAWS
from skyarm.studies.compare.own_scenario import OwnScenario
from skyarm.studies.compare.run_suite import Suite, fly_suite, prepare
from skyarm.studies.compare.suite import conditions as conditions_of

MOST = 1_000_000
"""Flights of a cell of the comparison: more belong into a sweep, which keeps them on disk."""

OF_SUITES = {
    SUITE: ("--conditions", "--plants", "--seeds"),
    ENVELOPE: ("--axes", "--vehicle", "--quick"),
    CONTACT: ("--tasks", "--worlds", "--quick"),
}
"""Suite -> options that not every comparison has."""

OF_A_SCENARIO = ("--seeds",)
"""Options of :data:`OF_SUITES` that a comparison on a scenario has, too."""


def compare(
    context: typer.Context,
    suite: Annotated[
        str,
        typer.Argument(
            help="paper-suite, envelope-suite, contact-suite, or a scenario",
            autocompletion=name_completion("scenario"),
        ),
    ] = "paper-suite",
    out: Annotated[str | None, typer.Option("--out", help="folder of the results")] = None,
    laws: Annotated[
        str | None,
        typer.Option(
            help="names or FILE.py:make, with commas; all if left out",
            autocompletion=name_completion("controller"),
        ),
    ] = None,
    conditions: Annotated[str | None, typer.Option(help="of the suite, with commas; all if left out")] = None,
    axes: Annotated[str | None, typer.Option(help="of the envelope, with commas; all if left out")] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            help="of the envelope, with an arm; the paper's if left out", autocompletion=name_completion("vehicle")
        ),
    ] = None,
    tasks: Annotated[str | None, typer.Option(help="of the contact suite, with commas; all if left out")] = None,
    worlds: Annotated[int | None, typer.Option(help="wrong worlds of each task in contact; 200 if left out")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="of the envelope: two values an axis; in contact: 16 worlds")
    ] = False,
    plants: Annotated[int, typer.Option(help="how many perturbed plants")] = 1000,
    seeds: Annotated[int, typer.Option(help="noisy flights of the truth")] = 8,
    seed: Annotated[int, typer.Option(help="of plants and noise")] = 0,
    plant: Annotated[str, typer.Option(help="rigid_body or mujoco")] = "rigid_body",
    flying: Flying = 0,
) -> None:
    """Compare all laws; tables, figure, page.

    On the paper's cases, on trials that get harder along axes, on tasks in contact, or on a scenario, by its own law
    and those of --laws. The same command continues what was interrupted.
    """
    for option, value in (("--plants", plants), ("--seeds", seeds)):
        require_within(option, value, 1, MOST)
    require_within("--seed", seed, 0)
    threads = workers(flying)
    if plant not in registered("plant"):
        raise ValueError(f"--plant = {plant!r}: {must_be_one_of(registered('plant'), plant)}")
    if worlds is not None:
        require_within("--worlds", worlds, 1, MOST)
    _require_effect(context, suite)
    common: dict[str, Any] = {"seed": seed, "plant": plant}
    if suite == ENVELOPE:
        asked: Suite = _envelope(laws, axes, vehicle or PAPER, quick=quick, **common)
        _fly(asked, out or "out/envelope", threads)
    elif suite == CONTACT:
        asked = _contact(laws, tasks, worlds, quick, **common)
        _fly(asked, out or "out/contact", threads)
    else:
        if suite == SUITE:
            there = conditions_of(plants, seeds)
            chosen = {name: there[name] for name in chosen_names("--conditions", conditions, there)}
            asked = Comparison(entrants=_entrants(laws), conditions=chosen, **common)
        else:
            asked = _scenario(suite, laws, seeds=seeds, **common)
        _fly(asked, out or "out/compare", threads)


def _require_effect(context: typer.Context, suite: str) -> None:
    """Refuse options that this comparison does not read."""
    own = OF_SUITES.get(suite, OF_A_SCENARIO)
    for option in dict.fromkeys(each for options in OF_SUITES.values() for each in options if each not in own):
        there = [name for name, options in OF_SUITES.items() if option in options]
        there += ["a scenario"] if option in OF_A_SCENARIO else []
        have = " and ".join(there) + (" have it" if len(there) > 1 else " has it")
        of = suite if suite in OF_SUITES else f"scenario {suite}"
        require_left_out(context, [option], f" for {of}; only {have}")


def _scenario(name: str, laws: str | None, **flown: Any) -> OwnScenario:
    """Laws side by side on a scenario."""
    if not name.endswith(".toml") and name not in shipped_names("scenario"):
        suites = ", ".join(OF_SUITES)
        raise ValueError(
            f"suite = {shown(name)}: must be one of {suites}, or a scenario (a .toml file or a shipped one)"
        )
    return OwnScenario(scenario=name, laws=USUAL_LAWS if laws is None else split_names("--laws", laws), **flown)


def _envelope(laws: str | None, axes: str | None, vehicle: str, **flown: Any) -> Envelope:
    """Run the envelope suite: the range of every law, and its limits."""
    require_different([] if laws is None else split_names("--laws", laws), "--laws")
    chosen = _laws(laws, LAWS if vehicle == PAPER else TUNED_LAWS)
    return Envelope(laws=chosen, axes=chosen_names("--axes", axes, AXES), vehicle=vehicle, **flown)


def _contact(laws: str | None, tasks: str | None, worlds: int | None, quick: bool, **flown: Any) -> ContactSuite:
    """Run the contact suite: success rates of every law in perturbed worlds."""
    if quick and worlds is not None:
        raise ValueError(f"--worlds: must be left out beside --quick, which flies {QUICK}")
    count = worlds or (QUICK if quick else WORLDS)
    chosen, named = _laws(laws, CONTACT_LAWS, OWN), chosen_names("--tasks", tasks, TASKS)
    return ContactSuite(laws=chosen, tasks=named, worlds=count, **flown)


def _fly(suite: Suite, out: str, threads: int) -> None:
    """Fly what is missing of a suite's folder; one that was made here is gone where it is refused.

    Raises:
        ValueError, OSError: one line.
    """
    folder = Path(out)
    todo, _ = suite.plan_cells()
    for flights in {each.entrant.name: each for each in todo if each.entrant.group == "own"}.values():
        scenario = flights.scenario()
        require_shapes(scenario)
        check_law(scenario)
    with taken_back(folder, folder / "cells"):
        prepare(require_writable(out))
        with bar(suite.name, pause=0.0) as advance:
            found = fly_suite(suite, folder, threads=threads, progress=advance)
    report = suite.report(found)
    give(found, folder=folder, title=report.title)
    tell(report.markdown(), f"{suite.name} in {folder}: report.html, tables.md, {suite.file}.json")


def _entrants(words: str | None) -> dict[str, Entrant]:
    """Entrants of a comma-separated list, users' laws among them; all of the suite if there is no list."""
    if words is None:
        return dict(ENTRANTS)
    names = split_names("--laws", words, of=f" of {', '.join(ENTRANTS)}")
    require_different(names, "--laws")
    added = {name: found for name in names if name not in ENTRANTS and (found := own_entrant(name)) is not None}
    for name in names:
        if name not in ENTRANTS and name not in added:
            raise ValueError(f"--laws = {shown(name)}: {must_be_one_of(ENTRANTS, name)}")
    if len({each.name for each in added.values()}) < len(added):
        raise ValueError(f"--laws = {shown(words)}: must not name two files and makers of the same names")
    chosen = {name: each for name, each in ENTRANTS.items() if name in names}
    return chosen | {each.name: each for each in added.values()}


def _laws(words: str | None, usual: tuple[str, ...], own: Collection[str] = ()) -> tuple[str, ...]:
    """Controllers by name, each once; ``own`` are names of the suite alone."""
    if words is None:
        return usual
    names = split_names("--laws", words)
    for name in names:
        if name not in own and not is_named(name):
            theirs = f"one of {', '.join(own)}, or " if own else ""
            raise ValueError(f"--laws = {shown(name)}: {must_be_named(name, theirs)}")
        if names.count(name) > 1:
            raise ValueError(f"--laws = {shown(name)}: must be named once")
    return tuple(names)
