"""Reproduction of Barakou et al. 2026: simulate all cases, compute metrics, draw figures, write a report."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.campaign import Campaign, run_campaign
from skyarm.paper.flights import STEADY, WINDOWS, flights, results, settings
from skyarm.paper.inference_tables import evidence_tables, inferred_facts, markdown_of, prediction_table
from skyarm.paper.inferred_settings import INFERRED, PREDICTED, shipped_evidence
from skyarm.paper.published import CASES, Record
from skyarm.paper.report_pages import MAIN, case_files, inferred_section, report_pages
from skyarm.paper.report_tables import markdown_tables
from skyarm.paper.report_text import LOOK, OVERVIEW
from skyarm.records.files import require_replaceable, require_writable, write_atomically
from skyarm.scenario.scenario_record import PLANTS
from skyarm.simulate.workers import Progress
from skyarm.view.figures.paper_figures import overview_figure, paper_figures
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import image

Note = Callable[[str], None]

NAMED = (*(f"figure_{n:02d}" for n in range(3, 19)), "overview")

DPI = 300
"""Resolution of the figure files, sharp in print at their size of one column."""


def reproduce(
    out: str | os.PathLike[str] = "out/paper",
    *,
    plants: Sequence[str] = PLANTS,
    workers: int = 1,
    evidence: Record | None = None,
    progress: Progress | None = None,
    note: Note | None = None,
) -> dict[str, Any]:
    """Simulate the five cases of Barakou et al. 2026 with both controllers; write results, figures, report.

    Writes ``results.json``, ``sensitivity.json``, ``table2.md``, ``inference.md``, ``report.html`` and a page for each
    case beside it (``case1.html`` ...), ``figures/figure_03.png`` ... ``figure_18.png`` and ``overview.png`` (first
    plant), and ``logs/PLANT/CASE_CONTROLLER.npz``; each file appears whole or not at all.

    Args:
        out: folder, made if missing.
        plants: "rigid_body", "mujoco" or both.
        workers: processes that fly.
        evidence: of a search for the paper's unstated settings (``research/infer.py`` of the source); that of the
            package if left out.
        progress: called after every episode.
        note: called with one line before each stage.

    Returns:
        The content of ``results.json``.

    Raises:
        ValueError: an unknown plant.
        NoMachineCodeError: before any flight; as Python floats all flights take hours.
        OSError: the folder or a file in it cannot be written; raised before any flight.
    """
    require_machine_code()
    folder = prepare_folder(out, plants)
    say = note or (lambda _line: None)
    chosen: dict[str, Any] = {} if evidence is None else {"evidence": evidence}
    campaign = run_campaign(plants, workers=workers, progress=progress, **chosen)
    evidence = evidence or shipped_evidence()
    facts = settings(campaign.all_logs()) | inferred_facts(evidence)
    table = results(campaign.metrics_by_cell(), facts, campaign.found.get(INFERRED))
    predicted = results(campaign.metrics_by_cell(), facts, campaign.found.get(PREDICTED))["experiments"]
    say("writing tables and logs")
    _write_data(folder, table, campaign)
    tables = [prediction_table(table, predicted, plants[0]), *evidence_tables(evidence)]
    write_atomically(folder / "inference.md", markdown_of(tables).encode())
    say("drawing Figures 3-18")
    first = campaign.logs[plants[0]]
    figures = paper_figures(first, WINDOWS)
    overview = overview_figure(first, STEADY)
    for name, figure in {**{f"figure_{n:02d}": f for n, f in figures.items()}, "overview": overview}.items():
        write_atomically(folder / "figures" / f"{name}.png", image_bytes(figure, dpi=DPI))
    inferred = inferred_section(table, predicted, evidence, plants[0]) if campaign.found else ""
    say("writing report.html")
    caption = f"{OVERVIEW} {LOOK.rsplit(', ', 1)[0]}; {plants[0]}."
    opening = image(caption, caption, image_bytes(overview), kind="single opening")
    pages = report_pages(table, campaign.sensitivity, campaign.logs, figures, inferred, opening)
    for name, page in pages.items():
        write_atomically(folder / name, page.encode())
    return table


def prepare_folder(out: str | os.PathLike[str], plants: Sequence[str]) -> Path:
    """Create the output folder, and check that every file of the reproduction can be written.

    Raises:
        ValueError: an unknown plant.
        OSError: the folder or a file in it cannot be written.
    """
    for plant in plants:
        if plant not in PLANTS:
            raise ValueError(f"plants = {list(plants)}: must be some of {', '.join(PLANTS)}")
    if not plants:
        raise ValueError(f"plants = []: must be one of {', '.join(PLANTS)} at least")
    folder = require_writable(out)
    for inner in ("figures", *(f"logs/{plant}" for plant in plants)):
        require_writable(folder / inner)
    require_replaceable(*_files(folder, plants))
    return folder


def _files(folder: Path, plants: Sequence[str]) -> list[Path]:
    """Paths of all files that the reproduction writes."""
    names = ["results.json", "sensitivity.json", "table2.md", "inference.md", MAIN, *case_files(CASES).values()]
    names += [f"figures/{name}.png" for name in NAMED]
    names += [f"logs/{each.plant}/{each.case}_{each.controller}.npz" for each in flights(plants)]
    return [folder / name for name in names]


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _write_data(folder: Path, table: dict[str, Any], campaign: Campaign) -> None:
    write_atomically(folder / "results.json", _json(table))
    write_atomically(folder / "sensitivity.json", _json({"schema": 1, "variations": campaign.sensitivity}))
    write_atomically(folder / "table2.md", markdown_tables(table).encode())
    for plant, cases in campaign.logs.items():
        for case, controllers in cases.items():
            for controller, log in controllers.items():
                log.save_npz(folder / "logs" / plant / f"{case}_{controller}.npz")
