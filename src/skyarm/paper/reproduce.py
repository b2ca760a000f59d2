"""The paper reproduced: fly, measure, draw, write."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from skyarm.compare.comparison import Comparison
from skyarm.compare.comparison_report import CAPTION, main_sections
from skyarm.compare.envelope import Envelope, fly_envelope
from skyarm.compare.envelope_report import summary_section
from skyarm.compare.run_suite import PAGE, Progress, fly_suite, prepare
from skyarm.compare.summary import table as summarised
from skyarm.files import require_replaceable, require_writable, write_atomically
from skyarm.pages import details, image
from skyarm.paper.beyond import NAMES, beyond_section
from skyarm.paper.campaign import WIND, Campaign, run_campaign
from skyarm.paper.flights import STEADY, WINDOWS, flights, results, settings
from skyarm.paper.inference_tables import evidence_tables, inferred_facts, markdown_of, prediction_table
from skyarm.paper.inferred_settings import INFERRED, PREDICTED, shipped_evidence
from skyarm.paper.published import CASES
from skyarm.paper.reasons import Reasons, reasons
from skyarm.paper.report_pages import FILM, MAIN, Opening, case_files, inferred_section, report_pages, vehicle_section
from skyarm.paper.report_tables import markdown_tables
from skyarm.paper.report_text import LOOK, OVERVIEW
from skyarm.paper.variations import variations
from skyarm.scenario.scenario_record import PLANTS
from skyarm.simulate import Log
from skyarm.view.figures.paper_figures import overview_figure, paper_figures, tip_figure
from skyarm.view.figures.style import image_bytes

Note = Callable[[str], None]

Film = Callable[[Mapping[str, Mapping[str, Log]]], tuple[bytes, str] | None]
"""From case -> law -> log to a small animated WebP and the sentence that says what it shows; None where none can be."""

COMPARED = "compare"
"""Folder of the whole comparison, beside the report."""

ENVELOPE_FOLDER = "envelope"
"""The same of the envelope."""

NAMED = (*(f"figure_{n:02d}" for n in range(3, 19)), "overview", "tip")

DPI = 300
"""Resolution of the figure files, sharp in print at their size of one column."""


def reproduce(
    out: str | os.PathLike[str] = "out/paper",
    *,
    plants: Sequence[str] = PLANTS,
    workers: int = 1,
    comparison: Comparison | None = None,
    evidence: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    note: Note | None = None,
    film: Film | None = None,
    envelope: Envelope | None = None,
) -> dict[str, Any]:
    """Fly the paper's five experiments with both controllers and write everything that comes of it.

    Writes ``results.json``, ``sensitivity.json``, ``beyond.json``, ``table2.md``, ``inference.md``, ``report.html`` and
    a page for each case beside it (``case1.html`` ...), ``film.webp`` where a film is drawn,
    ``figures/figure_03.png`` ... ``figure_18.png``, ``overview.png`` and ``tip.png`` (first plant),
    ``logs/PLANT/CASE_CONTROLLER.npz``; each file appears whole or not at all.

    Args:
        out: folder, made if missing.
        plants: "rigid_body", "mujoco" or both.
        workers: processes that fly.
        comparison: fly it too, into ``compare/``, where it goes on if it was interrupted, and show its tables.
        evidence: of a search for the paper's unstated settings (:func:`skyarm.identify.identification.identify`); that
            of the package if left out.
        progress: called after every episode.
        note: called with one line on the flights and one before each further stage.
        film: draws a film of the flights on the first plant, with which the report opens; without it the report opens
            with ``overview.png``.
        envelope: fly it too, into ``envelope/``, where it goes on if it was interrupted, and show its tables.

    Returns:
        The content of ``results.json``.

    Raises:
        ValueError: an unknown plant.
        OSError: the folder or a file in it cannot be written; raised before any flight.
    """
    folder = prepare_folder(out, plants)
    if comparison is not None:
        prepare(folder / COMPARED)
    if envelope is not None:
        prepare(folder / ENVELOPE_FOLDER)
    say = note or (lambda _line: None)
    chosen: dict[str, Any] = {} if evidence is None else {"evidence": evidence}
    campaign = run_campaign(plants, workers=workers, progress=progress, **chosen)
    say(campaign.effort.words())
    evidence = evidence or shipped_evidence()
    facts = settings(campaign.all_logs()) | inferred_facts(evidence)
    table = results(campaign.measured(), facts, campaign.found.get(INFERRED))
    predicted = results(campaign.measured(), facts, campaign.found.get(PREDICTED))["experiments"]
    why = reasons(table, campaign.sensitivity)
    say("writing tables and logs")
    summaries = summarised(campaign.cells)
    _write_data(folder, table, why, campaign, summaries)
    tables = [prediction_table(table, predicted, plants[0]), *evidence_tables(evidence)]
    write_atomically(folder / "inference.md", markdown_of(tables).encode())
    say("drawing Figures 3-18")
    first = campaign.logs[plants[0]]
    figures = paper_figures(first, WINDOWS)
    overview = overview_figure(first, STEADY)
    for name, figure in {**{f"figure_{n:02d}": f for n, f in figures.items()}, "overview": overview}.items():
        write_atomically(folder / "figures" / f"{name}.png", image_bytes(figure, dpi=DPI))
    further = _further(folder, campaign, summaries)
    if envelope is not None:
        say("flying the envelope")
        further["The envelope"] = _envelope(envelope, folder / ENVELOPE_FOLDER, workers, progress)
    if comparison is not None:
        say("flying the comparison")
        further["All laws compared"] = _comparison(comparison, folder / COMPARED, workers, progress)
    say("writing report.html")
    shown = {"Inferred settings": inferred_section(table, predicted, evidence, plants[0])} if campaign.found else {}
    further["The vehicle"] = vehicle_section()
    opening = _opening(folder, first, image_bytes(overview), plants[0], film)
    pages = report_pages(table, campaign.sensitivity, campaign.logs, why, figures, shown | further, opening)
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


def _opening(
    folder: Path, flown: Mapping[str, Mapping[str, Log]], overview: bytes, plant: str, film: Film | None
) -> Opening:
    """What the report opens with; a film is written beside it, too."""
    caption = f"{OVERVIEW} {LOOK.rsplit(', ', 1)[0]}; {plant}."
    drawn = None if film is None else film(flown)
    if drawn is None:
        return Opening(picture=overview, caption=caption)
    content, words = drawn
    write_atomically(folder / FILM, content)
    return Opening(picture=overview, caption=caption, film=content, film_caption=words)


def _envelope(envelope: Envelope, folder: Path, workers: int, progress: Progress | None) -> str:
    """Fly an envelope; HTML of its sentences and summary."""
    limits = fly_envelope(envelope, folder, threads=workers, progress=progress)
    link = f'<p><a href="{folder.name}/{PAGE}">Axis by axis, and what violates the rules</a>.</p>'
    return summary_section(limits, (folder / "envelope.png").read_bytes()).content() + link


def _comparison(comparison: Comparison, folder: Path, workers: int, progress: Progress | None) -> str:
    """Fly a comparison; HTML of its tables."""
    found = fly_suite(comparison, folder, threads=workers, progress=progress)
    facts = f"{len(comparison.entrants)} laws, seed {found['seed']}, plant {found['plant']}"
    link = f'<p>{facts}; <a href="{folder.name}/{PAGE}">its own page</a>.</p>'
    drawn = image(CAPTION, CAPTION, (folder / "laws.png").read_bytes(), kind="single")
    sections = main_sections(found, comparison.entrants, comparison.conditions)
    return link + drawn + "".join(details(each.title, each.content()) for each in sections)


def _further(folder: Path, campaign: Campaign, summaries: dict[str, Any]) -> dict[str, str]:
    """Sections beyond the paper: title -> HTML; their picture is written too. Empty where nothing of it flew."""
    if not campaign.cells:
        return {}
    logs, picture = campaign.in_the_wind(), b""
    if logs:
        flown = {NAMES[name]: log for name, log in next(iter(logs.values())).items()}
        figure = tip_figure(flown, WINDOWS[WIND], "Case 3 in constant wind, perfect state")
        picture = image_bytes(figure, dpi=160)
        write_atomically(folder / "figures" / "tip.png", image_bytes(figure, dpi=DPI))
    return {"Beyond the paper": beyond_section(summaries, logs, picture)}


def _files(folder: Path, plants: Sequence[str]) -> list[Path]:
    """Every file that will be written."""
    pages = [
        folder / name
        for name in (
            *("results.json", "sensitivity.json", "beyond.json", "table2.md", "inference.md"),
            *(MAIN, *case_files(CASES).values(), FILM),
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


def _write_data(
    folder: Path, table: dict[str, Any], why: Reasons, campaign: Campaign, summaries: dict[str, Any]
) -> None:
    write_atomically(folder / "results.json", _json(table))
    labels = {f"{each.group}/{each.value}": each.label for each in variations()}
    evidence = {"schema": 1, "labels": labels, "reasons": why, "variations": campaign.sensitivity}
    write_atomically(folder / "sensitivity.json", _json(evidence))
    write_atomically(
        folder / "beyond.json", _json({"schema": 1, "seed": 0, "plant": "rigid_body", "summaries": summaries})
    )
    write_atomically(folder / "table2.md", markdown_tables(table, why).encode())
    for plant, cases in campaign.logs.items():
        for case, controllers in cases.items():
            for controller, log in controllers.items():
                log.save_npz(folder / "logs" / plant / f"{case}_{controller}.npz")
