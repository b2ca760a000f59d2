"""``skyarm compare``: fly every law side by side and write its tables, figure and page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.compared_folder import flown_into, split_names, try_every_law
from skyarm.cli.machine_output import give
from skyarm.compare.comparison import SUITE, Comparison, fly_comparison
from skyarm.compare.comparison_tables import report, title_of
from skyarm.compare.entrants import ENTRANTS, Entrant, own_entrant
from skyarm.compare.overwrites import replaced
from skyarm.compare.own_scenario import fly_own, own_flights, own_report
from skyarm.compare.suite import conditions
from skyarm.control.catalogue import require_different
from skyarm.files import must_be_one_of, shown
from skyarm.scenario.scenario_file import list_scenarios

SUITES = (SUITE,)
"""Flown here; the envelope has a command of its own (:mod:`skyarm.cli.envelope_command`)."""


def compare(
    suite: str,
    out: str,
    *,
    laws: str | None,
    columns: str | None,
    plants: int,
    seeds: int,
    one_by_one: int,
    seed: int,
    plant: str,
    threads: int,
    console: Console,
) -> None:
    """Fly what is missing of a comparison and write its results.

    Raises:
        ValueError, OSError: one line.
    """
    if suite not in SUITES:
        if columns is not None:
            raise ValueError("--conditions: must be left out for a scenario, which says its own")
        _on_scenario(suite, out, laws, plant=plant, seeds=seeds, seed=seed, threads=threads, console=console)
        return
    entrants = _chosen("--laws", laws, ENTRANTS, own_entrant)
    flown = _chosen("--conditions", columns, conditions(plants, seeds))
    folder = Path(out)
    comparison = Comparison(entrants=entrants, conditions=flown, seed=seed, plant=plant, one_by_one=one_by_one)
    try_every_law([each for each in comparison.flights() if each.entrant.group == "own"])
    other = replaced(comparison, folder / "results.json")
    kept = "(cells of what flies no more stay)"
    found = flown_into(
        out, suite, comparison.flights(),
        lambda told: fly_comparison(comparison, folder, threads=threads, progress=told), console,
        replaces=f"a comparison of {'; '.join(other)} {kept}" if other else "",
    )  # fmt: skip
    give(found, folder=folder, title=title_of(list(entrants)))
    console.print(report(found, entrants, flown), soft_wrap=True)
    console.print(f"comparison in {folder}: report.html, tables.md, results.json, laws.png", soft_wrap=True)


def _on_scenario(name: str, out: str, laws: str | None, *, console: Console, threads: int, **flown: Any) -> None:
    """Laws side by side on a scenario.

    Raises:
        ValueError: neither a suite nor a scenario, or a law that is none.
    """
    if not name.endswith(".toml") and name not in list_scenarios():
        suites = ", ".join((*SUITES, "envelope-suite", "contact-suite"))
        raise ValueError(
            f"suite = {shown(name)}: must be one of {suites}, or a scenario (a .toml file or a shipped one)"
        )
    chosen = None if laws is None else split_names("--laws", laws)
    flights = own_flights(name, chosen, **flown)
    folder = Path(out)
    found = flown_into(
        out, flights[0].case.name, flights, lambda told: fly_own(flights, folder, threads=threads, progress=told),
        console, replaces="",
    )  # fmt: skip
    give(found, folder=folder, title=title_of([each.entrant.name for each in flights]))
    console.print(own_report(found), soft_wrap=True)
    console.print(f"comparison in {folder}: tables.md, results.json", soft_wrap=True)


def _chosen(
    option: str, words: str | None, there: Any, more: Callable[[str], Entrant | None] = lambda _name: None
) -> Any:
    """Those of a comma-separated list, and ``more`` by name; all that are there if there is no list."""
    if words is None:
        return dict(there)
    given = split_names(option, words, of=f" of {', '.join(there)}")
    require_different(given, option)
    names = list(given)
    added = {name: found for name in names if name not in there and (found := more(name)) is not None}
    for name in names:
        if name not in there and name not in added:
            raise ValueError(f"{option} = {shown(name)}: {must_be_one_of(there, name)}")
    if len({each.name for each in added.values()}) < len(added):
        raise ValueError(f"{option} = {shown(words)}: must not name two files and makers of the same names")
    chosen = {name: each for name, each in there.items() if name in names}
    return chosen | {each.name: each for each in added.values()}
