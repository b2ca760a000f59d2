"""``skyarm compare``: laws side by side, on a suite or on a scenario."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from skyarm.cli.arguments import (
    Flying,
    chosen_names,
    completed,
    require_left_out,
    require_within,
    shipped,
    split_names,
    workers,
)
from skyarm.cli.lines import say
from skyarm.cli.output import bar, give, tell
from skyarm.compare.cells import Flights
from skyarm.compare.comparison import SUITE, Comparison, fly_comparison, prepare
from skyarm.compare.comparison_tables import report, title_of
from skyarm.compare.entrants import ENTRANTS, Entrant, entrant_name, own_entrant
from skyarm.compare.overwrites import replaced, replaced_suite, require_same_plugins
from skyarm.compare.own_scenario import fly_own, own_flights, own_report
from skyarm.compare.suite import conditions as conditions_of
from skyarm.control.catalogue import choices, full_name, is_named, meant, require_different
from skyarm.files import must_be_one_of, require_writable, shown, taken_back
from skyarm.registry import names as registered
from skyarm.simulate.own_code_trials import try_own_code

MOST = 1_000_000
"""Flights of a cell of the comparison: more belong into a sweep, which keeps them on disk."""

OF_SUITES = {
    "paper-suite": ("--conditions", "--plants", "--seeds", "--one-by-one"),
    "envelope-suite": ("--axes", "--vehicle", "--quick"),
    "contact-suite": ("--tasks", "--worlds", "--films", "--quick", "--one-by-one"),
}
"""Suite -> options that not every comparison has."""

OF_A_SCENARIO = ("--seeds",)
"""Options of :data:`OF_SUITES` that a comparison on a scenario has, too."""


def compare(
    context: typer.Context,
    suite: Annotated[
        str,
        typer.Argument(
            help="paper-suite, envelope-suite, contact-suite, or a scenario (.toml or shipped)",
            autocompletion=completed("scenario"),
        ),
    ] = "paper-suite",
    out: Annotated[
        str | None, typer.Option("--out", help="folder of the results; out/compare, out/envelope, out/contact")
    ] = None,
    laws: Annotated[
        str | None,
        typer.Option(
            help="names or FILE.py:make, with commas; all of the suite if left out",
            autocompletion=completed("controller"),
        ),
    ] = None,
    conditions: Annotated[str | None, typer.Option(help="of the suite, with commas; all if left out")] = None,
    axes: Annotated[str | None, typer.Option(help="of the envelope, with commas; all if left out")] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(help="of the envelope, with an arm; the paper's if left out", autocompletion=completed("vehicle")),
    ] = None,
    tasks: Annotated[str | None, typer.Option(help="of the contact suite, with commas; all if left out")] = None,
    worlds: Annotated[int | None, typer.Option(help="wrong worlds of each task in contact; 200 if left out")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="of the envelope: two values an axis, short flights; in contact: 16 worlds")
    ] = False,
    films: Annotated[bool, typer.Option("--films", help="film a flight of each task in contact")] = False,
    plants: Annotated[int, typer.Option(help="how many perturbed plants")] = 1000,
    seeds: Annotated[int, typer.Option(help="noisy flights of the truth")] = 8,
    one_by_one: Annotated[int, typer.Option(help="perturbed plants for what flies one by one: nmpc, MuJoCo")] = 8,
    seed: Annotated[int, typer.Option(help="of plants and noise")] = 0,
    plant: Annotated[str, typer.Option(help="rigid_body or mujoco")] = "rigid_body",
    flying: Flying = 0,
) -> None:
    """Compare all laws; tables, figure, page.

    A scenario in place of the suite is flown as its file describes it, by its own law first (the row "own") and those
    of --laws: one table. Where --laws is left out, paper_pd, paper_ct and centroidal_tip fly beside it.
    The envelope-suite flies trials that get harder along axes (speed, delay, lag, wind, payload, noise): how far each
    law is good, and where it is lost. The contact-suite flies tasks that touch the world, each in many wrong worlds.
    The same command continues what was interrupted.
    """
    for option, value in (("--plants", plants), ("--seeds", seeds), ("--one-by-one", one_by_one)):
        require_within(option, value, 1, MOST)
    require_within("--seed", seed, 0)
    threads = workers(flying)
    if plant not in registered("plant"):
        raise ValueError(f"--plant = {plant!r}: {must_be_one_of(registered('plant'), plant)}")
    if worlds is not None:
        require_within("--worlds", worlds, 1, MOST)
    _require_effect(context, suite)
    common: dict[str, Any] = {"seed": seed, "plant": plant}
    if suite == SUITE:
        _paper(out or "out/compare", threads, laws, conditions_of(plants, seeds), conditions, one_by_one, common)
    elif suite == "envelope-suite":
        _envelope(out or "out/envelope", threads, laws, axes, vehicle, {**common, "quick": quick})
    elif suite == "contact-suite":
        _contact(out or "out/contact", threads, laws, tasks, worlds, {**common, "one_by_one": one_by_one}, quick, films)
    else:
        _scenario(suite, out or "out/compare", threads, laws, {**common, "seeds": seeds})


def _require_effect(context: typer.Context, suite: str) -> None:
    """Refuse options that this comparison does not read."""
    own = OF_SUITES.get(suite, OF_A_SCENARIO)
    for option in dict.fromkeys(each for options in OF_SUITES.values() for each in options if each not in own):
        there = [name for name, options in OF_SUITES.items() if option in options]
        there += ["a scenario"] if option in OF_A_SCENARIO else []
        have = " and ".join(there) + (" have it" if len(there) > 1 else " has it")
        of = suite if suite in OF_SUITES else f"scenario {suite}"
        require_left_out(context, [option], f" for {of}; only {have}")


def _paper(
    out: str,
    threads: int,
    laws: str | None,
    there: dict[str, Any],
    columns: str | None,
    one_by_one: int,
    common: dict[str, Any],
) -> None:
    entrants = _entrants(laws)
    flown = {name: there[name] for name in chosen_names("--conditions", columns, there)}
    comparison = Comparison(entrants=entrants, conditions=flown, one_by_one=one_by_one, **common)
    _try_every_law([each for each in comparison.flights() if each.entrant.group == "own"])
    folder = Path(out)
    other = replaced(comparison, folder / "results.json")
    replaces = f"a comparison of {'; '.join(other)} (cells of what flies no more stay)" if other else ""
    found = _fly(
        out,
        SUITE,
        comparison.flights(),
        lambda progress: fly_comparison(comparison, folder, threads=threads, progress=progress),
        replaces,
    )
    give(found, folder=folder, title=title_of(list(entrants)))
    tell(report(found, entrants, flown), f"comparison in {folder}: report.html, tables.md, results.json, laws.png")


def _scenario(name: str, out: str, threads: int, laws: str | None, flown: dict[str, Any]) -> None:
    """Laws side by side on a scenario."""
    if not name.endswith(".toml") and name not in shipped("scenario"):
        suites = ", ".join(OF_SUITES)
        raise ValueError(
            f"suite = {shown(name)}: must be one of {suites}, or a scenario (a .toml file or a shipped one)"
        )
    flights = own_flights(name, None if laws is None else split_names("--laws", laws), **flown)
    folder = Path(out)
    found = _fly(
        out,
        flights[0].case.name,
        flights,
        lambda progress: fly_own(flights, folder, threads=threads, progress=progress),
    )
    give(found, folder=folder, title=title_of([each.entrant.name for each in flights]))
    tell(own_report(found), f"comparison in {folder}: tables.md, results.json")


def _envelope(
    out: str, threads: int, laws: str | None, axes: str | None, vehicle: str | None, options: dict[str, Any]
) -> None:
    """How far every law is good, and where it is lost."""
    from skyarm.compare.envelope_axes import AXES
    from skyarm.compare.envelope_setting import PAPER
    from skyarm.compare.envelope_suite import ENVELOPE, LAWS, SAID, TUNED_LAWS, Envelope, fly_envelope, planned
    from skyarm.compare.envelope_tables import envelope_report

    flown = PAPER if vehicle is None else vehicle
    usual = LAWS if flown == PAPER else TUNED_LAWS
    if laws is not None:
        require_different(split_names("--laws", laws), "--laws")
    envelope = Envelope(laws=_laws(laws, usual), axes=chosen_names("--axes", axes, AXES), vehicle=flown, **options)
    todo, _ = planned(envelope)
    _try_every_law(todo)
    folder = Path(out)
    other = replaced_suite(folder / "envelope.json", SAID, envelope)
    found = _fly(
        out,
        ENVELOPE,
        todo,
        lambda progress: fly_envelope(envelope, folder, threads=threads, progress=progress),
        f"an envelope of {', '.join(other)}" if other else "",
    )
    give(found, folder=folder, title=f"The envelope of {found['vehicle']}")
    files = "report.html, tables.md, envelope.json, envelope.csv, envelope.png"
    tell(envelope_report(found), f"envelope in {folder}: {files}")


def _contact(
    out: str,
    threads: int,
    laws: str | None,
    tasks: str | None,
    worlds: int | None,
    options: dict[str, Any],
    quick: bool,
    films: bool,
) -> None:
    """How often every law does tasks in contact in wrong worlds."""
    from skyarm.compare.contact_laws import LAWS, OWN
    from skyarm.compare.contact_suite import CONTACT, QUICK, SAID, WORLDS, ContactSuite, fly_contact
    from skyarm.compare.contact_tables import contact_report
    from skyarm.compare.contact_tasks import TASKS

    if quick and worlds is not None:
        raise ValueError(f"--worlds: must be left out beside --quick, which flies {QUICK}")
    suite = ContactSuite(
        laws=_laws(laws, LAWS, OWN),
        tasks=chosen_names("--tasks", tasks, TASKS),
        worlds=worlds or (QUICK if quick else WORLDS),
        **options,
    )
    todo, _ = suite.flights()
    _try_every_law(todo)
    folder = Path(out)
    other = replaced_suite(folder / "contact.json", SAID, suite)
    found = _fly(
        out,
        CONTACT,
        todo,
        lambda progress: fly_contact(suite, folder, threads=threads, films=films, progress=progress),
        f"a suite of {', '.join(other)}" if other else "",
    )
    give(found, folder=folder, title="Tasks in contact")
    tell(contact_report(found), f"suite in {folder}: report.html, tables.md, contact.json, contact.csv, pictures")


def _fly(out: str, title: str, todo: Sequence[Flights], fly: Callable[[Any], Any], replaces: str = "") -> Any:
    """Fly what is missing of a folder; one that was made here is gone where it is refused.

    Args:
        out: the folder.
        title: of the bar of progress.
        todo: cells of the folder that are requested.
        fly: flies those that are missing, given the function of progress.
        replaces: the report that the folder holds, in words; "" for nothing else.

    Raises:
        ValueError, OSError: one line.
    """
    folder = Path(out)
    with taken_back(folder, folder / "cells"):
        prepare(require_writable(out))
        if replaces:
            say(f"{folder}: replaces the report of {replaces}", 0)
        require_same_plugins(todo, folder / "cells")
        with bar(title, pause=0.0) as advance:
            return fly(advance)


def _try_every_law(todo: Sequence[Flights]) -> None:
    """Try a user's code once for each law.

    Raises:
        ValueError: one line on what is wrong with it.
    """
    for flights in {each.entrant.name: each for each in todo}.values():
        try_own_code(flights.scenario())


def _entrants(words: str | None) -> dict[str, Entrant]:
    """Entrants of a comma-separated list, users' laws among them; all of the suite if there is no list."""
    if words is None:
        return dict(ENTRANTS)
    given = split_names("--laws", words, of=f" of {', '.join(ENTRANTS)}")
    require_different(given, "--laws")
    names = [entrant_name(name) for name in given]
    added = {name: found for name in names if name not in ENTRANTS and (found := own_entrant(name)) is not None}
    for name in names:
        if name not in ENTRANTS and name not in added:
            raise ValueError(f"--laws = {shown(name)}: {must_be_one_of(ENTRANTS, name)}")
    if len({each.name for each in added.values()}) < len(added):
        raise ValueError(f"--laws = {shown(words)}: must not name two files and makers of the same names")
    chosen = {name: each for name, each in ENTRANTS.items() if name in names}
    return chosen | {each.name: each for each in added.values()}


def _laws(words: str | None, usual: tuple[str, ...], own: Iterable[str] = ()) -> tuple[str, ...]:
    """Controllers by name, aliases resolved, each once; ``own`` are names of the suite alone."""
    if words is None:
        return usual
    names = split_names("--laws", words)
    for name in names:
        if name not in own and not is_named(name):
            theirs = f"one of {', '.join(own)}, or " if own else ""
            raise ValueError(f"--laws = {shown(name)}: {meant(name)}must be {theirs}{choices(name)}")
    found = tuple(name if name in own else full_name(name) for name in names)
    for name in found:
        if found.count(name) > 1:
            raise ValueError(f"--laws = {shown(name)}: must be named once")
    return found
