"""Reproduction of Barakou et al. 2026: simulate all cases, compute metrics, draw figures, write a report."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.paper.flights import STEADY, WINDOWS, Flight, Metrics, flights, fly, metrics, results, settings
from skyarm.paper.inference_tables import evidence_tables, inferred_facts, markdown_of, prediction_table
from skyarm.paper.inferred_settings import INFERRED, PREDICTED, measure_inferred, settings_in, shipped_evidence
from skyarm.paper.published import CASES, Record
from skyarm.paper.report_pages import MAIN, case_files, inferred_section, report_pages
from skyarm.paper.report_tables import markdown_tables
from skyarm.paper.report_text import LOOK, OVERVIEW
from skyarm.paper.variations import variation, variations
from skyarm.records.files import PathLike, require_replaceable, require_writable, write_atomically
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_record import PLANTS
from skyarm.simulate import Log
from skyarm.simulate.workers import Progress
from skyarm.simulate.workers import workers as spread
from skyarm.view.figures.paper_figures import overview_figure, paper_figures
from skyarm.view.figures.style import image_bytes
from skyarm.view.pages import image

Sensitivity = dict[str, dict[str, dict[str, dict[str, Metrics]]]]
"""group -> value -> case -> controller -> metrics."""


@immutable(kw_only=False)
class Job:
    """One flight to simulate, described by plain values that can be sent to another process.

    Attributes:
        flight: case, law and plant. group, value: of a variation. kind, settings: inferred or predicted settings.
    """

    flight: Flight
    group: str = ""
    value: str = ""
    kind: str = ""
    settings: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """Description of one flight for a progress bar."""
        words = f"{self.flight.case} {self.flight.controller} {self.flight.plant}"
        more = [f"{self.group} {self.value}" if self.group else "", self.kind and f"{self.kind} settings"]
        return ", ".join([words, *filter(None, more)])


@dataclass(slots=True)
class Campaign:
    """Results of all flights that reproduce Barakou et al. 2026: logs and metrics.

    Attributes:
        logs: plant -> case -> law -> log of the paper's flights. sensitivity: metrics under variations.
        found: kind -> (case, law, plant) -> metrics under inferred settings.
    """

    logs: dict[str, dict[str, dict[str, Log]]] = field(default_factory=dict)
    sensitivity: Sensitivity = field(default_factory=dict)
    found: dict[str, dict[tuple[str, str, str], Metrics]] = field(default_factory=dict)

    def metrics_by_cell(self) -> dict[tuple[str, str, str], Metrics]:
        """Metrics of the flights with published settings: (case, controller, plant) -> metrics."""
        return {
            (case, controller, plant): metrics(case, log)
            for plant, cases in self.logs.items()
            for case, controllers in cases.items()
            for controller, log in controllers.items()
        }

    def all_logs(self) -> list[Log]:
        """Flight logs of all cases of Barakou et al. 2026."""
        return [log for cases in self.logs.values() for pair in cases.values() for log in pair.values()]

    def keep(self, job: Job, result: Any) -> None:
        """Store the result of one simulated flight."""
        case, law, plant = job.flight.case, job.flight.controller, job.flight.plant
        if job.kind:
            self.found.setdefault(job.kind, {})[case, law, plant] = result
        elif job.group:
            self.sensitivity.setdefault(job.group, {}).setdefault(job.value, {}).setdefault(case, {})[law] = result
        else:
            self.logs.setdefault(plant, {}).setdefault(case, {})[law] = result


def perform(job: Job) -> Log | Metrics:
    """Simulate one flight; returns its log, or its metrics if settings are changed."""
    if job.kind:
        return measure_inferred(job.flight, dict(job.settings))
    if not job.group:
        return fly(job.flight)
    return metrics(job.flight.case, fly(job.flight, variation(job.group, job.value).change))


def inferred_jobs(plants: Sequence[str], evidence: Record) -> list[Job]:
    """Flights to simulate with inferred settings, and with settings predicted from some cases."""
    return [
        Job(flight, kind=kind, settings=tuple(settings_in(evidence, kind).items()))
        for kind, flown in ((INFERRED, plants), (PREDICTED, plants[:1]))
        for flight in flights(flown)
    ]


def run_campaign(
    plants: Sequence[str],
    *,
    sensitivity: bool = True,
    evidence: Record | None = None,
    inferred: bool = True,
    workers: int = 1,
    progress: Progress | None = None,
) -> Campaign:
    """Simulate all flights of the reproduction; results do not depend on the number of workers.

    Args:
        plants: "rigid_body", "mujoco" or both; variations are flown on the first.
        sensitivity: fly the variations too.
        evidence: with the inferred settings; the package's own if left out.
        inferred: fly them.
        workers: processes; 1 flies in this one.
        progress: called after every episode.
    """
    chosen, campaign = variations() if sensitivity else [], Campaign()
    jobs = [Job(flight) for flight in flights(plants)]
    jobs += [
        Job(flight, each.group, each.value)
        for each in chosen
        if each.change is not None
        for flight in flights(plants[:1])
        if flight.case in each.cases
    ]
    jobs += inferred_jobs(plants, evidence or shipped_evidence()) if inferred else []
    # in the order of the report, whichever flies first
    campaign.sensitivity = {each.group: {} for each in chosen}
    for each in chosen:
        campaign.sensitivity[each.group][each.value] = {}
    for job, result in _perform_all(jobs, workers, progress).items():
        campaign.keep(job, result)
    for each in chosen:
        for case in each.cases if each.change is None else ():
            for law, log in campaign.logs[plants[0]][case].items():
                campaign.keep(Job(Flight(case, law, plants[0]), each.group, each.value), metrics(case, log))
    return campaign


def _perform_all(jobs: Sequence[Job], workers: int, progress: Progress | None) -> dict[Job, Any]:
    """Simulate flights, in parallel if there are several workers; results in the given order."""
    done: dict[Job, Any] = {}

    def note(job: Job, result: Any) -> None:
        done[job] = result
        if progress is not None:
            progress(len(done), len(jobs), job.label)

    if workers <= 1:
        for job in jobs:
            note(job, perform(job))
        return done
    with spread(workers) as submit:
        futures = {submit(perform, job): job for job in jobs}
        for future in as_completed(futures):
            note(futures[future], future.result())
    return {job: done[job] for job in jobs}


Note = Callable[[str], None]

NAMED = (*(f"figure_{n:02d}" for n in range(3, 19)), "overview")

DPI = 300
"""Resolution of the figure files, sharp in print at their size of one column."""


def reproduce(
    out: PathLike = "out/paper",
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


def prepare_folder(out: PathLike, plants: Sequence[str]) -> Path:
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
