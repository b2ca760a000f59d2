"""Survive suite: flights lost under blows, failing sensors, wrong plants, hard landings
and half turns, law by law.

All conditions of a trial are lanes of one compiled program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from skyarm.control.controller import ControllerError
from skyarm.log.metrics.windows import LAST, Window, Windows
from skyarm.records.arrays import Columns
from skyarm.records.immutable import immutable
from skyarm.scenario.numbers import number_at
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.assess.survival_limits import LAST_TILT, lost
from skyarm.studies.compare.cell_flights import Cell, CellFlights, Document, Record
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.faulty_sensors import START
from skyarm.studies.compare.run_suite import Pngs, Refused, Suite
from skyarm.studies.compare.suite import Case, Condition
from skyarm.studies.compare.survive_trials import TRIALS, SurviveTrial
from skyarm.studies.trial.facts import PAPER
from skyarm.studies.trial.table import refusals, report_of
from skyarm.view.pages import Report, Section, Table, number, table_of

SURVIVE = "survive-suite"

FLAGSHIP = "centroidal_tip"

LAWS = (
    FLAGSHIP,
    "hybrid_computed_torque_tuned",
    "decoupled_pd_tuned",
    "indi_tuned",
    "kim2013_tuned",
    "guo2023_tuned",
    "li2024_tuned",
)
"""Default laws: the flagship and simpler ones, which fit any vehicle."""

NOISES = 3
"""Number of noise seeds of each flight in a noisy trial: an odd one shows which way
most go."""

WORST = "gust_ee_error_max_continuous"
"""Metric: largest tip error from the event on."""


@immutable(slots=False)
class SurviveFlights(CellFlights):
    """Flights of one law at one value of a trial; all values of a group of trials share
    a compiled program.

    Attributes:
        built: scenario of the trial. paths: numbers that flights of the group vary,
            with those of the scenario.
        lanes: numbers of each flight. near: largest mean tip error at the end of a
            flight that is not lost, m.
    """

    built: Scenario
    paths: Mapping[str, float]
    lanes: tuple[Mapping[str, float], ...]
    near: float

    further_metrics = (WORST, LAST_TILT)

    def scenario(self) -> Scenario:
        """Scenario that all flights have in common."""
        return self.built

    def values(self, scenario: Scenario) -> Columns:
        """Numbers of the flights: parameter path -> values (flights,)."""
        return {
            path: np.array([each.get(path, own) for each in self.lanes])
            for path, own in self.paths.items()
        }


@immutable
class SurviveSuite(Suite[SurviveFlights]):
    """Benchmark that counts the flights that laws do not survive.

    Attributes:
        laws: names, in order. conditions: names of trials, in order. vehicle: name or
            file. seed: seed of the noise.
        plant: kind of plant. quick: the hardest value of each trial only, without
            repetition.
    """

    laws: tuple[str, ...] = LAWS
    conditions: tuple[str, ...] = tuple(TRIALS)
    vehicle: str = PAPER
    seed: int = 0
    plant: str = "rigid_body"
    quick: bool = False

    name, file, folder = SURVIVE, "survive", "out/survive"
    settings = ("vehicle", "seed", "plant", "quick")

    def plan_cells(self) -> tuple[list[SurviveFlights], Refused]:
        """All flights of the suite, and reasons why a law is excluded."""
        cells = list[SurviveFlights]()
        refused = dict[str, str]()
        chosen = [trial for trial in TRIALS.values() if trial.name in self.conditions]
        for law in self.laws:
            try:
                # trials of one group stand next to each other in TRIALS
                for _, group in groupby(chosen, key=lambda trial: trial.group):
                    cells += self._flights(law, list(group))
            except ControllerError as error:
                refused[law] = str(error)
        return cells, refused

    def _flights(
        self, law: str, trials: Sequence[SurviveTrial]
    ) -> list[SurviveFlights]:
        """Flights of a law in the trials of a group."""
        cells = list[SurviveFlights]()
        end = trials[0].duration
        setting = trials[0].setting(self.vehicle, self.plant)
        windows = Windows(steady=Window(end - LAST, end), gust=Window(START, end))
        common = None
        for trial in trials:
            for value in trial.values[-1:] if self.quick else trial.values:
                once = trial.flights(setting, value)
                row = f"{trial.name.replace('_', ' ')} {value:g} {trial.unit}"
                lanes = tuple(once * (NOISES if trial.noisy and not self.quick else 1))
                # flights that differ in numbers share the scenario, and so the program,
                # of their group
                built = (
                    common if common and any(once) else trial.under(setting, law, value)
                )
                common = built if any(once) else common
                cells.append(
                    SurviveFlights(
                        entrant=Entrant(name=law, law=law),
                        case=Case(name=trial.group, windows=windows),
                        condition=Condition(
                            name=row.rstrip(),
                            title=trial.title,
                            noisy=trial.noisy,
                            episodes=len(lanes),
                        ),
                        plant=self.plant,
                        seed=self.seed,
                        built=built,
                        paths={
                            path: number_at(built, path)
                            for numbers in once
                            for path in numbers
                        },
                        lanes=lanes,
                        near=trial.near,
                    )
                )
        # equal columns in all cells of a group, so that they share one program
        shared = {path: own for cell in cells for path, own in cell.paths.items()}
        return [replace(cell, paths=shared) if cell.paths else cell for cell in cells]

    def judge(
        self, flown: Sequence[tuple[SurviveFlights, Cell]], refused: Refused
    ) -> Document:
        """Evaluate the suite: flights, lost ones, why, and largest tip error (m) of the
        others, by value and law.
        """
        rows: Document = {}
        for flights, cell in flown:
            row, _, law = flights.name
            gone = lost(cell.metrics, cell.completed, flights.near)
            rows.setdefault(row, {"title": flights.condition.title, "laws": {}})[
                "laws"
            ][law] = {
                "of": gone.size,
                "lost": int(gone.sum()),
                "endings": sorted({str(each) for each in cell.status[gone]}),
                "worst": max(cell.metrics[WORST][~gone].tolist(), default=None),
            }
        laws = [law for law in self.laws if law not in refused]
        return {"laws": laws, "not_flown": dict(refused), "rows": rows}

    def report(self, found: Record, pictures: Pngs = None) -> Report:
        """Report: flights that are lost and the largest tip error, law beside law."""
        laws = found["laws"]
        notes = [MEANING, *refusals(found)]
        for row, others in worse_conditions(found).items() if FLAGSHIP in laws else ():
            notes.append(
                f"{FLAGSHIP} is lost more often in {row} than {', '.join(others)}."
            )
        titles = [(row, entry["title"]) for row, entry in found["rows"].items()]
        tables = [table_of(["condition", *laws], survive_rows(found))]
        return report_of(
            f"What laws survive on {found['vehicle']}",
            f"{len(laws)} laws, seed {found['seed']}, plant {found['plant']}",
            [Section(name="Lost and flown", notes=notes, tables=tables)],
            page_only=[
                Section(
                    title="Conditions",
                    tables=[Table(head=("condition", "flights"), rows=titles)],
                )
            ],
        )


def worse_conditions(found: Record, law: str = FLAGSHIP) -> dict[str, list[str]]:
    """Conditions in which a law is lost more often than others, with the names of
    these.
    """
    behind: dict[str, list[str]] = {}
    for row, entry in found["rows"].items():
        most = entry["laws"][law]["lost"]
        if others := [
            each for each, point in entry["laws"].items() if point["lost"] < most
        ]:
            behind[row] = others
    return behind


MEANING = (
    "A flight is lost where an ending ended it (it diverged, a joint passed its limit,"
    " a rotor or the base touched), or where in its last 5 s the tip was over 0.5 m off"
    " in the mean (0.05 m after a blow, 0.1 m after turning round), or the tilt over 80"
    " degrees. Cells: lost flights of all flights; largest tip error of the others from"
    " 2 s on, mm."
)


def survive_rows(found: Record) -> list[list[str]]:
    """Table rows: each value of each condition, one column per law, and the sum of all
    lost flights.
    """
    every, laws = found["rows"], found["laws"]
    rows = [
        [row, *(cell_text(entry["laws"][law]) for law in laws)]
        for row, entry in every.items()
    ]
    sums = (sum(entry["laws"][law]["lost"] for entry in every.values()) for law in laws)
    return [*rows, ["lost in all", *map(str, sums)]]


def cell_text(point: Record) -> str:
    """Table text of a result: lost flights of all, and the largest tip error (mm) of
    the others.
    """
    gone = f"{point['lost']} of {point['of']} lost; " if point["lost"] else ""
    return gone + number(point["worst"], 1e3)
