"""A whole comparison into a folder: cells, results.json, tables.md, laws.png, report.html."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skyarm.compare.cells import ONE_BY_ONE, Flights, chosen
from skyarm.compare.columns import TRACKING, value
from skyarm.compare.comparison_page import comparison_page
from skyarm.compare.comparison_tables import report
from skyarm.compare.entrants import ENTRANTS, Entrant
from skyarm.compare.fly_comparison import Progress, perform, step_times
from skyarm.compare.suite import Condition, conditions
from skyarm.compare.summary import pairs, table
from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.figures.comparison_figures import Share, laws_figure
from skyarm.figures.style import image_bytes
from skyarm.files import require_writable, write_atomically
from skyarm.registry.plugins import identities

DPI = 160
SUITE = "paper-suite"
CAPTION = (
    "Case 3 in wind. Left: mean tip error over 10 to 20 s on the true plant. Right: share of noisy wrong plants "
    "(condition plants_noisy) on which the flight succeeds, with its interval (95 %)"
)
PAGE = "report.html"
SHARE = "flights with the tip within 20 mm in the last 5 s\nnoisy wrong plants, Case 3 in wind"
WIND_TIP = next(c for c in TRACKING if c.case == "case3_wind" and c.metric.startswith("ee"))


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What flies.

    Attributes:
        entrants: in order. conditions: in order. seed: of plants and noise. plant: "rigid_body" or "mujoco".
        one_by_one: wrong plants that a law meets whose flights fly one by one.
    """

    entrants: Mapping[str, Entrant] = field(default_factory=lambda: ENTRANTS)
    conditions: Mapping[str, Condition] = field(default_factory=conditions)
    seed: int = 0
    plant: str = "rigid_body"
    one_by_one: int = ONE_BY_ONE

    def flights(self) -> list[Flights]:
        """Every cell, entrant by entrant."""
        options: dict[str, Any] = {"seed": self.seed, "plant": self.plant, "one_by_one": self.one_by_one}
        return chosen(self.entrants, self.conditions, **options)


def prepare(folder: Path) -> None:
    """Make the folders of a comparison.

    Raises:
        OSError: one of them cannot be written.
    """
    require_writable(folder)
    require_writable(folder / "cells")


def fly_comparison(
    comparison: Comparison, folder: Path, *, threads: int = 1, progress: Progress | None = None
) -> dict[str, Any]:
    """Fly what is missing of a comparison, write its files, and return the content of ``results.json``.

    Raises:
        NoMachineCodeError: before any flight; most laws fly in batches.
    """
    require_machine_code()
    prepare(folder)
    cells = perform(
        comparison.entrants,
        comparison.conditions,
        folder / "cells",
        seed=comparison.seed,
        plant=comparison.plant,
        one_by_one=comparison.one_by_one,
        threads=threads,
        progress=progress,
    )
    found: dict[str, Any] = {"schema": 1, "suite": SUITE, "seed": comparison.seed, "plant": comparison.plant}
    if identities():
        found["plugins"] = identities()
    found["summaries"] = table(cells)
    found["paired"] = pairs(cells)
    found["step_times"] = step_times(comparison.entrants, next(iter(comparison.conditions.values())))
    picture = comparison_picture(found, list(comparison.entrants))
    write_atomically(folder / "laws.png", picture)
    write_atomically(folder / "results.json", (json.dumps(found, indent=1, allow_nan=False) + "\n").encode())
    write_atomically(folder / "tables.md", report(found, comparison.entrants, comparison.conditions).encode())
    page = comparison_page(found, comparison.entrants, comparison.conditions, {CAPTION: picture})
    write_atomically(folder / PAGE, page.encode())
    return found


def comparison_picture(found: Mapping[str, Any], names: Sequence[str]) -> bytes:
    """PNG of the tip's errors and of the successes of every law."""
    summaries = found["summaries"]
    errors = {
        title: [value(summaries.get(condition, {}), WIND_TIP, name) for name in names]
        for title, condition in (("perfect state", "perfect"), ("noise and delay", "noisy"))
        if condition in summaries
    }
    wrong = summaries.get("plants_noisy", {}).get("case3_wind", {})
    figure = laws_figure(
        names,
        errors,
        [_share(wrong.get(name)) for name in names],
        error_label="mean tip error [mm]\ntrue plant, Case 3 in wind",
        share_label=SHARE if wrong else f"{SHARE}\n(not flown)",
    )
    return image_bytes(figure, dpi=DPI)


def _share(summary: Mapping[str, Any] | None) -> Share | None:
    if summary is None or summary["success_rate"] is None:
        return None
    return Share(summary["success_rate"], *summary["success_interval"])
