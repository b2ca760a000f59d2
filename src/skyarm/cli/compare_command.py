"""``skyarm compare``: fly a suite of laws, or laws on one scenario, and write its report."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.lines import say
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar
from skyarm.compare.comparison import SUITE, Comparison
from skyarm.compare.contact_laws import LAWS as CONTACT_LAWS
from skyarm.compare.contact_laws import OWN
from skyarm.compare.contact_suite import CONTACT, QUICK, WORLDS, ContactSuite, fly_contact
from skyarm.compare.contact_tasks import TASKS
from skyarm.compare.entrants import ENTRANTS, Entrant, own_entrant
from skyarm.compare.envelope import ENVELOPE, LAWS, TUNED_LAWS, Envelope, fly_envelope
from skyarm.compare.envelope_axes import AXES
from skyarm.compare.envelope_setting import PAPER
from skyarm.compare.own_scenario import LAWS as USUAL_LAWS
from skyarm.compare.own_scenario import OwnScenario
from skyarm.compare.run_suite import Suite, fly_suite, prepare, replaced
from skyarm.compare.suite import conditions
from skyarm.control.catalogue import choices, is_named, meant, require_different
from skyarm.files import must_be_one_of, require_writable, shown, taken_back
from skyarm.scenario.scenario_file import list_scenarios
from skyarm.simulate.user_code import check_components, check_law


def compare(
    suite: str,
    out: str,
    *,
    laws: str | None,
    columns: str | None,
    plants: int,
    seeds: int,
    one_by_one: int,
    threads: int,
    console: Console,
    **flown: Any,
) -> None:
    """Fly what is missing of a comparison, or of laws on a scenario, and write its results.

    Raises:
        ValueError, OSError: one line.
    """
    if suite == SUITE:
        chosen = _chosen("--conditions", columns, conditions(plants, seeds))
        entrants = _chosen("--laws", laws, ENTRANTS, own_entrant)
        asked: Suite = Comparison(entrants=entrants, conditions=chosen, one_by_one=one_by_one, **flown)
    else:
        if columns is not None:
            raise ValueError("--conditions: must be left out for a scenario, which says its own")
        if not suite.endswith(".toml") and suite not in list_scenarios():
            raise ValueError(
                f"suite = {shown(suite)}: must be one of {SUITE}, {ENVELOPE}, {CONTACT}, or a scenario "
                "(a .toml file or a shipped one)"
            )
        named = USUAL_LAWS if laws is None else split_names("--laws", laws)
        asked = OwnScenario(scenario=suite, laws=named, seeds=seeds, **flown)
    _fly(asked, out, threads, console, fly_suite)


def envelope(
    out: str,
    *,
    laws: str | None,
    axes: str | None,
    vehicle: str | None,
    quick: bool,
    threads: int,
    console: Console,
    **flown: Any,
) -> None:
    """Fly what is missing of an envelope and write its files.

    Raises:
        ValueError, OSError: one line.
    """
    usual = LAWS if vehicle in (None, PAPER) else TUNED_LAWS
    require_different([] if laws is None else split_names("--laws", laws), "--laws")
    chosen = _controllers(laws, usual)
    named = chosen_names("--axes", axes, AXES)
    asked = Envelope(laws=chosen, axes=named, vehicle=vehicle or PAPER, quick=quick, **flown)
    _fly(asked, out, threads, console, fly_envelope)


def contact(
    out: str,
    *,
    laws: str | None,
    tasks: str | None,
    worlds: int | None,
    quick: bool,
    threads: int,
    console: Console,
    **flown: Any,
) -> None:
    """Fly what is missing of the suite and write its files.

    Raises:
        ValueError, OSError: one line.
    """
    if quick and worlds is not None:
        raise ValueError(f"--worlds: must be left out beside --quick, which flies {QUICK}")
    count = worlds or (QUICK if quick else WORLDS)
    chosen = _once("--laws", _controllers(laws, CONTACT_LAWS, OWN))
    named = chosen_names("--tasks", tasks, TASKS)
    _once("--tasks", split_names("--tasks", tasks) if tasks else ())
    _fly(ContactSuite(laws=chosen, tasks=named, worlds=count, **flown), out, threads, console, fly_contact)


def _fly(suite: Any, out: str, threads: int, console: Console, fly: Callable[..., dict[str, Any]]) -> None:
    """Fly what is missing of a suite's folder; one that was made here is gone where it is refused."""
    folder = Path(out)
    todo, _ = suite.planned()
    for flights in {each.entrant.name: each for each in todo if each.entrant.group == "own"}.values():
        scenario = flights.scenario()
        check_components(scenario)
        check_law(scenario)
    other = replaced(suite, folder)
    with taken_back(folder, folder / "cells"):
        prepare(require_writable(out))
        if other:
            say(f"{folder}: replaces the report of {'; '.join(other)} (cells of what flies no more stay)", 0)
        with bar(suite.name, console, pause=0.0) as advance:
            found = fly(suite, folder, threads=threads, progress=advance)
    report = suite.report(found)
    give(found, folder=folder, title=report.title)
    console.print(report.markdown(), soft_wrap=True)
    console.print(f"{suite.name} in {folder}: report.html, tables.md, {suite.file}.json", soft_wrap=True)


def split_names(option: str, words: str, *, of: str = "") -> list[str]:
    """Names of a comma-separated list.

    Raises:
        ValueError: none at all.
    """
    names = [name.strip() for name in words.split(",") if name.strip()]
    if not names:
        raise ValueError(f"{option}: must name at least one{of}")
    return names


def chosen_names(option: str, words: str | None, there: Collection[str]) -> tuple[str, ...]:
    """Those of ``there`` that a list names, in the order of ``there``; all where there is no list.

    Raises:
        ValueError: a name that is not there.
    """
    names = tuple(there) if words is None else split_names(option, words)
    for name in names:
        if name not in there:
            raise ValueError(f"{option} = {shown(name)}: {must_be_one_of(there, name)}")
    return tuple(name for name in there if name in names)


def _controllers(words: str | None, usual: tuple[str, ...], more: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Controllers by name, aliases resolved, or some of ``more``."""
    if words is None:
        return usual
    names = split_names("--laws", words)
    for name in names:
        if name not in more and not is_named(name):
            also = f"one of {', '.join(more)}, or " if more else ""
            raise ValueError(f"--laws = {shown(name)}: {meant(name)}must be {also}{choices(name)}")
    return tuple(names)


def _once(option: str, names: Collection[str]) -> tuple[str, ...]:
    for name in names:
        if list(names).count(name) > 1:
            raise ValueError(f"{option} = {shown(name)}: must be named once")
    return tuple(names)


def _chosen(
    option: str, words: str | None, there: Mapping[str, Any], more: Callable[[str], Entrant | None] = lambda _name: None
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
