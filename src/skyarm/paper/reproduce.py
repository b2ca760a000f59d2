"""Reproduction of Barakou et al. 2026: simulate all cases, compute metrics, draw
figures, write a report.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from skyarm.compile.llvm.kernel import require_machine_code
from skyarm.log.flight_log import Log
from skyarm.log.formats import log_from_npz
from skyarm.paper.flights import (
    STATED,
    STEADY,
    WINDOWS,
    Metrics,
    flights,
    results,
    scenario,
    settings,
    work_of,
)
from skyarm.paper.inference_tables import (
    evidence_tables,
    inferred_facts,
    markdown_of,
    prediction_table,
)
from skyarm.paper.inferred_settings import (
    INFERRED,
    PREDICTED,
    inferred_work,
    shipped_evidence,
)
from skyarm.paper.published import CASES, Record
from skyarm.paper.report_pages import (
    MAIN,
    LogsOfLaws,
    case_files,
    figure_name,
    flight_figures,
    inferred_section,
    markdown_tables,
    report_pages,
)
from skyarm.paper.report_text import LOOK, OVERVIEW
from skyarm.paper.variations import Variation, variations
from skyarm.records.files import (
    PathLike,
    needs_extra,
    require_replaceable,
    require_writable,
    write_atomically,
)
from skyarm.records.files.writing import one_writer
from skyarm.scenario.scenario_record import PLANTS
from skyarm.studies.flights import Rows, Store, Work, WorkRunner
from skyarm.studies.flights.executor import Progress, require_place
from skyarm.studies.flights.store import unpack_rows
from skyarm.view.figures.paper_figures import overview_figure, paper_figures
from skyarm.view.figures.style import Picture, image_bytes
from skyarm.view.pages import Facts, image

Sensitivity = dict[str, dict[str, dict[str, dict[str, Metrics]]]]
"""group -> value -> case -> controller -> metrics."""


@dataclass(slots=True)
class Campaign:
    """Results of all flights that reproduce Barakou et al. 2026: logs and metrics.

    Attributes:
        logs: plant -> case -> law -> log of the paper's flights.
        files: (plant, case, law) -> content of that log's npz file.
        sensitivity: metrics under variations.
        found: settings (stated, inferred, predicted, a variation) -> (case, law,
            plant) -> metrics.
    """

    logs: dict[str, dict[str, dict[str, Log]]] = field(default_factory=dict)
    files: dict[tuple[str, str, str], bytes] = field(default_factory=dict)
    sensitivity: Sensitivity = field(default_factory=dict)
    found: dict[str, dict[tuple[str, str, str], Metrics]] = field(default_factory=dict)

    def all_logs(self) -> list[Log]:
        """Flight logs of all cases of Barakou et al. 2026."""
        pairs = [pair for cases in self.logs.values() for pair in cases.values()]
        return [log for pair in pairs for log in pair.values()]

    def keep(self, work: Work, rows: Rows) -> None:
        """Store the results of one simulated flight."""
        case, law, plant, settings = map(str, work.fixed.values())
        self.found.setdefault(settings, {})[case, law, plant] = {
            # JSON has no NaN
            name: None if np.isnan(column[0]) else float(column[0])
            for name, column in rows.items()
            if column.dtype.kind == "f" and name != "end_time"
        }
        # logs of the stated settings alone: they are drawn and written
        if work.keeps_log:
            content = self.files[plant, case, law] = rows["log"][0]
            self.logs.setdefault(plant, {}).setdefault(case, {})[law] = log_from_npz(
                content, work.label
            )


def works(
    plants: Sequence[str],
    chosen: Sequence[Variation] = (),
    evidence: Record | None = None,
    *,
    inferred: bool = True,
) -> list[Work]:
    """All flights of the reproduction, each as a work item.

    Args:
        plants: "rigid_body", "mujoco" or both; variations are flown on the first.
        chosen: variations.
        evidence: results of a search for the inferred settings; the package's own if
            left out.
        inferred: fly them.
    """
    planned = [work_of(flight, scenario(flight)) for flight in flights(plants)]
    first = flights(plants[:1])
    for each in chosen:
        if each.change is not None:
            planned += [
                work_of(flight, each.change(scenario(flight)), each.name)
                for flight in first
                if flight.case in each.cases
            ]
    if inferred:
        evidence = evidence or shipped_evidence()
        for kind, flown in ((INFERRED, flights(plants)), (PREDICTED, first)):
            planned += [inferred_work(flight, evidence, kind) for flight in flown]
    return planned


def run_campaign(
    plants: Sequence[str],
    *,
    sensitivity: bool = True,
    evidence: Record | None = None,
    inferred: bool = True,
    workers: int = 1,
    on: str | None = None,
    store: Store | None = None,
    progress: Progress | None = None,
    drawing: Drawing | None = None,
) -> Campaign:
    """Simulate all flights that reproduce Barakou et al. 2026; backend and number of
    workers change no result.

    Args:
        plants: "rigid_body", "mujoco" or both; variations are flown on the first.
        sensitivity: fly the variations too.
        evidence: results of a search for the inferred settings; the package's own if
            left out.
        inferred: fly them.
        workers: processes or processors.
        on: "local", "processes", "ray" or "ray:HOST:PORT"; processes if left out, of
            one worker local.
        store: keeps the flights; those that it holds do not fly again.
        progress: called after every episode.
        drawing: pictures of the paper's flights on the first plant, one of which is
            drawn whenever another flight has landed.
    """
    chosen = variations() if sensitivity else []
    every = works(plants, chosen, evidence, inferred=inferred)
    pictured = [
        work for work in every if work.keeps_log and work.fixed["plant"] == plants[0]
    ]
    landed: dict[str, bytes] = {}
    with WorkRunner(on, workers, store) as crew:
        for work, content in crew.fly(every):
            landed[work.label] = content
            if progress is not None:
                progress(len(landed), len(every), work.label)
            # of flights that were kept none flies meanwhile
            if (
                drawing is not None
                and crew.flights
                and all(each.label in landed for each in pictured)
            ):
                # what cannot be drawn is said once all have flown
                with suppress(Exception):
                    drawing.step(lambda: _campaign_of(pictured, landed).logs[plants[0]])
    # in the order of the report, whichever landed first
    campaign = _campaign_of(every, landed)
    for each in chosen:
        cells = campaign.sensitivity.setdefault(each.group, {}).setdefault(
            each.value, {}
        )
        for (case, law, plant), numbers in campaign.found[each.name].items():
            if case in each.cases and plant == plants[0]:
                cells.setdefault(case, {})[law] = numbers
    return campaign


def _campaign_of(works: Sequence[Work], contents: Mapping[str, bytes]) -> Campaign:
    """Results of some work items, from the contents of their result files by label."""
    campaign = Campaign()
    for work in works:
        campaign.keep(work, unpack_rows(contents[work.label]))
    return campaign


Note = Callable[[str], None]

NAMED = (*map(figure_name, range(3, 19)), "overview")

DPI = 300
"""Resolution of the figure files, sharp in print at their size of one column."""


class Drawing:
    """Pictures of the paper's flights, drawn one figure at a time.

    Attributes:
        files: name -> PNG of the files of the paper's figures.
        shown: name -> PNG of these figures and of the flights, for the report's pages.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.shown: dict[str, bytes] = {}
        self._left: list[Callable[[], None]] | None = None

    def step(self, logs: Callable[[], LogsOfLaws]) -> bool:
        """Draw another figure; False if all are drawn. ``logs`` gives case -> law ->
        log.

        What cannot be drawn stays the next one.
        """
        if self._left is None:
            self._left = self._drawings(logs())
        if self._left:
            self._left[0]()
            # only after it is drawn: what fails stays, and is raised at the end
            del self._left[0]
        return bool(self._left)

    def _drawings(self, logs: LogsOfLaws) -> list[Callable[[], None]]:
        figures = {
            figure_name(number): figure
            for number, figure in paper_figures(logs, WINDOWS).items()
        }
        figures["overview"] = overview_figure(logs, STEADY)
        files = (
            partial(self._draw_file, name, figure) for name, figure in figures.items()
        )
        return [
            *files,
            *(
                partial(self._draw, name, make)
                for name, make in flight_figures(logs).items()
            ),
        ]

    def _draw_file(self, name: str, figure: Picture) -> None:
        self.files[name] = image_bytes(figure, dpi=DPI)
        figure.set_layout_engine("none")  # what is arranged already
        self.shown[name] = image_bytes(figure)

    def _draw(self, name: str, make: Callable[[], Picture]) -> None:
        self.shown[name] = image_bytes(make())


