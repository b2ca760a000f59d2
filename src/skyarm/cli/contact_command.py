"""``skyarm compare contact-suite``: how often every law does tasks in contact in wrong worlds."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.compared_folder import chosen_names, flown_into, split_names, try_every_law
from skyarm.cli.machine_output import give
from skyarm.compare.contact_laws import LAWS, OWN
from skyarm.compare.contact_suite import CONTACT, QUICK, SAID, WORLDS, ContactSuite, fly_contact
from skyarm.compare.contact_tables import contact_report
from skyarm.compare.contact_tasks import TASKS
from skyarm.compare.overwrites import replaced_suite
from skyarm.control.catalogue import choices, is_named, meant
from skyarm.files import shown


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
    try_every_law(todo)
    folder = Path(out)
    other = replaced_suite(folder / "contact.json", SAID, asked)
    replaces = f"a suite of {', '.join(other)}" if other else ""

    def fly(told: Any) -> dict[str, Any]:
        return fly_contact(asked, folder, threads=threads, films=films, progress=told)

    found = flown_into(out, CONTACT, todo, fly, console, replaces=replaces)
    give(found, folder=folder, title="Tasks in contact")
    console.print(contact_report(found), soft_wrap=True)
    console.print(f"suite in {folder}: report.html, tables.md, contact.json, contact.csv, pictures", soft_wrap=True)


def _laws(words: str | None) -> tuple[str, ...]:
    """Laws of the suite or any others by name, aliases resolved."""
    if words is None:
        return LAWS
    names = split_names("--laws", words)
    for name in names:
        if name not in OWN and not is_named(name):
            raise ValueError(
                f"--laws = {shown(name)}: {meant(name)}must be one of {', '.join(OWN)}, or {choices(name)}"
            )
    return _once("--laws", names)


def _tasks(words: str | None) -> tuple[str, ...]:
    found = chosen_names("--tasks", words, TASKS)
    if words is not None:
        _once("--tasks", split_names("--tasks", words))
    return found


def _once(option: str, names: Iterable[Any]) -> tuple[str, ...]:
    found = tuple(names)
    for name in found:
        if found.count(name) > 1:
            raise ValueError(f"{option} = {shown(name)}: must be named once")
    return found
