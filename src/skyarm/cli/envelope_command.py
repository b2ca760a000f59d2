"""``skyarm compare envelope-suite``: how far every law is good, and where it is lost."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from skyarm.cli.compared_folder import chosen_names, flown_into, split_names, try_every_law
from skyarm.cli.machine_output import give
from skyarm.compare.envelope_axes import AXES
from skyarm.compare.envelope_setting import PAPER
from skyarm.compare.envelope_suite import ENVELOPE, LAWS, SAID, TUNED_LAWS, Envelope, fly_envelope, planned
from skyarm.compare.envelope_tables import envelope_report
from skyarm.compare.overwrites import replaced_suite
from skyarm.control.catalogue import choices, is_named, meant, require_different
from skyarm.files import shown


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
        axes=chosen_names("--axes", axes, AXES),
        vehicle=flown,
        seed=seed,
        plant=plant,
        quick=quick,
    )
    todo, _ = planned(asked)
    try_every_law(todo)
    folder = Path(out)
    other = replaced_suite(folder / "envelope.json", SAID, asked)
    replaces = f"an envelope of {', '.join(other)}" if other else ""
    found = flown_into(
        out, ENVELOPE, todo, lambda told: fly_envelope(asked, folder, threads=threads, progress=told), console,
        replaces=replaces,
    )  # fmt: skip
    give(found, folder=folder, title=f"The envelope of {found['vehicle']}")
    console.print(envelope_report(found), soft_wrap=True)
    files = "report.html, tables.md, envelope.json, envelope.csv, envelope.png"
    console.print(f"envelope in {folder}: {files}", soft_wrap=True)


def _laws(words: str | None, usual: tuple[str, ...]) -> tuple[str, ...]:
    """Controllers by name, aliases resolved."""
    if words is None:
        return usual
    names = split_names("--laws", words)
    require_different(names, "--laws")
    for name in names:
        if not is_named(name):
            raise ValueError(f"--laws = {shown(name)}: {meant(name)}must be {choices(name)}")
    return tuple(names)