def reproduce(
    out: PathLike = "out/paper",
    *,
    plants: Sequence[str] = PLANTS,
    workers: int = 1,
    on: str | None = None,
    evidence: Record | None = None,
    progress: Progress | None = None,
    note: Note | None = None,
) -> Facts:
    """Simulate the five cases of Barakou et al. 2026 with both controllers; write
    results, figures, report.

    Writes ``results.json``, ``sensitivity.json``, ``table2.md``, ``inference.md``,
    ``report.html`` and a page for each case beside it (``case1.html`` ...),
    ``figures/figure_03.png`` ... ``figure_18.png`` and ``overview.png`` (first plant),
    and ``logs/PLANT/CASE_CONTROLLER.npz``; each file appears whole or not at all.
    Flights are kept in ``rows`` (extra: sweep): called again after an interruption it
    goes on, and ends with the same files.

    Args:
        out: folder, made if missing.
        plants: "rigid_body", "mujoco" or both.
        workers: processes or processors that fly; no number depends on it.
        on: "local", "processes", "ray" or "ray:HOST:PORT"; processes if left out, of
            one worker local.
        evidence: results of a search for the paper's unstated settings
            (``research/infer.py`` of the source); those of the package if left out.
        progress: called after every episode.
        note: called with one line before each stage.

    Returns:
        The content of ``results.json``.

    Raises:
        ValueError: an unknown plant or place.
        TakenError: another process writes into the folder.
        NoMachineCodeError: before any flight; as Python floats all flights take hours.
        OSError: the folder or a file in it cannot be written; raised before any flight.
    """
    # before any flight: as Python floats all of them take hours
    require_machine_code()
    if on is not None:
        require_place(on)
    folder = prepare_folder(out, plants)
    say = note or (lambda _line: None)
    evidence = evidence or shipped_evidence()
    # two commands would mix their flights in one folder
    with one_writer(folder):
        store = Store.if_kept(folder)
        if store is None:
            say(f"pyarrow is missing, flights are not kept; {needs_extra('sweep')}")
        drawing = Drawing()
        campaign = run_campaign(
            plants,
            evidence=evidence,
            workers=workers,
            on=on,
            store=store,
            progress=progress,
            drawing=drawing,
        )
        return _write(folder, plants, campaign, drawing, evidence, say)


