"""Benchmark of the laws of a team: two vehicles with arms carry a bar under conditions that trouble them."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np

from skyarm.log.metrics.metric_catalogue import TEAMS
from skyarm.records.arrays import AnyArray as Array
from skyarm.records.files import must_be_one_of, shown, versions
from skyarm.records.immutable import immutable
from skyarm.scenario.scenario_file import LIBRARY, scenario_from
from skyarm.scenario.scenario_record import Scenario
from skyarm.studies.compare.cell_flights import JITTER, LIMITED, CellFlights, Document, Record, values_of
from skyarm.studies.compare.entrants import Entrant
from skyarm.studies.compare.run_suite import Refused, SummarySuite
from skyarm.studies.compare.suite import DELAY, NOISE, Case, Condition, library_rows
from skyarm.studies.sweep.design import values
from skyarm.studies.sweep.distributions import distribution_from
from skyarm.studies.sweep.expressions import derived_from
from skyarm.studies.sweep.study import Study
from skyarm.view.pages import Report, Section, Table, number

TEAM, FLOWN = "team-suite", "two_carry_a_bar"

ROWS: Mapping[str, Record] = {row["name"]: row for row in library_rows("team_rows")}
"""Condition -> its fields; left out, its flights are those of the suite, and all laws fly it."""

LAWS: Mapping[str, Record] = {row.pop("name"): row for row in library_rows("team_laws")}
"""Law of a team -> entries of the scenario's file in place of its own."""

COLUMNS: Sequence[tuple[str, str, float]] = (
    ("position, mm", "team_position_mean", 1e3),
    ("largest", "team_position_max", 1e3),
    ("direction, deg", "team_turn_mean", 57.29577951308232),
    ("largest", "team_turn_max", 57.29577951308232),
    ("RMS error of pull, N", "team_pull_rms", 1.0),
    ("largest", "team_pull_max", 1.0),
    ("rotor jitter, rad/s", JITTER, 1.0),
    ("a rotor at its limit, %", LIMITED, 100.0),
    ("a joint at its limit, %", "joint_saturation", 100.0),
)
"""Columns: head, metric, factor from SI to the unit of the head; of several vehicles the largest."""


@immutable
class Row(Condition):
    """Condition of the benchmark.

    Attributes:
        tables: entries of the scenario's file in place of its own; a table for a list goes into each of its tables.
        vary, derived: numbers of each flight, as in a study.
    """

    tables: Document = field(default_factory=dict)
    vary: Document = field(default_factory=dict)
    derived: Document = field(default_factory=dict)


def with_entries(table: Document, entries: Record) -> Document:
    """Table of a file with entries in place of its own, tables key by key; a table for a list in each of its tables."""
    changed = dict(table)
    for key, entry in entries.items():
        match table.get(key), entry:
            case dict() as own, dict():
                changed[key] = with_entries(own, entry)
            case list() as own, dict():
                changed[key] = [with_entries(each, entry) for each in own]
            case _:
                changed[key] = entry
    return changed


@immutable(slots=False)
class TeamFlights(CellFlights):
    """Flights of one law of a team under one condition."""

    condition: Row

    further_metrics = (*TEAMS, "joint_saturation")

    def scenario(self) -> Scenario:
        """Shipped scenario with the entries of law and condition."""
        document = tomllib.loads((LIBRARY / f"{FLOWN}.toml").read_text("utf-8"))
        noisy: Document = {"sensors": dataclasses.asdict(NOISE), "delays": {"measurement": DELAY}}
        noisy["team"] = {"position_noise": NOISE.position, "attitude_noise": NOISE.attitude}  # of the carried body
        plant = {"plant": {"kind": self.plant}}
        for tables in (plant, LAWS[self.entrant.law], noisy if self.condition.noisy else {}, self.condition.tables):
            document = with_entries(document, tables)
        return dataclasses.replace(scenario_from(document), seed=self.seed)

    def values(self, scenario: Scenario) -> dict[str, Array]:
        """Numbers of the flights, the same for every law: parameter path -> values (flights,)."""
        condition = self.condition
        study = Study(
            name=condition.name,
            scenarios={},
            vary={path: distribution_from(each, path) for path, each in condition.vary.items()},
            derived=derived_from(condition.derived, condition.vary),
            episodes=condition.episodes,
            seed=self.seed,
            document={},
        )
        drawn = values(study, np.arange(study.episodes))
        return {path: drawn[path] for path in study.paths}


@immutable
class TeamSuite(SummarySuite[TeamFlights]):
    """Benchmark of several laws of a team.

    Attributes:
        laws: names. rows: names of conditions, in order. seeds: flights of each condition with chance.
        seed: seed of draws and noise. plant: kind of plant.
    """

    laws: Sequence[str] = tuple(LAWS)
    rows: Sequence[str] = tuple(ROWS)
    seeds: int = 8
    seed: int = 0
    plant: str = "rigid_body"

    name, file, folder = TEAM, "team", "out/team"
    settings = ("seeds", "seed", "plant")

    def plan_cells(self) -> tuple[list[TeamFlights], Refused]:
        """All flights of the benchmark."""
        for chosen, there in ((self.laws, LAWS), (self.rows, ROWS)):
            for name in chosen:
                if name not in there:
                    raise ValueError(f"{TEAM}: {shown(name)}: {must_be_one_of(there, name)}")
        case, planned = Case(name=FLOWN, title="", scenario=FLOWN), list[TeamFlights]()
        for name in self.rows:
            row = {"noisy": False, "episodes": self.seeds, "cases": (), **ROWS[name]}
            laws, plant = row.pop("laws", LAWS), row.pop("plant", self.plant)
            planned += [
                TeamFlights(
                    entrant=Entrant(name=law, group="own", law=law),
                    case=case,
                    condition=Row(**row),
                    plant=plant,
                    seed=self.seed,
                )
                for law in laws
                if law in self.laws
            ]
        return planned, {}

    def report(self, found: Record, pictures: Mapping[str, bytes] | None = None) -> Report:
        """Report of the benchmark with one table: a row per condition and law."""
        rows = [
            [ROWS[row]["title"], law, f"{each['success']} of {each['episodes']}", *numbers_of(each)]
            for row, cases in found["summaries"].items()
            for law, each in cases[FLOWN].items()
        ]
        head = ["condition", "law", ">placed", *(f">{title}" for title, *_ in COLUMNS)]
        return Report(
            title=f"Laws of a team, {FLOWN} on {found['plant']}",
            facts=f"{found['seeds']} flights, seed {found['seed']}; skyarm {versions()['skyarm']}",
            sections=[Section(name="Flights that came to their end", tables=[Table(head=head, rows=rows)])],
        )


def numbers_of(summary: Record) -> list[str]:
    """Cells of a law under a condition: means over its flights, of largest errors the largest."""
    cells = []
    for _, name, factor in COLUMNS:
        spreads = filter(None, values_of(summary["metrics"], name))
        how = "max" if name.endswith("max") else "mean"
        cells.append(number(max((each[how] for each in spreads), default=None), factor))
    return cells
