"""``skyarm compare contact-suite``: how often every law does tasks in contact in wrong worlds."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.lines import say
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar
from skyarm.compare.comparison import prepare
from skyarm.compare.contact_laws import LAWS, OWN
from skyarm.compare.contact_suite import CONTACT, QUICK, WORLDS, ContactSuite, fly_contact, replaced_contact
from skyarm.compare.contact_tables import contact_report
from skyarm.compare.contact_tasks import TASKS
from skyarm.compare.overwrites import require_same_plugins
from skyarm.control.catalogue import choices, full_name, is_named, meant
from skyarm.files import must_be_one_of, require_writable, shown, taken_back
from skyarm.simulate.own_code_trials import try_own_code


def contact(
    out: str,
    *,
    laws: str | None,
    tasks: str | None,
    worlds: int | None,
    quick: bool,
    seed: int,
    plant: str,
    one_by_one: int,
    threads: int,
    films: bool,
    console: Console,
) -> None:
    """Fly what is missing of the suite and write its files.

    Raises:
        ValueError, OSError: one line.
    """
    if quick and worlds is not None:
        raise ValueError(f"--worlds: must be left out beside --quick, which flies {QUICK}")
    asked = ContactSuite(
        laws=_laws(laws),
        tasks=_tasks(tasks),
        worlds=worlds or (QUICK if quick else WORLDS),
        seed=seed,
        plant=plant,
        one_by_one=one_by_one,
    )
    todo, _ = asked.flights()
    for flights in {each.entrant.name: each for each in todo}.values():
        try_own_code(flights.scenario())
    folder = Path(out)
    with taken_back(folder, folder / "cells"):
        prepare(require_writable(out))
        other = replaced_contact(folder, asked)
        if other:
            say(f"{folder}: replaces the report of a suite of {', '.join(other)}", 0)
        require_same_plugins(todo, folder / "cells")
        with bar(CONTACT, console, pause=0.0) as advance:
            found = fly_contact(asked, folder, threads=threads, films=films, progress=advance)
    give(found, folder=folder, title="Tasks in contact")
    console.print(contact_report(found), soft_wrap=True)
    console.print(f"suite in {folder}: report.html, tables.md, contact.json, contact.csv, pictures", soft_wrap=True)


def _laws(words: str | None) -> tuple[str, ...]:
    """Laws of the suite or any others by name, aliases resolved."""
    if words is None:
        return LAWS
    names = _split("--laws", words)
    for name in names:
        if name not in OWN and not is_named(name):
            raise ValueError(f"--laws = {shown(name)}: {meant(name)}must be one of {', '.join(OWN)}, or {choices()}")
    return _once("--laws", (name if name in OWN else full_name(name) for name in names))


def _tasks(words: str | None) -> tuple[str, ...]:
    if words is None:
        return tuple(TASKS)
    names = _split("--tasks", words)
    for name in names:
        if name not in TASKS:
            raise ValueError(f"--tasks = {shown(name)}: {must_be_one_of(TASKS, name)}")
    _once("--tasks", names)
    return tuple(name for name in TASKS if name in names)


def _once(option: str, names: Iterable[Any]) -> tuple[str, ...]:
    found = tuple(names)
    for name in found:
        if found.count(name) > 1:
            raise ValueError(f"{option} = {shown(name)}: must be named once")
    return found


def _split(option: str, words: str) -> list[str]:
    names = [name.strip() for name in words.split(",") if name.strip()]
    if not names:
        raise ValueError(f"{option}: must name at least one")
    return names
