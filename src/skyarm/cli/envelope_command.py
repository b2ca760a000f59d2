"""``skyarm compare envelope-suite``: how far every law is good, and where it is lost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from skyarm.cli.lines import say
from skyarm.cli.machine_output import give
from skyarm.cli.progress import bar
from skyarm.compare.comparison import prepare
from skyarm.compare.envelope_axes import AXES
from skyarm.compare.envelope_setting import PAPER
from skyarm.compare.envelope_suite import ENVELOPE, LAWS, TUNED_LAWS, Envelope, fly_envelope, planned, replaced_envelope
from skyarm.compare.envelope_tables import envelope_report
from skyarm.compare.overwrites import require_same_plugins
from skyarm.control.catalogue import choices, full_name, is_named, meant, require_different
from skyarm.files import must_be_one_of, require_writable, shown, taken_back
from skyarm.simulate.own_code_trials import try_own_code


def envelope(
    out: str,
    *,
    laws: str | None,
    axes: str | None,
    vehicle: str | None,
    quick: bool,
    seed: int,
    plant: str,
    threads: int,
    console: Console,
) -> None:
    """Fly what is missing of an envelope and write its files.

    Raises:
        ValueError, OSError: one line.
    """
    flown = PAPER if vehicle is None else vehicle
    asked = Envelope(
        laws=_laws(laws, LAWS if flown == PAPER else TUNED_LAWS),
        axes=_axes(axes),
        vehicle=flown,
        seed=seed,
        plant=plant,
        quick=quick,
    )
    todo, _ = planned(asked)
    for flights in {each.entrant.name: each for each in todo}.values():
        try_own_code(flights.scenario())
    folder = Path(out)
    with taken_back(folder, folder / "cells"):
        prepare(require_writable(out))
        other = replaced_envelope(folder, asked)
        if other:
            say(f"{folder}: replaces the report of an envelope of {', '.join(other)}", 0)
        require_same_plugins(todo, folder / "cells")
        with bar(ENVELOPE, console, pause=0.0) as advance:
            found = fly_envelope(asked, folder, threads=threads, progress=advance)
    give(found, folder=folder, title=f"The envelope of {found['vehicle']}")
    console.print(envelope_report(found), soft_wrap=True)
    files = "report.html, tables.md, envelope.json, envelope.csv, envelope.png"
    console.print(f"envelope in {folder}: {files}", soft_wrap=True)


def _laws(words: str | None, usual: tuple[str, ...]) -> tuple[str, ...]:
    """Controllers by name, aliases resolved."""
    if words is None:
        return usual
    names = _split("--laws", words)
    require_different(names, "--laws")
    for name in names:
        if not is_named(name):
            raise ValueError(f"--laws = {shown(name)}: {meant(name)}must be {choices()}")
    return tuple(full_name(name) for name in names)


def _axes(words: str | None) -> tuple[str, ...]:
    if words is None:
        return tuple(AXES)
    names = _split("--axes", words)
    for name in names:
        if name not in AXES:
            raise ValueError(f"--axes = {shown(name)}: {must_be_one_of(AXES, name)}")
    return tuple(name for name in AXES if name in names)


def _split(option: str, words: str) -> Sequence[str]:
    names = [name.strip() for name in words.split(",") if name.strip()]
    if not names:
        raise ValueError(f"{option}: must name at least one")
    return names
