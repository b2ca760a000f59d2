"""The paper reproduced: fly, measure, draw, write."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.campaign import Campaign, run_campaign
from skyarm.paper.flights import STEADY, WINDOWS, flights, results, settings
from skyarm.paper.inference_tables import evidence_tables, inferred_facts, markdown_of, prediction_table
from skyarm.paper.inferred_settings import INFERRED, PREDICTED, shipped_evidence
from skyarm.paper.published import CASES
from skyarm.paper.reasons import Reasons, reasons
from skyarm.paper.report_pages import MAIN, case_files, inferred_section, report_pages, vehicle_section
from skyarm.paper.report_tables import markdown_tables
from skyarm.paper.report_text import LOOK, OVERVIEW
from skyarm.paper.variations import variations
from skyarm.records.files import require_replaceable, require_writable, write_atomically
from skyarm.scenario.scenario_record import PLANTS
from skyarm.studies.compare.comparison import Comparison
from skyarm.studies.compare.entrants import ENTRANTS
from skyarm.studies.compare.run_suite import PAGE, Progress, Suite, fly_suite, prepare
from skyarm.studies.compare.suite import conditions
from skyarm.view.figures.paper_figures import overview_figure, paper_figures
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import details, image

Note = Callable[[str], None]

LAWS = ("paper_pd", "paper_ct", "centroidal_joint", "centroidal_tip")
"""The paper's laws and this library's, which fly the comparison's cases beside the report."""

NAMED = (*(f"figure_{n:02d}" for n in range(3, 19)), "overview")

DPI = 300
"""Resolution of the figure files, sharp in print at their size of one column."""


def reproduce(
    out: str | os.PathLike[str] = "out/paper",
    *,
    plants: Sequence[str] = PLANTS,
    workers: int = 1,
    suites: Mapping[str, Suite] | None = None,
    evidence: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    note: Note | None = None,
) -> dict[str, Any]:
    """Fly the paper's five experiments with both controllers and write everything that comes of it.

    Writes ``results.json``, ``sensitivity.json``, ``table2.md``, ``inference.md``, ``report.html`` and a page for each
    case beside it (``case1.html`` ...), ``figures/figure_03.png`` ... ``figure_18.png`` and ``overview.png`` (first
    plant), ``logs/PLANT/CASE_CONTROLLER.npz``, and a folder for each suite; each file appears whole or not at all.

    Args:
        out: folder, made if missing.
        plants: "rigid_body", "mujoco" or both.
        workers: processes that fly.
        suites: folder -> suite, flown after the paper, continued if interrupted, and shown by their tables; the paper's
            laws and the centroidal law on the comparison's cases if left out.
        evidence: of a search for the paper's unstated settings
        (:func:`skyarm.studies.identify.identification.identify`); that
            of the package if left out.
        progress: called after every episode.
        note: called with one line before each stage.

    Returns:
        The content of ``results.json``.

    Raises:
        ValueError: an unknown plant.
        NoMachineCodeError: before any flight; suites fly in batches.
        OSError: the folder or a file in it cannot be written; raised before any flight.
    """
    flown = usual_suites() if suites is None else suites
    if flown:
        require_machine_code()
    folder = prepare_folder(out, plants)
    for name in flown:
        prepare(folder / name)
    say = note or (lambda _line: None)
    chosen: dict[str, Any] = {} if evidence is None else {"evidence": evidence}
    campaign = run_campaign(plants, workers=workers, progress=progress, **chosen)
    evidence = evidence or shipped_evidence()
    facts = settings(campaign.all_logs()) | inferred_facts(evidence)
    table = results(campaign.metrics_by_cell(), facts, campaign.found.get(INFERRED))
    predicted = results(campaign.metrics_by_cell(), facts, campaign.found.get(PREDICTED))["experiments"]
    why = reasons(table, campaign.sensitivity)
    say("writing tables and logs")
    _write_data(folder, table, why, campaign)
    tables = [prediction_table(table, predicted, plants[0]), *evidence_tables(evidence)]
    write_atomically(folder / "inference.md", markdown_of(tables).encode())
    say("drawing Figures 3-18")
    first = campaign.logs[plants[0]]
    figures = paper_figures(first, WINDOWS)
    overview = overview_figure(first, STEADY)
    for name, figure in {**{f"figure_{n:02d}": f for n, f in figures.items()}, "overview": overview}.items():
        write_atomically(folder / "figures" / f"{name}.png", image_bytes(figure, dpi=DPI))
    further = {"Inferred settings": inferred_section(table, predicted, evidence, plants[0])} if campaign.found else {}
    for name, suite in flown.items():
        say(f"flying {suite.name}")
        title, further_section = _suite_section(suite, folder / name, workers, progress)
        further[title] = further_section
    say("writing report.html")
    further["The vehicle"] = vehicle_section()
    caption = f"{OVERVIEW} {LOOK.rsplit(', ', 1)[0]}; {plants[0]}."
    opening = image(caption, caption, image_bytes(overview), kind="single opening")
    pages = report_pages(table, campaign.sensitivity, campaign.logs, why, figures, further, opening)
    for name, page in pages.items():
        write_atomically(folder / name, page.encode())
    return table


def prepare_folder(out: str | os.PathLike[str], plants: Sequence[str]) -> Path:
    """The folder, in which every file of the reproduction can be written.

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


def usual_suites() -> dict[str, Suite]:
    """The paper's laws and the centroidal law on the comparison's cases, perfect and noisy."""
    entrants = {name: ENTRANTS[name] for name in LAWS}
    chosen = {name: each for name, each in conditions().items() if name in ("perfect", "noisy")}
    return {"compare": Comparison(entrants=entrants, conditions=chosen)}


def _suite_section(suite: Suite, folder: Path, workers: int, progress: Progress | None) -> tuple[str, str]:
    """Fly a suite; its title, and HTML of its sections, folded, with a link to its own page."""
    found = fly_suite(suite, folder, threads=workers, progress=progress)
    report = suite.report(found)
    link = f'<p>{report.facts}; <a href="{folder.name}/{PAGE}">its own page, with its picture</a>.</p>'
    return report.title, link + "".join(details(each.title or each.name, each.content()) for each in report.sections)


def _files(folder: Path, plants: Sequence[str]) -> list[Path]:
    """Every file that will be written."""
    pages = [
        folder / name
        for name in (
            *("results.json", "sensitivity.json", "table2.md", "inference.md"),
            *(MAIN, *case_files(CASES).values()),
        )
    ]
    drawn = [folder / "figures" / f"{name}.png" for name in NAMED]
    return (
        pages
        + drawn
        + [folder / "logs" / each.plant / f"{each.case}_{each.controller}.npz" for each in flights(plants)]
    )


def _json(value: Any) -> bytes:
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _write_data(folder: Path, table: dict[str, Any], why: Reasons, campaign: Campaign) -> None:
    write_atomically(folder / "results.json", _json(table))
    labels = {f"{each.group}/{each.value}": each.label for each in variations()}
    evidence = {"schema": 1, "labels": labels, "reasons": why, "variations": campaign.sensitivity}
    write_atomically(folder / "sensitivity.json", _json(evidence))
    write_atomically(folder / "table2.md", markdown_tables(table, why).encode())
    for plant, cases in campaign.logs.items():
        for case, controllers in cases.items():
            for controller, log in controllers.items():
                log.save_npz(folder / "logs" / plant / f"{case}_{controller}.npz")