def _write(
    folder: Path,
    plants: Sequence[str],
    campaign: Campaign,
    drawing: Drawing,
    evidence: Record,
    say: Note,
) -> Facts:
    """Write tables, logs, figures and pages; returns the content of
    ``results.json``.
    """
    stated = campaign.found[STATED]
    facts = settings(campaign.all_logs()) | inferred_facts(evidence)
    table = results(stated, facts, campaign.found.get(INFERRED))
    predicted = results(stated, facts, campaign.found.get(PREDICTED))["experiments"]
    say("writing tables and logs")
    _write_data(folder, table, campaign)
    tables = [prediction_table(table, predicted, plants[0]), *evidence_tables(evidence)]
    write_atomically(folder / "inference.md", markdown_of(tables).encode())
    say("drawing Figures 3-18")
    while drawing.step(lambda: campaign.logs[plants[0]]):
        pass
    for name, picture in drawing.files.items():
        write_atomically(folder / "figures" / f"{name}.png", picture)
    inferred = (
        inferred_section(table, predicted, evidence, plants[0])
        if INFERRED in campaign.found
        else ""
    )
    say("writing report.html")
    caption = f"{OVERVIEW} {LOOK.rsplit(', ', 1)[0]}; {plants[0]}."
    opening = image(caption, caption, drawing.shown["overview"], kind="single opening")
    pages = report_pages(
        table, campaign.sensitivity, campaign.logs, drawing.shown, inferred, opening
    )
    for name, page in pages.items():
        write_atomically(folder / name, page.encode())
    return table


def prepare_folder(out: PathLike, plants: Sequence[str]) -> Path:
    """Create the output folder, and check that every file of the reproduction can be
    written.

    Raises:
        ValueError: an unknown plant.
        OSError: the folder or a file in it cannot be written.
    """
    for plant in plants:
        if plant not in PLANTS:
            raise ValueError(
                f"plants = {list(plants)}: must be some of {', '.join(PLANTS)}"
            )
    if not plants:
        raise ValueError(f"plants = []: must be one of {', '.join(PLANTS)} at least")
    folder = require_writable(out)
    for inner in ("figures", *(f"logs/{plant}" for plant in plants)):
        require_writable(folder / inner)
    # hours of flights should not end in a file that cannot be written
    require_replaceable(*_files(folder, plants))
    return folder


def _files(folder: Path, plants: Sequence[str]) -> list[Path]:
    """Paths of all files that the reproduction writes."""
    names = [
        "results.json",
        "sensitivity.json",
        "table2.md",
        "inference.md",
        MAIN,
        *case_files(CASES).values(),
    ]
    names += [f"figures/{name}.png" for name in NAMED]
    names += [
        f"logs/{each.plant}/{each.case}_{each.controller}.npz"
        for each in flights(plants)
    ]
    return [folder / name for name in names]


def _json(value: Record) -> bytes:
    # NaN would be no JSON: it is an error here, not a file that others refuse
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def _write_data(folder: Path, table: Facts, campaign: Campaign) -> None:
    write_atomically(folder / "results.json", _json(table))
    write_atomically(
        folder / "sensitivity.json",
        _json({"schema": 1, "variations": campaign.sensitivity}),
    )
    write_atomically(folder / "table2.md", markdown_tables(table).encode())
    for (plant, case, law), content in campaign.files.items():
        write_atomically(folder / "logs" / plant / f"{case}_{law}.npz", content)
