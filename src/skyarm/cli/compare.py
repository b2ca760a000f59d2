"""``skyarm compare``: fly every law on one bench and write its tables, figure and page."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from skyarm.cli.progress import bar
from skyarm.compare.bench import perform, step_times
from skyarm.compare.columns import TRACKING, value
from skyarm.compare.entrants import ENTRANTS, Entrant
from skyarm.compare.page import comparison_page
from skyarm.compare.suite import Condition, conditions
from skyarm.compare.summary import pairs, table
from skyarm.compare.tables import report
from skyarm.figures.embed import image_bytes
from skyarm.figures.laws import Share, laws_figure
from skyarm.files import require_writable, shown, write_atomically

SUITES = ("paper-suite",)
DPI = 160
WIND_TIP = next(c for c in TRACKING if c.case == "case3_wind" and c.metric.startswith("ee"))


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
    flown: dict[str, Condition] = conditions(plants, seeds)
    entrants = _chosen("--laws", laws, ENTRANTS)
    flown = _chosen("--conditions", columns, flown)
    folder = require_writable(out)
    require_writable(folder / "cells")
    with bar(suite, console, pause=0.0) as advance:
        options: dict[str, Any] = {"seed": seed, "plant": plant, "single": single, "threads": threads}
        cells = perform(entrants, flown, folder / "cells", progress=advance, **options)
    found: dict[str, Any] = {"schema": 1, "suite": suite, "seed": seed, "plant": plant, "summaries": table(cells)}
    found["paired"] = pairs(cells)
    found["step_times"] = step_times(entrants, next(iter(flown.values())))
    _write(folder, found, entrants, flown)
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


def _write(folder: Path, found: dict[str, Any], entrants: dict[str, Entrant], flown: dict[str, Condition]) -> None:
    picture = image_bytes(_figure(found, list(entrants)), dpi=DPI)
    caption = "Tip error in the wind, and share of successes on wrong plants"
    write_atomically(folder / "laws.png", picture)
    write_atomically(folder / "results.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_atomically(folder / "tables.md", report(found, entrants, flown).encode())
    page = comparison_page(found, entrants, flown, {caption: picture})
    write_atomically(folder / "report.html", page.encode())


def _figure(found: dict[str, Any], names: Sequence[str]) -> Any:
    summaries = found["summaries"]
    errors = {
        title: [value(summaries.get(condition, {}), WIND_TIP, name) for name in names]
        for title, condition in (("perfect state", "perfect"), ("noise and delay", "noisy"))
        if condition in summaries
    }
    wrong = summaries.get("plants_noisy", {}).get("case3_wind", {})
    return laws_figure(
        names,
        errors,
        [_share(wrong.get(name)) for name in names],
        error_label="mean tip error, Case 3 in wind [mm]",
        share_label="tip within 20 mm: share of wrong plants",
    )


def _share(summary: dict[str, Any] | None) -> Share | None:
    if summary is None or summary["success_rate"] is None:
        return None
    return Share(summary["success_rate"], *summary["success_interval"])
