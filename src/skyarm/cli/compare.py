"""``skyarm compare``: fly every law on one bench and write its tables, figure and page."""

from __future__ import annotations

from typing import Any

from rich.console import Console

from skyarm.cli.lines import say
from skyarm.cli.progress import bar
from skyarm.compare.entrants import ENTRANTS
from skyarm.compare.replaced import replaced
from skyarm.compare.results import SUITE, Bench, fly_bench, prepare
from skyarm.compare.suite import conditions
from skyarm.compare.tables import report
from skyarm.files import require_writable, shown

SUITES = (SUITE,)


def compare(
    suite: str,
    out: str,
    *,
    laws: str | None,
    columns: str | None,
    plants: int,
    seeds: int,
    single: int,
    seed: int,
    plant: str,
    threads: int,
    console: Console,
) -> None:
    """Fly what is missing of a bench and write its results.

    Raises:
        ValueError, OSError: one line.
    """
    if suite not in SUITES:
        raise ValueError(f"suite = {shown(suite)}: must be one of {', '.join(SUITES)}")
    entrants = _chosen("--laws", laws, ENTRANTS)
    flown = _chosen("--conditions", columns, conditions(plants, seeds))
    folder = require_writable(out)
    prepare(folder)
    bench = Bench(entrants=entrants, conditions=flown, seed=seed, plant=plant, single=single)
    other = replaced(bench, folder / "results.json")
    if other:
        say(f"{folder}: replaces the report of a bench of {'; '.join(other)} (cells of what flies no more stay)", 0)
    with bar(suite, console, pause=0.0) as advance:
        found = fly_bench(bench, folder, threads=threads, progress=advance)
    console.print(report(found, entrants, flown), soft_wrap=True)
    console.print(f"comparison in {folder}: report.html, tables.md, results.json, laws.png", soft_wrap=True)


def _chosen(option: str, words: str | None, there: Any) -> Any:
    """Those of a comma-separated list; all if there is none."""
    if words is None:
        return dict(there)
    names = [name.strip() for name in words.split(",") if name.strip()]
    for name in names:
        if name not in there:
            raise ValueError(f"{option} = {shown(name)}: must be one of {', '.join(there)}")
    if not names:
        raise ValueError(f"{option}: must name at least one of {', '.join(there)}")
    return {name: each for name, each in there.items() if name in names}
